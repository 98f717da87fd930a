"""Backups of both databases come back, older ones too, and what is no backup is refused."""

import json
import os
import shutil
import sqlite3
import subprocess
import time
from contextlib import closing, suppress
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import pytest
from sqlalchemy import column, make_url, table, update

from app.errors import RequestError
from app.services.access import trail
from app.services.access.identity import COMMAND_LINE
from app.services.auditing.audits import get_audit, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.backend import Backend
from app.services.upkeep import backup as backups
from app.services.upkeep import doctor
from app.services.upkeep.presence import alone, at_work
from app.services.upkeep.tables import migrate
from app.settings import Settings
from app.storage import schema, tables
from app.storage.database import program_address
from app.storage.tables import metadata
from tests.services.upkeep_plant import EXPORT, audited_twice


def contents(backend: Backend) -> dict[str, list[tuple]]:
    with backend.database.read() as connection:
        return {
            name: [tuple(row) for row in connection.execute(table.select().order_by(*table.primary_key.columns))]
            for name, table in metadata.tables.items()
        }


def test_a_backup_comes_back_whole(plant, tmp_path):
    before = contents(plant)
    report = backups.backup(plant.settings, tmp_path / "kept" / "monday")
    assert (report.files, report.schema) == (2, schema.newest_revision())
    assert (tmp_path / "kept" / "monday").stat().st_mode & 0o077 == 0
    with plant.database.write() as connection:
        for table in reversed(metadata.sorted_tables):
            connection.execute(table.delete())
    shutil.rmtree(plant.settings.uploads_dir)
    plant.database.close()
    backups.restore(plant.settings, tmp_path / "kept" / "monday")
    again = Backend.open(plant.settings)
    assert {file.stat().st_mode & 0o077 for file in plant.settings.data_dir.glob("*.db")} <= {0}
    try:
        assert contents(again) == before
        assert (again.settings.uploads_dir / before["uploads"][0][2]).read_bytes() == EXPORT
        run = start_audit(again)
        audit_chunk(again, int(run.id), "test")
        assert get_audit(again, run.id).state == "done"
    finally:
        again.close()


def test_an_installation_moves_from_sqlite_to_postgresql(open_plant, warm_kernels, emptied_postgres, tmp_path):
    plant = audited_twice(open_plant())
    with plant.database.write() as connection:
        noted = {"loop_id": 1, "written_at": datetime(2026, 1, 2, tzinfo=UTC), "text": "a\0b"}
        connection.execute(tables.notes.insert().values(noted))
    before = contents(plant)
    backups.backup(plant.settings, tmp_path / "kept")
    there = Settings(data_dir=tmp_path / "there", database_url=emptied_postgres)
    backups.restore(there, tmp_path / "kept")
    moved = Backend.open(there)
    try:
        (note,) = before["notes"]
        assert contents(moved) == before | {"notes": [(*note[:4], "a\ufffdb", *note[5:])]}
        assert (there.uploads_dir / before["uploads"][0][2]).read_bytes() == EXPORT
        run = start_audit(moved)
        assert int(run.id) == before["audits"][-1][0] + 1
        audit_chunk(moved, int(run.id), "test")
        assert get_audit(moved, run.id).state == "done"
    finally:
        moved.close()
    with pytest.raises(RequestError) as refused:
        backups.restore(there, tmp_path / "kept")
    assert refused.value.code == "not_empty"
    backups.restore(there, tmp_path / "kept", force=True)
    again = Backend.open(there)
    assert len(contents(again)["audits"]) == len(before["audits"])
    again.close()


def test_a_backup_of_postgresql_is_not_for_sqlite(plant, tmp_path):
    if plant.database.is_sqlite:
        pytest.skip("a backup of PostgreSQL")
    backups.backup(plant.settings, tmp_path / "kept")
    with pytest.raises(RequestError, match="which SQLite cannot take") as refused:
        backups.restore(Settings(data_dir=tmp_path / "there"), tmp_path / "kept")
    assert refused.value.code == "backup_kind"


@pytest.mark.parametrize(
    "written",
    [
        "{}",
        "[]",
        '"a"',
        '{"files": {}}',
        '{"files": [], "database": "loopaudit.db", "schema": "0001"}',
        '{"files": {}, "database": "loopaudit.db", "schema": "0001"}',
        '{"files": {"loopaudit.db": "0"}, "database": "loopaudit.db"}',
        '{"files": {"loopaudit.db": "0"}, "database": ["loopaudit.db"], "schema": "0001"}',
        '{"name": "an app", "icons": []}',
    ],
)
def test_a_manifest_of_something_else_is_no_backup(tmp_path, written):
    (tmp_path / "manifest.json").write_text(written)
    with pytest.raises(RequestError, match="holds no backup") as refused:
        backups.restore(Settings(data_dir=tmp_path / "there"), tmp_path)
    assert refused.value.code == "no_backup"
    assert written[:60] in refused.value.message


