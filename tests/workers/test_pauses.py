"""How long a worker and the schedule wait after a broker that refuses, before they ask it again."""

import errno
import logging
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from celery.beat import ScheduleEntry, SchedulingError
from celery.exceptions import WorkerShutdown

from app.queue import SWEEP, consuming, steady
from app.queue.application import celery_application
from app.queue.refusals import RETRIES_IN_S
from app.settings import Settings


class RefusedError(Exception):
    """What a broker answers that takes nothing."""


class LostError(Exception):
    """Of a connection."""


class LostByRefusalError(RefusedError, LostError):
    """As Redis has some that are both."""


GROWING = [1.0, 2.0, 4.0, 8.0, 16.0, RETRIES_IN_S, RETRIES_IN_S]


@pytest.fixture
def now_s(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The one clock of what waits, which goes on by waiting."""
    now = [1000.0]
    clock = SimpleNamespace(monotonic=lambda: now[0], sleep=lambda seconds: now.append(now.pop() + seconds))
    monkeypatch.setattr(consuming, "time", clock)
    monkeypatch.setattr(steady, "time", clock)
    return now


@pytest.fixture
def worker(now_s: list[float]) -> consuming.Consumer:
    made = consuming.Consumer.__new__(consuming.Consumer)
    made.connection_errors, made.channel_errors = (LostError,), (RefusedError,)
    return made


def waited(now_s: list[float], what: Callable[[Any], Any], error: Exception) -> float:
    begun = now_s[0]
    what(error)
    return now_s[0] - begun


def test_a_worker_waits_longer_with_each_refusal_and_shortly_after_a_quiet_minute(
    worker: consuming.Consumer, now_s: list[float]
) -> None:
    refuse = worker.on_connection_error_before_connected
    for pause_s in GROWING:
        assert waited(now_s, refuse, RefusedError()) == pytest.approx(pause_s, abs=0.3)
    now_s[0] += consuming.QUIET_S - 1.0
    assert waited(now_s, refuse, RefusedError()) == pytest.approx(RETRIES_IN_S, abs=0.3)
    now_s[0] += consuming.QUIET_S + 1.0
    assert waited(now_s, refuse, RefusedError()) == pytest.approx(1.0, abs=0.3)


def test_a_worker_that_is_told_to_stop_waits_no_longer(
    worker: consuming.Consumer, now_s: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop() -> None:
        if now_s[0] > 1000.5:
            raise WorkerShutdown

    monkeypatch.setattr(consuming, "maybe_shutdown", stop)
    with pytest.raises(WorkerShutdown):
        worker.on_connection_error_before_connected(RefusedError())
    assert now_s[0] < 1000.9


@pytest.mark.parametrize("error", [LostError(), LostByRefusalError()], ids=["lost", "lost by a refusal"])
def test_a_connection_that_was_lost_is_left_to_celery(
    worker: consuming.Consumer, now_s: list[float], monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    left: list[Exception] = []
    for when in ("before", "after"):
        name = f"on_connection_error_{when}_connected"
        monkeypatch.setattr(consuming.CeleryConsumer, name, lambda _, error: left.append(error))
        assert waited(now_s, getattr(worker, name), error) == 0.0
    assert left == [error, error]


@pytest.fixture
def schedule(tmp_path: Path, now_s: list[float]) -> steady.Scheduler:
    made = steady.Scheduler(celery_application(Settings(data_dir=tmp_path)), lazy=True)
    made.connection = SimpleNamespace(connection_errors=(LostError,), channel_errors=(RefusedError,))
    return made


def test_a_schedule_waits_longer_with_each_refusal(schedule: steady.Scheduler, now_s: list[float]) -> None:
    asked_at: list[float] = []

    def connect(*_: Any) -> str:
        asked_at.append(now_s[0])
        if len(asked_at) <= len(GROWING):
            raise RefusedError
        return "connected"

    schedule.connection.ensure_connection = connect
    assert schedule._ensure_connected() == "connected"
    assert [later - before for before, later in pairwise(asked_at)] == GROWING


@pytest.mark.parametrize(
    ("cause", "begins"),
    [
        (OSError(errno.ENOSPC, "full"), "no room on the disk"),
        (OSError(errno.EDQUOT, "quota"), "no room on the disk"),
        (OSError(errno.ECONNREFUSED, "gone"), "the broker is away"),
        (LostError("gone"), "the broker is away"),
        (RefusedError("no"), "the broker answers and refuses"),
        (LostByRefusalError("gone"), "the broker is away"),
        (ValueError("ours"), "the schedule cannot ring"),
    ],
    ids=lambda value: getattr(value, "args", [value])[-1] if isinstance(value, Exception) else "",
)
def test_a_schedule_says_why_it_could_not_ring(
    schedule: steady.Scheduler,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    cause: Exception,
    begins: str,
) -> None:
    def ring(*_: Any, **__: Any) -> None:
        try:
            raise cause
        except Exception as error:
            raise SchedulingError("not sent") from error

    monkeypatch.setattr(schedule, "apply_async", ring)
    schedule.apply_entry(ScheduleEntry(name="sweep", task=SWEEP, schedule=60.0, app=schedule.app))
    (told,) = (record for record in caplog.records if record.name == "loopaudit.queue")
    assert told.getMessage().startswith(begins)
    assert (told.levelno, told.exc_info is not None) == (logging.ERROR, begins == "the schedule cannot ring")
