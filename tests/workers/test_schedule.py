"""The schedule goes on whatever the wall clock does."""

import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from app.queue import steady
from app.queue.application import celery_application
from app.settings import Settings


@pytest.fixture
def scheduler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> steady.Scheduler:
    application = celery_application(Settings(data_dir=tmp_path, sweep_s=5.0))
    made = steady.Scheduler(application)
    made.sent = []
    monkeypatch.setattr(made, "apply_entry", lambda entry, producer=None: made.sent.append(entry.task))
    monkeypatch.setattr(steady.Scheduler, "producer", None)
    return made


def test_the_scheduler_is_the_one_that_celery_is_given(tmp_path: Path) -> None:
    assert celery_application(Settings(data_dir=tmp_path)).conf.beat_scheduler == "app.queue.steady:Scheduler"


@pytest.mark.parametrize("jump_s", [-86_400.0, -3600.0, 0.0, 3600.0])
def test_sweeps_come_every_interval_although_the_clock_jumps(
    scheduler: steady.Scheduler, monkeypatch: pytest.MonkeyPatch, jump_s: float
) -> None:
    now_s = [time.monotonic()]
    monkeypatch.setattr(steady.time, "monotonic", lambda: now_s[0])
    assert scheduler.tick() == 0
    scheduler.app.now = lambda: datetime.now(UTC) + timedelta(seconds=jump_s)
    for entry in scheduler.schedule.values():
        entry.schedule.nowfun = scheduler.app.now
    for _ in range(4):
        waits_s = scheduler.tick()
        assert 4.0 < waits_s <= 5.0
        now_s[0] += 5.0
        assert scheduler.tick() == 0
    assert len(scheduler.sent) == 5
