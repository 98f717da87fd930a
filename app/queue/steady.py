"""A schedule that no jump of the wall clock stops: Celery's own waits for an hour when the clock goes back by one."""

import time
from typing import Any

from celery.beat import Scheduler as CeleryScheduler
from celery.schedules import schedstate, schedule


class Every(schedule):
    """Due whenever its turn in the scheduler has come, and again after its interval."""

    def is_due(self, last_run_at: Any) -> schedstate:
        return schedstate(is_due=True, next=self.seconds)


class Scheduler(CeleryScheduler):
    """Orders its entries by a clock that only goes forward. It remembers nothing: the data base knows what is due."""

    def _when(self, entry: Any, next_time_to_run: float, mktime: Any = None) -> float:
        return time.monotonic() + (self.adjust(next_time_to_run) or 0)