def test_a_manifest_that_cannot_be_taken_apart_is_no_backup(tmp_path):
    (tmp_path / "manifest.json").write_text("[" * 100_000)
    with pytest.raises(RequestError, match=r"manifest\.json cannot be read") as refused:
        backups.restore(Settings(data_dir=tmp_path / "there"), tmp_path)
    assert refused.value.code == "no_backup"


def test_without_its_exports_no_backup_is_made(plant, tmp_path):
    """It would look whole."""
    folder = plant.settings.uploads_dir
    folder.rename(folder.with_name("elsewhere"))
    with pytest.raises(RequestError, match="cannot be looked into"):
        backups.backup(plant.settings, tmp_path / "kept")
    assert not (tmp_path / "kept").exists()


def test_a_backup_is_made_while_others_write(plant, tmp_path):
    import threading

    stop, written = threading.Event(), []

    def write() -> None:
        while not stop.is_set():
            trail.record(plant, COMMAND_LINE, "test.write", str(len(written)), "done")
            written.append(len(written))

    writer = threading.Thread(target=write)
    writer.start()
    try:
        time.sleep(0.2)
        backups.backup(plant.settings, tmp_path / "kept")
    finally:
        stop.set()
        writer.join()
    plant.database.close()
    backups.restore(plant.settings, tmp_path / "kept", force=True)
    again = Backend.open(plant.settings)
    try:
        subjects = [int(row.subject) for row in trail.list_trail(again, 100_000, action="test.write").rows]
        assert subjects == list(range(len(subjects)))[::-1]  # one instant: no row in between is missing
        assert 0 < len(subjects) <= len(written)
    finally:
        again.close()


def test_a_backup_of_sqlite_does_not_begin_anew_with_each_commit(empty_sqlite, tmp_path, monkeypatch):
    settings = Settings(data_dir=tmp_path / "data")
    settings.prepare_folders()
    file = settings.data_dir / "loopaudit.db"
    shutil.copy(empty_sqlite, file)
    left: list[int] = []

    class Beside(sqlite3.Connection):
        """Somebody commits after each part that is copied, or tries to."""

        def backup(self, target, progress=None, **how):
            def committed(*told: int) -> None:
                left.append(told[1])
                assert len(left) < 10 * told[2]
                with suppress(sqlite3.OperationalError):
                    here.execute("UPDATE loops SET importance = importance + 1")
                if progress:
                    progress(*told)

            super().backup(target, progress=committed, **how)

    with closing(sqlite3.connect(file, isolation_level=None, timeout=0)) as here:
        here.execute("INSERT INTO loops (tag, importance, retired, created_at) VALUES ('A', 1, 0, '2026-01-01')")
        monkeypatch.setattr(backups, "COPIED_PAGES", 5)
        monkeypatch.setattr(sqlite3, "connect", partial(sqlite3.connect, factory=Beside))
        backups.backup(settings, tmp_path / "kept")
    assert left[-1] == 0


def test_two_backups_at_once_leave_each_other_alone(plant, tmp_path, monkeypatch):
    kept = tmp_path / "kept"
    old = tmp_path / ".kept.a1b2c3d4.part"
    old.mkdir()
    os.utime(old, (0, 0))
    copy = backups._copy_uploads

    def while_another_is_made(settings, target):
        monkeypatch.setattr(backups, "_copy_uploads", copy)
        backups.backup(settings, kept)
        copy(settings, target)

    monkeypatch.setattr(backups, "_copy_uploads", while_another_is_made)
    with pytest.raises(RequestError) as refused:
        backups.backup(plant.settings, kept)
    assert refused.value.code == "backup_there"
    assert [path.name for path in tmp_path.glob("*kept*")] == ["kept"]
    assert (kept / "manifest.json").is_file()


def test_a_backup_has_the_exports_and_nothing_else_of_their_folder(plant, tmp_path):
    folder = plant.settings.uploads_dir
    (export,) = folder.iterdir()
    (folder / "lost+found").mkdir()
    (folder / "old").mkdir()
    (folder / "old" / "export.csv").write_bytes(EXPORT)
    backups.backup(plant.settings, tmp_path / "kept")
    assert [file.name for file in (tmp_path / "kept" / "uploads").iterdir()] == [export.name]


