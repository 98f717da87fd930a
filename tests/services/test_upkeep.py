"""Upkeep on both data bases: what is old goes, backups come back, the doctor sees what is wrong."""

import json
import os
import shutil
import subprocess
import time
from concurrent.futures import Future, ThreadPoolExecutor, wait
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from sqlalchemy import func, insert, make_url, select, update

from app.errors import RequestError
from app.services.access import keys, trail
from app.services.access.identity import COMMAND_LINE, Role
from app.services.auditing.audits import get_audit, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.backend import Backend
from app.services.intake import uploads
from app.services.intake.reading import read_upload
from app.services.plant.loops import loop_health, verdict_history
from app.services.upkeep import backup as backups
from app.services.upkeep import doctor, retention
from app.services.upkeep.operations import migrate, sweep
from app.settings import Settings
from app.storage import schema, tables
from app.storage import uploads as stored_uploads
from app.storage.tables import metadata

EXPORT = b"DateTime,FIC1.PV,FIC1.OP,FIC1.SP\n" + b"".join(
    f"2026-01-01T{k // 60:02d}:{k % 60:02d}:00Z,{50 + (k % 40) / 20 + k % 3 * 0.1},{40 + k % 40},50\n".encode()
    for k in range(400)
)


def count(backend: Backend, table: str) -> int:
    with backend.database.read() as connection:
        return connection.scalar(select(func.count()).select_from(metadata.tables[table])) or 0


def contents(backend: Backend) -> dict[str, list[tuple]]:
    with backend.database.read() as connection:
        return {
            name: [tuple(row) for row in connection.execute(table.select().order_by(*table.primary_key.columns))]
            for name, table in metadata.tables.items()
        }


@pytest.fixture
def plant(backend: Backend, warm_kernels: None) -> Backend:
    """One loop, read from an upload and audited twice; a key; the trail of both."""
    with uploads.receive(backend, filename="plant.csv") as receiving:
        receiving.write(EXPORT)
        receipt = receiving.commit()
    read_upload(backend, int(receipt.upload.id), owner="test")
    for _ in range(2):
        run = start_audit(backend)
        audit_chunk(backend, int(run.id), "test")
        assert get_audit(backend, run.id).state == "done"
    keys.create_key(backend, "me", Role.admin, lifetime=None)
    return backend


def aged(backend: Backend, days: float) -> None:
    """As if everything had happened that long ago."""
    ago = datetime.now(UTC) - timedelta(days=days)
    with backend.database.write() as connection:
        connection.execute(update(tables.audits).values(ended_at=ago, created_at=ago))
        connection.execute(update(tables.trail).values(at=ago))
        connection.execute(update(tables.uploads).values(received_at=ago, ended_at=ago))
    for file in backend.settings.uploads_dir.iterdir():
        os.utime(file, (time.time() - 86400 * days,) * 2)


def with_settings(backend: Backend, **changes: object) -> Backend:
    return Backend(backend.settings.model_copy(update=changes), backend.database, backend.queue)


# Retention


def test_what_is_young_stays(plant):
    before = {name: count(plant, name) for name in ("series", "verdicts", "verdict_details", "audits", "uploads")}
    retention.retain(plant)
    assert {name: count(plant, name) for name in before} == before
    assert list(plant.settings.uploads_dir.iterdir())


def test_old_verdicts_go_and_the_newest_of_a_loop_stays(plant):
    newest = loop_health(plant, "FIC1")
    aged(plant, 100_000)
    dropped = retention.retain(plant)
    assert dropped["details"] == 1
    assert dropped["verdicts"] >= 1
    assert [row["audit_id"] for row in verdict_history(plant, "FIC1").rows] == [newest["audit_id"]]
    assert loop_health(plant, "FIC1") == newest
    assert count(plant, "audits") == 1
    assert count(plant, "verdict_details") == 1


def test_details_go_before_their_verdicts(plant):
    aged(plant, plant.settings.keep_details_days + 1)
    retention.retain(plant)
    assert (count(plant, "verdicts"), count(plant, "verdict_details")) == (2, 1)


