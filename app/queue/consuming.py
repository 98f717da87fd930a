"""A worker that goes on where its broker answers and refuses: a Redis without memory left, or with a full disk, or a
RabbitMQ that waited longer than its `consumer_timeout` for a large export to be read.

Celery counts that as unrecoverable and ends. What the broker did not take or lost is in the data base, and the sweeper
rings for it again.
"""

import logging
import time

from celery.worker.consumer import Consumer as CeleryConsumer
from celery.worker.state import maybe_shutdown

from app.queue.jobs import BROKER_REFUSED

FIRST_PAUSE_S, LONGEST_PAUSE_S, LOOKS_EVERY_S = 1.0, 10.0, 0.2
QUIET_S = 60.0
"""Without a refusal for so long, the next one is a new one."""

log = logging.getLogger("loopaudit.queue")


class Consumer(CeleryConsumer):
    """Connects anew after a refusal, as after a lost connection, with a growing pause."""

    _pause_s, _refused_at = FIRST_PAUSE_S, 0.0

    def on_connection_error_before_connected(self, exc: Exception) -> None:
        if self._is_refusal(exc):
            self._wait_after(exc)
        else:
            super().on_connection_error_before_connected(exc)

    def on_connection_error_after_connected(self, exc: Exception) -> None:
        super().on_connection_error_after_connected(exc)
        if self._is_refusal(exc):
            self._wait_after(exc)

    def _is_refusal(self, error: Exception) -> bool:
        return isinstance(error, self.channel_errors) and not isinstance(error, self.connection_errors)

    def _wait_after(self, refusal: Exception) -> None:
        from redis import RedisError  # a tenth of a second at the start of a worker whose broker is another

        is_new = time.monotonic() - self._refused_at > QUIET_S
        self._pause_s = FIRST_PAUSE_S if is_new else min(2 * self._pause_s, LONGEST_PAUSE_S)
        wanted = "takes nothing, make room in it" if isinstance(refusal, RedisError) else "refuses"
        text = "the broker answers and %s; trying again in %.0f s: %s"
        log.error(text, wanted, self._pause_s, refusal, extra={"code": BROKER_REFUSED})
        until = time.monotonic() + self._pause_s
        while time.monotonic() < until:
            maybe_shutdown()
            time.sleep(LOOKS_EVERY_S)
        self._refused_at = time.monotonic()
