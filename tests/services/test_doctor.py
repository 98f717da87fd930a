"""The doctor sees what is wrong with an installation, and nothing where nothing is."""

import json
import os
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from psycopg.errors import DiskFull
from sqlalchemy import Connection, create_engine, make_url, update
from sqlalchemy.exc import OperationalError, ProgrammingError

from app.services.access import keys
from app.services.access.identity import Role
from app.services.auditing.audits import start_audit
from app.services.backend import Backend
from app.services.intake import uploads
from app.services.upkeep import doctor
from app.settings import Settings
from app.storage import schema, tables
from tests.services.upkeep_plant import EXPORT, aged, audited_twice


@pytest.fixture
def plant(backend: Backend, warm_kernels: None) -> Backend:
    return audited_twice(backend)


def states(checks: list[doctor.Check]) -> dict[str, str]:
    return {check.name: check.state for check in checks}


def test_a_sound_installation_has_no_problem(plant):
    plant.settings.data_dir.chmod(0o700)
    found = states(doctor.examine(plant.settings))
    assert found.keys() >= {
        "data folder", "disk", "kernel cache", "settings", "SQLite", "database", "tables", "integrity", "clock",
        "growth", "workers", "open work", "room", "keys", "broker",
    }  # fmt: skip
    assert "problem" not in found.values()
    assert found["data folder"] == "ok"


def test_where_no_loop_waits_it_is_not_said_that_a_worker_runs(plant):
    (workers,) = (check for check in doctor.examine(plant.settings) if check.name == "workers")
    assert workers == doctor.Check("workers", "ok", "no loop waits; whether a worker runs shows only while loops wait")


def test_a_slow_data_base_is_told_with_advice(plant, monkeypatch):
    monkeypatch.setattr(doctor, "SLOW_DATABASE_S", 0.0)
    slow = doctor.reachable(plant)
    assert (slow.state, slow.advice) == ("warning", "slow")


def test_each_thing_that_is_wrong_is_named_with_advice(plant):
    settings = plant.settings.model_copy(update={"allow_open": True, "broker_url": "redis://127.0.0.1:1/0"})
    plant.settings.data_dir.chmod(0o755)
    start_audit(plant)
    with plant.database.write() as connection:
        ago = {"created_at": datetime.now(UTC) - timedelta(days=2), "announced_s": time.time() - 2 * 86400}
        connection.execute(update(tables.audits).values(ago))
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
        "records": "warning",
        "keys": "warning",
        "broker": "problem",
    }
    assert all(check.advice for check in checks if check.state != "ok")


def test_a_key_that_was_rotated_is_not_to_be_rotated_again(plant):
    made = keys.create_key(plant, "historian", Role.upload, lifetime=timedelta(days=365))
    keys.rotate_key(plant, made.key.id, timedelta(hours=24))
    assert doctor.keys_of_the_plant(plant) == doctor.Check("keys", "ok", "3 good")


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


def test_an_upload_that_waits_for_room_is_named(tmp_path, make_tables):
    settings = Settings(data_dir=tmp_path)
    make_tables(settings)
    assert of("room", settings).state == "ok"
    backend = Backend.open(settings)
    for name in ("large.csv", "other.csv"):
        with uploads.receive(backend, filename=name) as receiving:
            receiving.write(EXPORT + name.encode())
            receiving.commit()
    for hours, state in ((1, "warning"), (7, "problem")):
        since = datetime(2026, 1, 31, 3, tzinfo=UTC) if hours == 7 else datetime.now(UTC) - timedelta(hours=hours)
        with backend.database.write() as connection:
            connection.execute(update(tables.uploads).where(tables.uploads.c.id == 1).values(waits_since=since))
        check = of("room", settings)
        assert check.state == state
        assert "parts" in check.advice
    size = f"{len(EXPORT) + len('large.csv'):,} bytes"
    assert check.found == f"1 upload waits for room on the disk, 1 (large.csv, {size}) since 2026-01-31 03:00 UTC"
    with backend.database.write() as connection:
        connection.execute(update(tables.uploads).where(tables.uploads.c.id == 2).values(waits_since=datetime.now(UTC)))
    assert of("room", settings).found.startswith("2 uploads wait for room on the disk, 1 (large.csv")
    backend.close()


@pytest.mark.parametrize(
    ("url", "state"), [("", "ok"), ("redis://127.0.0.1:1/0", "warning"), ("no-storage://127.0.0.1", "problem")]
)
def test_who_counts_the_limits_of_keys_is_looked_at(tmp_path, make_tables, url, state):
    settings = Settings(data_dir=tmp_path, rate_limit_url=url)
    make_tables(settings)
    check = of("rate limits", settings)
    assert check.state == state
    assert bool(check.advice) == (state != "ok")


