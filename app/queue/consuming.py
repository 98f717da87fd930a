"""A worker that goes on where its broker answers and refuses: a Redis without memory left, with a full disk or become a
replica, a RabbitMQ that waited longer than its `consumer_timeout` for a large export to be read, or a login that either
refuses.

Celery counts that as unrecoverable and ends. What the broker did not take or lost is in the database, and the sweeper
rings for it again.
"""

import logging
import time
import warnings
from typing import Any

from celery.exceptions import CPendingDeprecationWarning
from celery.worker import request
from celery.worker.consumer import Consumer as CeleryConsumer
from celery.worker.state import maybe_shutdown

from app.queue.refusals import RETRIES_IN_S, tell_failure

FIRST_PAUSE_S, LOOKS_EVERY_S = 1.0, 0.2
QUIET_S = 60.0
"""Without a refusal for so long, the next one is a new one."""

log = logging.getLogger("loopaudit.queue")


class Consumer(CeleryConsumer):
    """Connects anew after a refusal, as after a lost connection, with a growing pause."""

    _pause_s, _refused_at = FIRST_PAUSE_S, 0.0

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        request.logger.addFilter(_tell_unheard)

    def ensure_connected(self, conn: Any) -> Any:
        """As Celery's own, which says "Cannot connect" of a login that is refused too."""
        retries = self.app.conf.broker_connection_max_retries
        connected = conn.ensure_connection(self._tell, retries, callback=maybe_shutdown)
        self.first_connection_attempt = False
        return connected

    def _tell(self, error: Exception, pause_s: float) -> None:
        tell_failure(log, error, pause_s)

    def on_connection_error_before_connected(self, exc: Exception) -> None:
        if self._is_refusal(exc):
            self._wait_after(exc)
        else:
            super().on_connection_error_before_connected(exc)

    def on_connection_error_after_connected(self, exc: Exception) -> None:
        with warnings.catch_warnings():  # each time, that a later Celery would end the task at hand
            warnings.simplefilter("ignore", CPendingDeprecationWarning)
            super().on_connection_error_after_connected(exc)
        if self._is_refusal(exc):
            self._wait_after(exc)

    def _is_refusal(self, error: Exception) -> bool:
        return isinstance(error, self.channel_errors) and not isinstance(error, self.connection_errors)

    def _wait_after(self, refusal: Exception) -> None:
        is_new = time.monotonic() - self._refused_at > QUIET_S
        self._pause_s = FIRST_PAUSE_S if is_new else min(2 * self._pause_s, RETRIES_IN_S)
        tell_failure(log, refusal, self._pause_s, self.channel_errors)
        until = time.monotonic() + self._pause_s
        while time.monotonic() < until:
            maybe_shutdown()
            time.sleep(LOOKS_EVERY_S)
        self._refused_at = time.monotonic()


def _tell_unheard(record: logging.LogRecord) -> bool:
    """A task is done and its acknowledgement found no connection: critical to kombu, and told with a traceback."""
    if str(record.msg).startswith("Couldn't ack"):
        record.levelno, record.levelname, record.exc_info = logging.WARNING, "WARNING", None
        record.msg = "a task is done and could not be acknowledged (%r), it is handed out again and found done: %r"
    return True
