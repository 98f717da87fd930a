"""A task that finds no room says so in a line."""

import errno
import logging
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from psycopg.errors import DiskFull, ReadOnlySqlTransaction
from sqlalchemy.exc import OperationalError

from app.errors import RequestError
from app.settings import Settings
from workers import tasks


@pytest.fixture(autouse=True)
def of_these_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tasks' own database, which tells their version, is not there."""
    monkeypatch.setattr(tasks, "is_outdated", lambda: False)


@pytest.mark.parametrize(
    "error",
    [OperationalError("INSERT", {}, DiskFull("could not extend file")), OSError(errno.ENOSPC, "could not extend file")],
    ids=["database", "data folder"],
)
def test_a_full_disk_ends_a_task_with_a_line(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, error: Exception
) -> None:
    monkeypatch.setattr(tasks, "backend", raising(error))
    for task in (tasks.read_upload, tasks.audit_chunk):
        assert task(1) is None
    for task in (tasks.explain, tasks.deliver, tasks.sweep):
        assert task() is None
    told = [record for record in caplog.records if record.levelno == logging.ERROR]
    assert len(told) == 5
    assert all("make room" in record.getMessage() and "could not extend" in record.getMessage() for record in told)
    assert not any(record.exc_info for record in told)


def test_so_does_a_data_folder_that_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    gone = SimpleNamespace(settings=Settings(data_dir=tmp_path / "gone"))
    monkeypatch.setattr(tasks, "backend", lambda: gone)
    monkeypatch.setattr(tasks.sweeping, "sweep", raising(OSError(errno.ESTALE, "Stale file handle")))
    tasks.sweep()
    (told,) = [record for record in caplog.records if record.levelno == logging.ERROR]
    assert "the data folder is gone" in told.getMessage()
    assert not told.exc_info


@pytest.mark.parametrize("told", ["does not answer", "takes no writes"])
def test_so_does_a_data_base_that_is_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, told: str
) -> None:
    driver = ReadOnlySqlTransaction("cannot execute UPDATE") if "writes" in told else Exception("connection refused")
    away = OperationalError("SELECT", {}, driver)
    backend = SimpleNamespace(settings=Settings(data_dir=tmp_path), database=SimpleNamespace(answers=raising(away)))
    monkeypatch.setattr(tasks, "backend", lambda: backend)
    monkeypatch.setattr(tasks.sweeping, "sweep", raising(away))
    tasks.sweep()
    (line,) = [record for record in caplog.records if record.levelno == logging.ERROR]
    assert f"the database {told}" in line.getMessage()
    assert not line.exc_info


def test_so_do_exports_that_cannot_be_looked_into(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """By retention, while their folder is away."""
    monkeypatch.setattr(tasks, "backend", lambda: None)
    monkeypatch.setattr(tasks.sweeping, "sweep", raising(RequestError("no_exports_folder", "cannot be looked into")))
    tasks.sweep()
    (line,) = [record for record in caplog.records if record.levelno == logging.ERROR]
    assert "cannot be looked into" in line.getMessage()


@pytest.mark.parametrize("error", [OperationalError("SELECT", {}, Exception("gone")), OSError(errno.EIO, "broken")])
def test_other_faults_stay_faults(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    monkeypatch.setattr(tasks, "backend", raising(error))
    with pytest.raises(type(error)):
        tasks.sweep()


def raising(error: Exception) -> Callable[..., None]:
    def fails(*_: object) -> None:
        raise error

    return fails
