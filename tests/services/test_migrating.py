"""An upgrade of the tables beside processes that were left running says what is in its way."""

from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import text

from app.errors import RequestError
from app.services.upkeep.tables import migrate, newer_than_we, refuse_unmigrated
from app.settings import Settings
from app.storage import Database, schema

BEFORE_KEYS_FOLLOW = "0030"


@pytest.mark.postgres
def test_tables_that_others_work_on_are_told_and_nothing_is_changed(tmp_path: Path, emptied_postgres: str) -> None:
    settings = Settings(data_dir=tmp_path, database_url=emptied_postgres)
    with closing(Database(emptied_postgres)) as database:
        schema.bring_to(database, BEFORE_KEYS_FOLLOW)
        try:
            with database.write() as busy:
                busy.execute(text("SELECT count(*) FROM keys"))
                with pytest.raises(RequestError, match="stop `serve`, `worker` and `beat`") as refused:
                    migrate(settings)
            assert refused.value.code == "tables_in_use"
            assert schema.current_revision(database) == BEFORE_KEYS_FOLLOW
        finally:
            assert migrate(settings) == schema.newest_revision()


def test_what_is_newer_is_what_was_not_there_at_the_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Source that is put in the place of a worker's own brings the migrations of a newer version with it, also where
    the database was away as the worker started: its processes, which ask later, inherit what it knew."""
    schema._versions.cache_clear()
    refuse_unmigrated(Settings(data_dir=tmp_path, database_url="postgresql://nobody@127.0.0.1:1/away"))
    monkeypatch.setattr(schema, "_listed", lambda: ["9999"])
    settings = Settings(data_dir=tmp_path)
    migrate(settings)
    with closing(Database(settings.resolved_database_url)) as database:
        assert newer_than_we(database) is None
        with database.write() as connection:
            connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
        refusal = newer_than_we(database)
        assert refusal is not None
        assert refusal.code == "newer_tables"