def test_a_plant_in_use_is_replaced_only_on_purpose(plant, tmp_path):
    backups.backup(plant.settings, tmp_path / "kept")
    with pytest.raises(RequestError, match="--force"):
        backups.restore(plant.settings, tmp_path / "kept")
    with pytest.raises(RequestError, match="there already"):
        backups.backup(plant.settings, tmp_path / "kept")


def test_a_backup_that_was_changed_is_refused(plant, tmp_path):
    folder = tmp_path / "kept"
    backups.backup(plant.settings, folder)
    file = next((folder / "uploads").iterdir())
    file.write_bytes(file.read_bytes() + b"x")
    with pytest.raises(RequestError, match="changed"):
        backups.restore(plant.settings, folder, force=True)
    with pytest.raises(RequestError, match="no backup"):
        backups.restore(plant.settings, tmp_path, force=True)


def test_what_is_not_of_a_backup_is_not_restored_with_it(plant, tmp_path):
    folder = tmp_path / "kept"
    backups.backup(plant.settings, folder)
    (folder / "uploads" / ("0" * 64)).write_bytes(b"of somebody else")
    with pytest.raises(RequestError, match="not of this backup, take it away: uploads/000"):
        backups.restore(plant.settings, folder, force=True)
    assert not (plant.settings.uploads_dir / ("0" * 64)).exists()


def test_a_backup_of_an_older_version_comes_back_after_an_upgrade(plant, tmp_path):
    before = contents(plant)
    schema.downgrade(plant.database, "0006")
    backups.backup(plant.settings, tmp_path / "kept")
    schema.migrate(plant.database)
    with plant.database.write() as connection:
        connection.execute(tables.keys.delete())
    plant.database.close()
    assert backups.restore(plant.settings, tmp_path / "kept", force=True).schema == schema.newest_revision()
    again = Backend.open(plant.settings)
    try:
        assert contents(again)["keys"] == before["keys"]
        assert schema.current_revision(again.database) == schema.newest_revision()
    finally:
        again.close()


def test_tables_of_a_newer_version_are_refused_and_left_alone(plant):
    version = schema.newest_revision()
    given_as(plant, "9999")
    try:
        with pytest.raises(RequestError) as refused:
            migrate(plant.settings)
        assert refused.value.code == "newer_tables"
        assert schema.current_revision(plant.database) == "9999"
        advice = {check.name: check.advice for check in doctor.examine(plant.settings)}
        assert advice["tables"] == "a newer loopaudit made them: run that one"
    finally:
        given_as(plant, version)


def given_as(plant: Backend, version: str) -> None:
    with plant.database.write() as connection:
        connection.execute(update(table("alembic_version", column("version_num"))).values(version_num=version))


def test_tables_of_a_newer_version_are_replaced_with_their_file_and_refused_on_a_server(plant, tmp_path):
    before, version = contents(plant), schema.newest_revision()
    backups.backup(plant.settings, tmp_path / "kept")
    given_as(plant, "9999")
    plant.database.close()
    try:
        if plant.database.is_sqlite:
            backups.restore(plant.settings, tmp_path / "kept", force=True)
            assert schema.current_revision(plant.database) == version
        else:
            with pytest.raises(RequestError, match="into an empty database") as refused:
                backups.restore(plant.settings, tmp_path / "kept", force=True)
            assert refused.value.code == "newer_tables"
            assert schema.current_revision(plant.database) == "9999"
    finally:
        given_as(plant, version)
    assert contents(plant) == before


def test_a_backup_of_a_newer_version_is_refused_before_anything_is_touched(plant, tmp_path):
    before = contents(plant)
    backups.backup(plant.settings, tmp_path / "kept")
    manifest = tmp_path / "kept" / backups.MANIFEST
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"schema": "9999"}))
    with pytest.raises(RequestError, match="9999, which is newer"):
        backups.restore(plant.settings, tmp_path / "kept", force=True)
    assert contents(plant) == before


