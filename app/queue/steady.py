"""A schedule that no jump of the wall clock stops: Celery's own waits for an hour when the clock goes back by one."""

import logging
import time
from typing import Any

from celery.beat import Scheduler as CeleryScheduler
from celery.beat import SchedulingError
from celery.schedules import schedstate, schedule

from app.queue.jobs import BROKER_REFUSED

log = logging.getLogger("loopaudit.queue")


class Every(schedule):
    """Due whenever its turn in the scheduler has come, and again after its interval."""

    def is_due(self, last_run_at: Any) -> schedstate:
        return schedstate(is_due=True, next=self.seconds)


class Scheduler(CeleryScheduler):
    """Orders its entries by a clock that only goes forward. It remembers nothing: the data base knows what is due."""

    def apply_entry(self, entry: Any, producer: Any = None) -> None:
        """What the broker does not take is told in a line, every few seconds, and not with where in this program."""
        try:
            self.apply_async(entry, producer=producer, advance=False)
        except SchedulingError as error:
            log.error("the broker takes nothing, asked again soon: %s", error, extra={"code": BROKER_REFUSED})

    def _when(self, entry: Any, next_time_to_run: float, mktime: Any = None) -> float:
        return time.monotonic() + (self.adjust(next_time_to_run) or 0)