def test_series_go_by_the_time_before_the_newest_sample_of_their_loop(plant):
    kept = with_settings(plant, keep_series_days=7, window_h=24)
    with plant.database.write() as connection:
        old = connection.execute(select(tables.series)).mappings().one()
        day_ns = 86_400_000_000_000
        times = [name for name, value in old.items() if name.endswith("_ns") and value is not None]
        for days in (9, 8, 6):  # that of 8 days says which set point held when what is kept begins
            moved = {name: old[name] - days * day_ns for name in times}
            values = {name: value for name, value in old.items() if name != "id"} | moved
            connection.execute(insert(tables.series).values(values | {"fingerprint": str(days)}))
    assert retention.retain(kept)["series"] == 1
    with plant.database.read() as connection:
        assert set(connection.scalars(select(tables.series.c.fingerprint))) == {old["fingerprint"], "8", "6"}


def test_exports_that_were_read_go_and_those_to_be_read_stay(plant):
    with uploads.receive(plant, filename="waiting.csv") as receiving:
        receiving.write(EXPORT + b"2026-01-02T00:00:00Z,1,2,3\n")
        waiting = receiving.commit().upload.fingerprint
    orphan = plant.settings.uploads_dir / ("0" * 64)
    orphan.write_bytes(b"of no upload")
    aged(plant, 400)
    assert retention.retain(plant)["files"] == 2
    assert [file.name for file in plant.settings.uploads_dir.iterdir()] == [waiting]
    assert count(plant, "uploads") == 2


def sent_again(backend: Backend) -> None:
    with uploads.receive(backend, filename="again.csv") as receiving:
        receiving.write(EXPORT)
        receiving.commit()


def test_bytes_that_come_again_while_retention_looks_at_the_old_ones_stay(plant, monkeypatch):
    """Retention has looked and is about to drop: who sends waits for it, then puts the bytes there anew."""
    aged(plant, 400)
    looked = iter(range(9))
    with ThreadPoolExecutor(1) as pool:
        sending: list[Future[None]] = []

        def old_then_sent(file: Path, seconds: float) -> bool:
            old = older_than(file, seconds)
            if next(looked) == 1:  # for the second time, under the lock
                sending.append(pool.submit(sent_again, plant))
                wait(sending, timeout=1)
            return old

        older_than = retention.older_than
        monkeypatch.setattr(retention, "older_than", old_then_sent)
        assert retention.retain(plant)["files"] == 1
        sending[0].result()
    assert [file.read_bytes() for file in plant.settings.uploads_dir.iterdir()] == [EXPORT]


def test_bytes_that_are_being_registered_stay_though_their_file_looks_old(plant, monkeypatch):
    """Who sends has put the bytes there and is about to register them: retention waits for it, then knows them."""
    aged(plant, 400)
    monkeypatch.setattr(retention, "older_than", lambda file, seconds: True)  # a clock that has jumped meanwhile
    registered = stored_uploads.receive
    with ThreadPoolExecutor(1) as pool:
        dropping: list[Future[dict[str, int]]] = []

        def dropped_then_registered(connection, values):
            dropping.append(pool.submit(retention.retain, plant))
            wait(dropping, timeout=1)
            return registered(connection, values)

        monkeypatch.setattr(stored_uploads, "receive", dropped_then_registered)
        sent_again(plant)
        assert dropping[0].result()["files"] == 0
    assert [file.read_bytes() for file in plant.settings.uploads_dir.iterdir()] == [EXPORT]


def test_nought_days_keep_for_ever(plant):
    names = ("series", "details", "verdicts", "explanations", "trail", "uploads")
    for_ever = with_settings(plant, **{f"keep_{name}_days": 0 for name in names})
    aged(plant, 100_000)
    before = {name: count(plant, name) for name in ("series", "verdicts", "verdict_details", "audits", "trail")}
    retention.retain(for_ever)
    assert {name: count(plant, name) for name in before} == before | {"trail": before["trail"] + 1}  # itself
    assert list(plant.settings.uploads_dir.iterdir())


