"""The migrations make the tables that the code expects, on both databases, and can be taken back."""

from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import create_engine, inspect, make_url, text

from app.storage import Database, schema
from app.storage.tables import metadata
from app.storage.types import UtcDateTime


def test_migrations_make_the_tables(database: Database) -> None:
    with database.read() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True, "compare_server_default": False})
        assert compare_metadata(context, metadata) == []
    assert schema.current_revision(database) == schema.newest_revision() is not None


def test_the_names_of_the_migrations_tell_their_versions_in_order() -> None:
    revisions = ScriptDirectory.from_config(schema._config()).walk_revisions()
    assert schema._versions() == [script.revision for script in revisions][::-1]


def test_indexes_over_open_work_are_partial(database: Database) -> None:
    with database.read() as connection:
        found = {index["name"]: index for index in inspect(connection).get_indexes("audit_items")}
    kind = database.url.get_backend_name()
    assert "open" in str(found["ix_audit_items_open"]["dialect_options"][f"{kind}_where"])


def test_migrating_twice_changes_nothing(database: Database) -> None:
    schema.migrate(database)
    assert schema.current_revision(database) == schema.newest_revision()


def test_a_new_file_and_its_journal_are_for_their_owner_alone(tmp_path: Path) -> None:
    database = Database(f"sqlite:///{tmp_path / 'plant.db'}")
    schema.migrate(database)
    with database.write() as connection:
        connection.execute(text("INSERT INTO loops (tag, created_at) VALUES ('FIC1', 0)"))
        assert {path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {0o600}
    database.close()


def test_down_and_up_again(tmp_path: Path) -> None:
    database = Database(f"sqlite:///{tmp_path / 'plant.db'}")
    schema.migrate(database)
    schema.downgrade(database, "base")
    with database.read() as connection:
        assert inspect(connection).get_table_names() == ["alembic_version"]
    schema.migrate(database)
    with database.read() as connection:
        assert set(metadata.tables) <= set(inspect(connection).get_table_names())
    database.close()


@pytest.mark.usefixtures("commits_outlive_the_machine")
def test_sqlite_is_opened_safely(tmp_path: Path) -> None:
    database = Database(f"sqlite:///{tmp_path / 'plant.db'}")
    with database.write() as connection:
        pragmas = {
            name: connection.exec_driver_sql(f"PRAGMA {name}").scalar() for name in ("foreign_keys", "synchronous")
        }
        mode = connection.exec_driver_sql("PRAGMA journal_mode").scalar()
    assert pragmas == {"foreign_keys": 1, "synchronous": 2}
    assert mode in ("wal", "truncate")
    database.close()


def test_no_statement_is_compiled_before_it_runs(database: Database) -> None:
    """It took longer than most of them run."""
    if database.is_sqlite:
        pytest.skip("compiles none")
    with database.read() as reading, database.write() as writing:
        told = [connection.exec_driver_sql("SHOW jit").scalar() for connection in (reading, writing)]
    assert told == ["off", "off"]


def test_a_reading_transaction_cannot_write(database: Database) -> None:
    with database.read() as connection, pytest.raises(Exception, match=r"(?i)read-?only"):
        connection.execute(text("DELETE FROM loops"))


def test_instants_need_a_zone() -> None:
    from datetime import datetime

    dialect = create_engine("sqlite://").dialect
    with pytest.raises(ValueError, match="zone"):
        UtcDateTime().process_bind_param(datetime(2026, 1, 1), dialect)


def test_urls_keep_their_password_out_of_text() -> None:
    assert "secret" not in repr(make_url("postgresql+psycopg://user:secret@host/plant"))