def test_what_the_address_says_of_tls_holds_for_a_backup_too(monkeypatch, tmp_path):
    told: list[tuple[list[str], dict[str, str]]] = []

    def run(command, *, env, **_: object) -> subprocess.CompletedProcess:
        told.append((command, env))
        return subprocess.CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(backups.subprocess, "run", run)
    monkeypatch.setattr(backups.shutil, "which", lambda name: f"/usr/bin/{name}")
    url = make_url("postgresql+psycopg://who:hunter2@db:5433/plant?sslmode=verify-full")
    backups._run(["pg_dump", "--format=custom"], program_address(url), tmp_path)
    command, environment = told[0]
    assert command[2] == "--dbname=postgresql://who@db:5433/plant?sslmode=verify-full"
    assert environment["PGPASSWORD"] == "hunter2"


@pytest.mark.parametrize("kind", ["nothing", "empty", "no database"])
def test_a_data_base_that_is_not_there_is_one_sentence(tmp_path, kind):
    settings = Settings(data_dir=tmp_path / "data")
    if kind != "nothing":
        settings.prepare_folders()
        (settings.data_dir / "loopaudit.db").write_bytes(b"" if kind == "empty" else b"no database at all " * 500)
    with pytest.raises(RequestError) as refused:
        backups.backup(settings, tmp_path / "kept")
    assert refused.value.code == {"nothing": "no_database", "empty": "no_tables"}.get(kind, "database_away")
    assert not (tmp_path / "kept").exists()
    assert settings.data_dir.exists() == (kind != "nothing")


def test_nothing_is_brought_back_under_a_running_service(plant, tmp_path):
    backups.backup(plant.settings, tmp_path / "kept")
    before = contents(plant)
    with at_work(plant.settings), at_work(plant.settings):
        with pytest.raises(RequestError, match="stop it first") as refused:
            backups.restore(plant.settings, tmp_path / "kept", force=True)
        assert refused.value.code == "still_running"
        assert contents(plant) == before
    plant.database.close()
    backups.restore(plant.settings, tmp_path / "kept", force=True)


def test_nothing_is_brought_back_under_a_service_on_another_data_folder(plant, tmp_path):
    """Where the database is a server, each machine has a data folder of its own, or none that is kept."""
    if plant.settings.embedded:
        pytest.skip("the database is in the folder")
    backups.backup(plant.settings, tmp_path / "kept")
    before = contents(plant)
    elsewhere = plant.settings.model_copy(update={"data_dir": tmp_path / "elsewhere"})
    with at_work(elsewhere), at_work(elsewhere):
        with pytest.raises(RequestError, match="database, from another data folder") as refused:
            backups.restore(plant.settings, tmp_path / "kept", force=True)
        assert refused.value.code == "still_running"
        assert contents(plant) == before
    with alone(plant.settings), pytest.raises(RequestError, match="into the database") as refused, at_work(elsewhere):
        pass
    assert refused.value.code == "being_restored"
    plant.database.close()
    backups.restore(plant.settings, tmp_path / "kept", force=True)


def test_a_service_starts_where_the_data_base_is_away(tmp_path):
    settings = Settings(data_dir=tmp_path, database_url="postgresql+psycopg://who@127.0.0.1:1/none")
    with at_work(settings), at_work(settings):
        pass
    with pytest.raises(Exception, match=r"127\.0\.0\.1"), alone(settings):
        pass


def test_what_goes_wrong_at_work_is_raised(plant):
    with pytest.raises(ValueError, match="of the work"), at_work(plant.settings):
        raise ValueError("of the work")


def test_no_service_starts_while_a_backup_is_brought_back(tmp_path):
    settings = Settings(data_dir=tmp_path)
    with alone(settings), pytest.raises(RequestError) as refused, at_work(settings):
        pass
    assert refused.value.code == "being_restored"


def test_no_password_is_told_where_it_goes_wrong(tmp_path):
    settings = Settings(data_dir=tmp_path, database_url="postgresql+psycopg://who:hunter2@127.0.0.1:1/none")
    with pytest.raises(Exception) as raised:  # noqa: PT011 - of whatever kind
        backups.backup(settings, tmp_path / "kept")
    assert "hunter2" not in str(raised.value)


def test_backup_and_restore_as_commands(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    from app.cli.main import cli

    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path / "data"))
    run = CliRunner()
    assert run.invoke(cli, ["keys", "create", "me"]).exit_code == 0
    assert run.invoke(cli, ["backup", str(tmp_path / "kept")]).exit_code == 0
    shutil.rmtree(tmp_path / "data")
    assert run.invoke(cli, ["restore", str(tmp_path / "kept")]).exit_code == 0
    assert json.loads(run.invoke(cli, ["keys", "list", "--json"]).stdout)["name"] == "me"
    assert not Path(tmp_path / "data" / ".loopaudit.db.part").exists()