@pytest.mark.redis
def test_limits_that_are_counted_together_are_well(tmp_path, make_tables, redis_url):
    settings = Settings(data_dir=tmp_path, rate_limit_url=redis_url)
    make_tables(settings)
    assert of("rate limits", settings).state == "ok"


@pytest.mark.redis
def test_a_login_that_is_refused_where_limits_are_counted_is_told_as_that(tmp_path, make_tables, redis_url):
    """It answers: whoever starts it again mends nothing."""
    wrong = redis_url.replace("//", "//nobody:hunter2@")
    settings = Settings(data_dir=tmp_path, rate_limit_url=wrong)
    make_tables(settings)
    check = of("rate limits", settings)
    assert check.state == "warning"
    assert check.found == "the Redis that counts for all processes answers and refuses the login"
    assert "hunter2" not in check.found + check.advice


MAIL = {"digest_mail_to": "a@plant.example", "digest_smtp_host": "localhost", "digest_mail_from": "audit@plant.example"}


@pytest.mark.parametrize(
    ("set_", "state", "found"),
    [
        ({}, "ok", "nobody gets one"),
        ({"digest_mail_to": "a@plant.example"}, "problem",
         "1 receiver, not set: LOOPAUDIT_DIGEST_SMTP_HOST, LOOPAUDIT_DIGEST_MAIL_FROM"),
        (MAIL, "ok", "1 receiver; no links, because LOOPAUDIT_PUBLIC_URL is not set"),
        (MAIL | {"public_url": "https://plant.example"}, "ok", "1 receiver"),
        (MAIL | {"public_url": "https://plant.example", "digest_smtp_user": "audit"}, "ok", "1 receiver"),
        (MAIL | {"digest_smtp_user": "audit", "digest_smtp_starttls": False}, "warning",
         "the mail server's password travels in clear"),
        (MAIL | {"public_url": "https://plant.example", "digest_smtp_starttls": False}, "ok", "1 receiver"),
    ],
)  # fmt: skip
def test_how_the_digest_goes_out_is_looked_at(tmp_path, make_tables, set_, state, found):
    settings = Settings(data_dir=tmp_path, **set_)
    make_tables(settings)
    check = of("digest", settings)
    assert (check.state, check.found) == (state, found)


def test_a_data_base_of_an_older_version_is_a_problem(plant):
    schema.downgrade(plant.database, "0002")
    try:
        found = states(doctor.examine(plant.settings))
        assert found["tables"] == "problem"
    finally:
        schema.migrate(plant.database)


@pytest.mark.parametrize(("at", "name"), [(0, "database"), (8 * 4096, "integrity")])
def test_a_damaged_sqlite_file_is_found_and_a_backup_advised(tmp_path, make_tables, at, name):
    settings = Settings(data_dir=tmp_path)
    make_tables(settings)
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
    assert states(checks)["database"] == "problem"
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


def test_an_installation_that_is_not_set_up_is_no_problem_and_nothing_is_made(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    from app.cli.main import cli

    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    tmp_path.chmod(0o700)
    done = CliRunner().invoke(cli, ["doctor", "--json"])
    assert done.exit_code == 0, done.output
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert [row["name"] for row in rows if "not set up yet" in row["found"]] == ["database"]
    assert "serve" in rows[-1]["advice"]
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "loopaudit.db").touch()
    assert of("database", Settings(data_dir=tmp_path)).state == "warning"


@pytest.mark.postgres
def test_without_a_data_folder_the_data_base_is_looked_at(tmp_path, postgres_url):
    settings = Settings(data_dir=tmp_path / "nowhere", database_url=postgres_url)
    checks = doctor.examine(settings)
    found = states(checks)
    assert {found[name] for name in ("data folder", "exports", "broker")} == {"problem"}
    assert {found[name] for name in ("database", "tables", "keys", "workers")} == {"ok"}
    assert any("No such file" in check.found for check in checks if check.name == "exports")
    assert list(tmp_path.iterdir()) == []


def test_a_data_folder_that_is_a_file_is_told_as_one(tmp_path):
    (tmp_path / "data").write_text("")
    check = doctor.data_folder(Settings(data_dir=tmp_path / "data"))
    assert (check.state, check.found) == ("problem", f"{tmp_path / 'data'} is no folder")


