"""What a command says at its start of a database and of settings with which it cannot work as it is meant to."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from threading import Timer

import pytest

from app.services.upkeep.tables import migrate
from app.settings import Settings
from app.storage import Database, schema
from tests import forked
from tests.conftest import bare_postgres

NOT_MIGRATED = "loopaudit: the database has no tables; run `loopaudit migrate` [no_tables]\n"
AT_THE_BASE = (
    ("serve", "--port", "0"), ("worker",), ("worker", "--check"), ("beat",), ("nightly",),
    ("keys", "list"), ("keys", "create", "me"), ("trail",), ("digest",), ("report", "--plant"),
)  # fmt: skip
STARTED_HERE = (("digest",), ("report", "--plant"))
"""Commands that no other test starts by themselves."""


def line(*command: str) -> list[str]:
    return [sys.executable, "-m", "app", *command]


def own(**settings: object) -> dict[str, str]:
    """This process's environment with these settings alone."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("LOOPAUDIT_")}
    return environment | {f"LOOPAUDIT_{name.upper()}": str(value) for name, value in settings.items()}


def run(*command: str, **settings: object) -> subprocess.CompletedProcess[str]:
    return forked.run(*command, env=own(**settings), timeout=60)


def started(*command: str, **settings: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(line(*command), capture_output=True, text=True, env=own(**settings), timeout=60)


@pytest.fixture(scope="module")
def without_tables() -> Iterator[str]:
    """A database of its own beside that of the session, without tables."""
    with bare_postgres() as url:
        yield url


@pytest.mark.postgres
@pytest.mark.parametrize("command", AT_THE_BASE, ids=" ".join)
def test_a_data_base_without_tables_is_told_in_a_line(
    tmp_path: Path, without_tables: str, command: tuple[str, ...]
) -> None:
    servers = {"database_url": without_tables, "broker_url": "redis://127.0.0.1:1/0"}
    done = (started if command in STARTED_HERE else run)(*command, data_dir=tmp_path, **servers)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", NOT_MIGRATED)


@pytest.mark.parametrize("command", [("worker", "--check"), ("nightly",), ("trail",)], ids=" ".join)
def test_a_data_base_that_is_away_is_told_in_words(tmp_path: Path, command: tuple[str, ...]) -> None:
    servers = {"database_url": "postgresql://127.0.0.1:1/nobody", "broker_url": "redis://127.0.0.1:1/0"}
    done = run(*command, data_dir=tmp_path, **servers)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("loopaudit: the database cannot be used: ")
    assert done.stderr.endswith(" [database_away]\n")


@pytest.mark.postgres
@pytest.mark.parametrize("command", [*AT_THE_BASE[:4], ("keys", "list")], ids=" ".join)
def test_tables_of_an_older_version_are_refused(
    tmp_path: Path, emptied_postgres: str, command: tuple[str, ...]
) -> None:
    servers = {"database_url": emptied_postgres, "broker_url": "redis://127.0.0.1:1/0"}
    database = Database(emptied_postgres)
    schema.downgrade(database, "0014")
    try:
        done = run(*command, data_dir=tmp_path, **servers)
    finally:
        schema.migrate(database)
        database.close()
    assert done.returncode == 2
    told = f"the tables have version 0014, and this program needs {schema.newest_revision()}; run `loopaudit migrate`"
    assert f"loopaudit: {told} [older_tables]" in done.stderr
    assert "Traceback" not in done.stderr
    assert "serving" not in done.stderr


def test_the_embedded_default_brings_its_tables_up_itself(tmp_path: Path) -> None:
    migrate(Settings(data_dir=tmp_path))
    database = Database(f"sqlite:///{tmp_path / 'loopaudit.db'}")
    schema.downgrade(database, "0014")
    done = run("keys", "list", data_dir=tmp_path)
    assert done.returncode == 0, done.stderr
    assert schema.current_revision(database) == schema.newest_revision()
    database.close()


@pytest.mark.parametrize("command", [("worker",), ("beat",)], ids=" ".join)
def test_a_data_base_that_is_away_is_waited_for(tmp_path: Path, command: tuple[str, ...]) -> None:
    """As after a power cut, when all start at once."""
    servers = {"database_url": "postgresql://127.0.0.1:1/plant", "broker_url": "redis://127.0.0.1:1/0"}
    with subprocess.Popen(line(*command), stderr=subprocess.PIPE, env=own(data_dir=tmp_path, **servers)) as running:
        silent = Timer(60, running.kill)
        silent.start()
        try:
            assert any(b"it is waited for" in said for said in running.stderr)
            with pytest.raises(subprocess.TimeoutExpired):
                running.wait(2)
        finally:
            silent.cancel()
            running.kill()


def test_a_misspelt_setting_is_told_once_and_the_command_goes_on(tmp_path: Path) -> None:
    done = run("keys", "create", "me", data_dir=tmp_path, require_key="true", test_anything="1")
    assert done.returncode == 0
    told = "loopaudit: warning: LOOPAUDIT_REQUIRE_KEY is no setting; did you mean LOOPAUDIT_REQUIRE_KEYS?"
    assert done.stderr.splitlines()[0] == told
    assert done.stderr.count("is no setting") == 1


def test_the_doctor_has_a_row_for_misspelt_settings(tmp_path: Path) -> None:
    done = run("doctor", "--json", data_dir=tmp_path, nightlyat="03:00")
    row = next(json.loads(line) for line in done.stdout.splitlines() if '"variables"' in line)
    assert row["state"] == "warning"
    assert row["found"] == "LOOPAUDIT_NIGHTLYAT is no setting; did you mean LOOPAUDIT_NIGHTLY_AT?"
    assert done.stderr == ""


def test_settings_that_contradict_each_other_are_told_by_their_names(tmp_path: Path) -> None:
    done = run("migrate", data_dir=tmp_path, lease_s="10")
    assert done.returncode == 2
    told = "LOOPAUDIT_LEASE_S must be at least twice LOOPAUDIT_LOOP_LIMIT_S, got 10.0 and 20.0"
    assert done.stderr == f"loopaudit: {told} [settings]\n"


@pytest.mark.parametrize("command", [("serve", "--port", "0"), ("worker",), ("beat",)], ids=" ".join)
def test_with_a_broker_of_its_own_a_missing_file_is_no_plant_to_begin_on(
    tmp_path: Path, command: tuple[str, ...]
) -> None:
    done = run(*command, data_dir=tmp_path / "none", broker_url="redis://127.0.0.1:1/0")
    assert done.returncode == 2
    assert done.stderr.endswith("`loopaudit migrate` makes one [no_database]\n")
    assert not list(tmp_path.iterdir())
