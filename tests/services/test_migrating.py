"""An upgrade of the tables beside processes that were left running says what is in its way."""

from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import text

from app.errors import RequestError
from app.services.upkeep.tables import migrate
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