def test_it_runs_once_a_night_in_batches_and_stands_in_the_trail(plant):
    aged(plant, 100_000)
    assert retention.retain_if_due(plant) is not None
    assert retention.retain_if_due(plant) is None
    assert retention.retain_if_due(plant, datetime.now(UTC) + timedelta(days=1)) is not None
    row = trail.list_trail(plant, action=retention.ACTION).rows[-1]
    assert (row.who, row.outcome, row.detail["details"]) == ("schedule", "done", 1)


def test_without_time_left_the_rest_waits_for_the_next_sweep(plant):
    aged(plant, 100_000)
    assert "files" not in retention.retain(plant, budget_s=-1)
    assert not trail.list_trail(plant, action=retention.ACTION).rows


def test_the_sweeper_does_it(plant):
    aged(plant, 100_000)
    sweep(plant)
    assert count(plant, "audits") == 1


def test_what_goes_while_the_sweeper_looks_does_not_stop_it(plant, monkeypatch):
    """An upload that ends takes its draft away, another schedule an old export."""
    gone = [plant.settings.uploads_dir / name for name in (".part-gone", "0" * 64)]
    monkeypatch.setattr(Path, "glob", lambda folder, pattern: iter(gone))
    monkeypatch.setattr(Path, "iterdir", lambda folder: iter(gone))
    assert retention.retain(plant)["files"] == 0
    sweep(plant)


# Backup and restore


@pytest.fixture(autouse=True)
def _programs(request: pytest.FixtureRequest) -> None:
    """Backups of PostgreSQL need its client programs."""
    if "backup" in request.node.name and "postgresql" in request.node.name and shutil.which("pg_dump") is None:
        pytest.skip("no pg_dump on this machine")


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
    try:
        assert contents(again) == before
        assert (again.settings.uploads_dir / before["uploads"][0][2]).read_bytes() == EXPORT
        run = start_audit(again)
        audit_chunk(again, int(run.id), "test")
        assert get_audit(again, run.id).state == "done"
    finally:
        again.close()


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
    backups._run(["pg_dump", "--format=custom"], url, tmp_path)
    command, environment = told[0]
    assert command[2] == "--dbname=postgresql://who@db:5433/plant?sslmode=verify-full"
    assert environment["PGPASSWORD"] == "hunter2"


def test_nothing_is_left_of_a_backup_that_failed(plant, tmp_path, monkeypatch):
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(backups, "_copy_uploads", full)
    with pytest.raises(OSError, match="No space"):
        backups.backup(plant.settings, tmp_path / "there" / "kept")
    assert not list((tmp_path / "there").iterdir())


def test_no_password_is_told_where_it_goes_wrong(tmp_path):
    settings = Settings(data_dir=tmp_path, database_url="postgresql+psycopg://who:hunter2@127.0.0.1:1/none")
    with pytest.raises(Exception) as raised:  # noqa: PT011 - of whatever kind
        backups.backup(settings, tmp_path / "kept")
    assert "hunter2" not in str(raised.value)


# Doctor


def states(checks: list[doctor.Check]) -> dict[str, str]:
    return {check.name: check.state for check in checks}


def test_a_sound_installation_has_no_problem(plant):
    plant.settings.data_dir.chmod(0o700)
    found = states(doctor.examine(plant.settings))
    assert found.keys() >= {
        "data folder", "disk", "kernel cache", "settings", "SQLite", "data base", "tables", "integrity", "clock",
        "workers", "open work", "keys", "broker",
    }  # fmt: skip
    assert "problem" not in found.values()
    assert found["data folder"] == "ok"


def test_each_thing_that_is_wrong_is_named_with_advice(plant):
    settings = plant.settings.model_copy(update={"allow_open": True, "broker_url": "redis://127.0.0.1:1/0"})
    plant.settings.data_dir.chmod(0o755)
    start_audit(plant)
    with plant.database.write() as connection:
        connection.execute(update(tables.audits).values(created_at=datetime.now(UTC) - timedelta(days=2)))
        connection.execute(update(tables.keys).values(expires_at=datetime.now(UTC) + timedelta(days=2)))
    checks = doctor.examine(settings)
    wrong = {check.name: check.state for check in checks if check.state != "ok"}
    wrong.pop("disk", None)
    wrong.pop("kernel cache", None)
    assert wrong == {
        "data folder": "warning",
        "settings": "warning",
        "workers": "problem",
        "open work": "warning",
        "keys": "warning",
        "broker": "problem",
    }
    assert all(check.advice for check in checks if check.state != "ok")


