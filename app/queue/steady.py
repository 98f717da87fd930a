"""A schedule that no jump of the wall clock stops: Celery's own waits for an hour when the clock goes back by one."""

import errno
import logging
import time
from typing import Any

from celery.beat import Scheduler as CeleryScheduler
from celery.beat import SchedulingError
from celery.schedules import schedstate, schedule
from kombu.exceptions import OperationalError

from app.queue.jobs import BROKER_REFUSED

NO_ROOM = {errno.ENOSPC, errno.EDQUOT}

log = logging.getLogger("loopaudit.queue")


class Every(schedule):
    """Due whenever its turn in the scheduler has come, and again after its interval."""

    def is_due(self, last_run_at: Any) -> schedstate:
        return schedstate(is_due=True, next=self.seconds)


class Scheduler(CeleryScheduler):
    """Orders its entries by a clock that only goes forward. It remembers nothing: the data base knows what is due."""

    def apply_entry(self, entry: Any, producer: Any = None) -> None:
        """What the broker does not take is told in a line, every few seconds; a fault of ours with where it is."""
        try:
            self.apply_async(entry, producer=producer, advance=False)
        except SchedulingError as error:
            self._tell(error, error.__context__)

    def _tell(self, error: SchedulingError, cause: BaseException | None) -> None:
        away, refused = self.connection.connection_errors, self.connection.channel_errors
        of_broker = cause.__cause__ if isinstance(cause, OperationalError) else cause
        if isinstance(of_broker, refused) and not isinstance(of_broker, away):
            text = "the broker answers and refuses, asked again soon: %s"
            log.error(text, error, extra={"code": BROKER_REFUSED})
        elif {getattr(it, "errno", None) for it in (cause, of_broker)} & NO_ROOM:
            log.error("no room on the disk for the broker's messages, make room; asked again soon: %s", error)
        elif isinstance(cause, (OperationalError, OSError, *away)):
            log.error("the broker is away, asked again soon: %s", error)
        else:
            log.error("the schedule cannot ring: %s", error, exc_info=error)

    def _when(self, entry: Any, next_time_to_run: float, mktime: Any = None) -> float:
        return time.monotonic() + (self.adjust(next_time_to_run) or 0)
