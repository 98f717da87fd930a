"""An SQLite file that is away for a while, as with its share, is neither made anew nor missed when it is back."""

from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from app.storage import Database, schema
from app.storage.health import in_use


def test_a_file_that_is_away_is_not_made_anew_and_found_when_it_is_back(tmp_path: Path) -> None:
    folder, away = tmp_path / "data", tmp_path / "away"
    folder.mkdir()
    with closing(Database(f"sqlite:///{folder / 'plant.db'}")) as database:
        schema.migrate(database)
        folder.rename(away)
        folder.mkdir()  # the mount point
        for use in (database.read, database.write):
            with pytest.raises(OperationalError), use() as connection:
                in_use(connection)
        assert list(folder.iterdir()) == []
        folder.rmdir()
        away.rename(folder)
        with database.write() as connection:
            connection.execute(text("INSERT INTO loops (tag, created_at) VALUES ('FIC1', 0)"))
        with database.read() as connection:
            assert in_use(connection)


def test_a_file_that_another_took_the_place_of_is_let_go(tmp_path: Path) -> None:
    """What was written to it would be lost."""
    file = tmp_path / "plant.db"
    with closing(Database(f"sqlite:///{file}")) as database:
        schema.migrate(database)
        with database.write() as connection:
            connection.execute(text("INSERT INTO loops (tag, created_at) VALUES ('FIC1', 0)"))
        with database.read() as connection:
            assert in_use(connection)
        (tmp_path / "new.db").write_bytes(file.read_bytes())
        (tmp_path / "new.db").replace(file)
        with database.write() as connection:
            connection.execute(text("DELETE FROM loops"))
        with database.read() as connection:
            assert not in_use(connection)
    with closing(Database(f"sqlite:///{file}")) as database, database.read() as connection:
        assert not in_use(connection)
