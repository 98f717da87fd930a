"""An address of SQLite may be a path or a URI: both mean the file."""

from pathlib import Path

import pytest

from app.queue.jobs import queue_names
from app.services.upkeep.backup import backup, restore
from app.services.upkeep.tables import migrate, refuse_unmigrated
from app.settings import Settings
from app.sqlite_files import file_of
from app.storage import Database, loops


def as_uri(folder: Path) -> Settings:
    return Settings(data_dir=folder, database_url=f"sqlite:///file:{folder}/loopaudit.db?uri=true")


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("/data/plant 1.db", "/data/plant 1.db"),
        ("plant.db", "plant.db"),
        ("file:/data/plant%201.db", "/data/plant 1.db"),
        ("file:///data/plant.db", "/data/plant.db"),
        ("file:plant.db", "plant.db"),
        (None, "."),
    ],
)
def test_the_file_of_an_address(name: str | None, file: str) -> None:
    assert file_of(name) == Path(file)


def test_a_plant_that_is_named_by_a_uri_is_kept_and_comes_back(tmp_path: Path) -> None:
    settings, other = as_uri(tmp_path / "one"), as_uri(tmp_path / "other")
    migrate(settings)
    refuse_unmigrated(settings)
    database = Database(settings.resolved_database_url)
    with database.write() as connection:
        loops.ensure(connection, ["FIC1"])
    database.close()
    backup(settings, tmp_path / "kept")
    restore(other, tmp_path / "kept")
    there = Database(f"sqlite:///{tmp_path}/other/loopaudit.db")
    with there.read() as connection:
        assert connection.exec_driver_sql("SELECT tag FROM loops").scalars().all() == ["FIC1"]
    there.close()


def test_both_forms_meet_at_the_broker(tmp_path: Path) -> None:
    assert queue_names(as_uri(tmp_path)) == queue_names(Settings(data_dir=tmp_path))
