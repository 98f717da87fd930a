"""A task that finds no room says so in a line."""

import errno
import logging
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from psycopg.errors import DiskFull
from sqlalchemy.exc import OperationalError

from app.settings import Settings
from workers import tasks


@pytest.fixture(autouse=True)
def of_these_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tasks' own data base, which tells their version, is not there."""
    monkeypatch.setattr(tasks, "is_outdated", lambda: False)


@pytest.mark.parametrize(
    "error",
    [OperationalError("INSERT", {}, DiskFull("could not extend file")), OSError(errno.ENOSPC, "could not extend file")],
    ids=["data base", "data folder"],
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


@pytest.mark.parametrize("error", [OperationalError("SELECT", {}, Exception("gone")), OSError(errno.EIO, "broken")])
def test_other_faults_stay_faults(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    monkeypatch.setattr(tasks, "backend", raising(error))
    with pytest.raises(type(error)):
        tasks.sweep()


def raising(error: Exception) -> Callable[..., None]:
    def fails(*_: object) -> None:
        raise error

    return fails