def test_on_a_file_system_that_is_read_only_no_room_is_asked_for(tmp_path, monkeypatch):
    told = os.statvfs(tmp_path)
    fields = [getattr(told, name) for name in ("f_bsize", "f_frsize", "f_blocks", "f_bfree")]
    read_only = os.statvfs_result((*fields, 0, told.f_files, told.f_ffree, told.f_favail, os.ST_RDONLY, told.f_namemax))
    monkeypatch.setattr(os, "statvfs", lambda path: read_only)
    checks = {check.name: check for check in doctor.examine(Settings(data_dir=tmp_path))}
    assert {checks[name].state for name in ("data folder", "disk")} == {"problem"}
    assert all("mounted read-only" in checks[name].found for name in ("data folder", "disk"))
    assert not [check for check in checks.values() if "make room" in check.advice]


@pytest.mark.postgres
def test_why_a_data_base_cannot_be_used_is_told_in_its_own_words(tmp_path, postgres_url):
    missing = make_url(postgres_url).set(database="no_such_plant").render_as_string(hide_password=False)
    assert (
        'database "no_such_plant" does not exist'
        in of("database", Settings(data_dir=tmp_path, database_url=missing)).found
    )
    server = make_url(postgres_url)
    role = f"postgresql://nobody_here:hunter2@{server.host}:{server.port or 5432}/{server.database}"
    found = of("database", Settings(data_dir=tmp_path, database_url=role)).found
    assert '"nobody_here"' in found.partition("cannot be used: ")[2]
    assert "hunter2" not in found
    refused = of("database", Settings(data_dir=tmp_path, database_url="postgresql://127.0.0.1:1/plant"))
    assert "refused" in refused.found


def test_a_table_that_is_not_there_is_for_the_migration(plant):
    with plant.database.write() as connection:
        connection.exec_driver_sql("ALTER TABLE uploads RENAME TO elsewhere")
    try:
        found = next(check for check in doctor.examine(plant.settings) if check.name == "exports")
    finally:
        with plant.database.write() as connection:
            connection.exec_driver_sql("ALTER TABLE elsewhere RENAME TO uploads")
    assert (found.state, "uploads" in found.found, found.advice) == ("problem", True, "run `loopaudit migrate`")


@pytest.fixture
def crowded(postgres_url: str) -> Iterator[Callable[[int], str]]:
    """The address of a role that may have so many connections."""
    server, role = make_url(postgres_url), f"crowded_{os.getpid()}"
    engine = create_engine(postgres_url, isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:

        def limited(most: int) -> str:
            made = f"CREATE ROLE {role} LOGIN PASSWORD '{role}' CONNECTION LIMIT {most} IN ROLE pg_read_all_data"
            connection.exec_driver_sql(made)
            return server.set(username=role, password=role).render_as_string(hide_password=False)

        yield limited
        connection.exec_driver_sql(f"DROP ROLE IF EXISTS {role}")
    engine.dispose()


@pytest.mark.postgres
@pytest.mark.parametrize(("most", "name"), [(0, "database"), (1, "growth")])
def test_connections_that_are_all_in_use_are_told_with_what_gives_more(tmp_path, crowded, most, name):
    found = of(name, Settings(data_dir=tmp_path, database_url=crowded(most)))
    assert (found.state, "too many connections" in found.found) == ("problem", True)
    assert all(words in found.advice for words in ("CONNECTION LIMIT", "LOOPAUDIT_POOL_SIZE", "now 5"))


def test_samples_ahead_of_the_clock_are_a_warning(plant):
    ahead = time.time_ns() + 300 * 86_400 * 10**9
    with plant.database.write() as connection:
        connection.execute(update(tables.loops).values(newest_ns=time.time_ns()))
        connection.execute(update(tables.loops).where(tables.loops.c.id == 1).values(newest_ns=ahead))
    check = doctor.records(plant)
    assert (check.state, "time zone" in (check.advice or "")) == ("warning", True)
    assert "ahead of the clock" in check.found


@pytest.mark.parametrize(
    ("error", "state", "said"),
    [
        (
            OperationalError("INSERT", {}, DiskFull("No space left\nHINT: look")),
            "problem",
            "no room: No space left HINT",
        ),
        (ProgrammingError("CREATE", {}, Exception("permission denied")), "ok", "cannot be tried: permission denied"),
    ],
    ids=["full", "not allowed"],
)
@pytest.mark.postgres
def test_a_data_base_that_cannot_grow_is_a_problem(
    tmp_path: Path, postgres_url: str, monkeypatch: pytest.MonkeyPatch, error: Exception, state: str, said: str
) -> None:
    settings = Settings(data_dir=tmp_path, database_url=postgres_url)
    assert of("growth", settings).found == "the database takes 4 MB more"

    def fails(connection: Connection) -> None:
        raise error

    monkeypatch.setattr(doctor.health, "try_to_grow", fails)
    found = of("growth", settings)
    assert found.state == state
    assert said in found.found
