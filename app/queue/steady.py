"""A schedule that no jump of the wall clock stops: Celery's own waits for an hour when the clock goes back by one."""

import errno
import logging
import time
from typing import Any

from celery.beat import Scheduler as CeleryScheduler
from celery.beat import SchedulingError
from celery.schedules import schedstate, schedule
from kombu.exceptions import OperationalError

from app.queue.refusals import RETRIES_IN_S, refusal_of, tell_failure

FIRST_PAUSE_S = 1.0
NO_ROOM = {errno.ENOSPC, errno.EDQUOT}

log = logging.getLogger("loopaudit.queue")


class Every(schedule):
    """Due whenever its turn in the scheduler has come, and again after its interval."""

    def is_due(self, last_run_at: Any) -> schedstate:
        return schedstate(is_due=True, next=self.seconds)


class Scheduler(CeleryScheduler):
    """Orders its entries by a clock that only goes forward. It remembers nothing: the database knows what is due."""

    def apply_entry(self, entry: Any, producer: Any = None) -> None:
        """What the broker does not take is told in a line, every few seconds; a fault of ours with where it is."""
        try:
            self.apply_async(entry, producer=producer, advance=False)
        except SchedulingError as error:
            self._tell(error, error.__context__)

    def _ensure_connected(self) -> Any:
        """A RabbitMQ that refuses the login is no connection that was lost: it would end the schedule."""
        pause_s = FIRST_PAUSE_S
        while True:
            try:
                return self.connection.ensure_connection(self._tell_away, self.app.conf.broker_connection_max_retries)
            except self.connection.channel_errors as error:
                tell_failure(log, error, pause_s, self.connection.channel_errors)
            time.sleep(pause_s)
            pause_s = min(2 * pause_s, RETRIES_IN_S)

    def _tell_away(self, error: Exception, pause_s: float) -> None:
        tell_failure(log, error, pause_s)

    def _tell(self, error: SchedulingError, cause: BaseException | None) -> None:
        away, refused = self.connection.connection_errors, self.connection.channel_errors
        of_broker = cause.__cause__ if isinstance(cause, OperationalError) else cause
        such = () if isinstance(of_broker, away) else refused
        if of_broker is not None and (refusal := refusal_of(of_broker, such)):
            text = "the broker %s, asked again soon: %s"
            log.error(text, refusal.told, error, extra={"code": refusal.code})
        elif {getattr(it, "errno", None) for it in (cause, of_broker)} & NO_ROOM:
            log.error("no room on the disk for the broker's messages, make room; asked again soon: %s", error)
        elif isinstance(cause, (OperationalError, OSError, *away)):
            log.error("the broker is away, asked again soon: %s", error)
        else:
            log.error("the schedule cannot ring: %s", error, exc_info=error)

    def _when(self, entry: Any, next_time_to_run: float, mktime: Any = None) -> float:
        return time.monotonic() + (self.adjust(next_time_to_run) or 0)