def of(name: str, settings: Settings) -> doctor.Check:
    return next(check for check in doctor.examine(settings) if check.name == name)


def test_exports_that_are_gone_are_found(plant):
    assert of("exports", plant.settings).state == "ok"
    for file in plant.settings.uploads_dir.iterdir():
        file.unlink()
    assert of("exports", plant.settings).state == "warning"
    aged(plant, plant.settings.keep_uploads_days + 1)
    assert of("exports", plant.settings).state == "ok"
    with uploads.receive(plant, filename="waiting.csv") as receiving:
        receiving.write(EXPORT + b"2026-01-02T00:00:00Z,1,2,3\n")
        fingerprint = receiving.commit().upload.fingerprint
    (plant.settings.uploads_dir / fingerprint).unlink()
    check = of("exports", plant.settings)
    assert check.state == "problem"
    assert fingerprint[:12] in check.found


@pytest.mark.parametrize(
    ("url", "state"), [("", "ok"), ("redis://127.0.0.1:1/0", "warning"), ("no-storage://127.0.0.1", "problem")]
)
def test_who_counts_the_limits_of_keys_is_looked_at(tmp_path, url, state):
    settings = Settings(data_dir=tmp_path, rate_limit_url=url)
    migrate(settings)
    check = of("rate limits", settings)
    assert check.state == state
    assert bool(check.advice) == (state != "ok")


@pytest.mark.redis
def test_limits_that_are_counted_together_are_well(tmp_path, redis_url):
    settings = Settings(data_dir=tmp_path, rate_limit_url=redis_url)
    migrate(settings)
    assert of("rate limits", settings).state == "ok"


def test_a_data_base_of_an_older_version_is_a_problem(plant):
    schema.downgrade(plant.database, "0002")
    try:
        found = states(doctor.examine(plant.settings))
        assert found["tables"] == "problem"
    finally:
        schema.migrate(plant.database)


@pytest.mark.parametrize(("at", "name"), [(0, "data base"), (8 * 4096, "integrity")])
def test_a_damaged_sqlite_file_is_found_and_a_backup_advised(tmp_path, at, name):
    settings = Settings(data_dir=tmp_path)
    migrate(settings)
    with (tmp_path / "loopaudit.db").open("r+b") as file:
        file.seek(at)
        file.write(b"\xff" * 3 * 4096)
    found = next(check for check in doctor.examine(settings) if check.name == name)
    assert found.state == "problem"
    assert "loopaudit restore" in found.advice


def test_names_that_others_may_use_without_a_key_are_warned_of(tmp_path):
    settings = Settings(data_dir=tmp_path, allowed_hosts="plant.example")
    assert doctor.openness(settings).state == "warning"
    assert doctor.openness(settings.model_copy(update={"require_keys": True})).state == "ok"


def test_a_data_base_that_is_away_is_a_problem_and_its_password_is_not_told(tmp_path):
    settings = Settings(data_dir=tmp_path, database_url="postgresql+psycopg://who:hunter2@127.0.0.1:1/none")
    checks = doctor.examine(settings)
    assert states(checks)["data base"] == "problem"
    assert "hunter2" not in str(checks)


def test_the_command_ends_with_1_where_something_is_wrong(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    from app.cli.main import cli

    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    assert CliRunner().invoke(cli, ["migrate"]).exit_code == 0
    done = CliRunner().invoke(cli, ["doctor", "--json"])
    assert done.exit_code == 0, done.output
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert {"name", "state", "found", "advice"} == set(rows[0])
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path / "nowhere"))
    assert CliRunner().invoke(cli, ["doctor"]).exit_code == 1


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
