"""Rings for a worker, after the commit; never fails its caller, because the sweeper rings again."""

import logging
import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import cached_property
from threading import Thread
from typing import TYPE_CHECKING

from kombu.exceptions import OperationalError

from app.queue.jobs import AUDIT_CHUNK, DELIVER, EXPLAIN, FORGOTTEN_AFTER_S, READ_UPLOAD, SWEEP
from app.queue.refusals import BrokerRefusal, refusal_of
from app.settings import Settings

if TYPE_CHECKING:
    from celery import Celery

log = logging.getLogger("loopaudit.queue")

ANSWERS_IN_S = 2.0
"""A request waits no longer than this for a broker that takes the connection and says nothing."""
HANGS_AFTER_S = 3.0
"""Nor a probe longer than this for its name to be found, which knows no limit of ours: the database is well."""
PROBE = "loopaudit-probe"
AWAY_S = 5.0
"""After a failure it is not asked again for so long, by whoever rings: each would wait as long as the one before."""


class Queue:
    """The door to the broker. The connection is made when it is first needed."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._away_until = 0.0
        self._asking: Future[bool] | None = None
        self.refusal: BrokerRefusal | None = None
        """What the broker refused when it was asked last."""

    def read_upload(self, upload_id: int) -> bool:
        return self._send(READ_UPLOAD, upload_id)

    def audit_chunks(self, audit_id: int, messages: int) -> bool:
        return all(self._send(AUDIT_CHUNK, audit_id) for _ in range(messages))

    def explain(self, messages: int) -> bool:
        return all(self._send(EXPLAIN) for _ in range(messages))

    def deliver(self, messages: int) -> bool:
        return all(self._send(DELIVER) for _ in range(messages))

    def sweep(self) -> bool:
        return self._send(SWEEP)

    def reachable(self) -> bool:
        """Whether the broker answers within a few seconds, and takes what is sent: a Redis without memory left, or
        whose disk is full, refuses that alone."""
        if self._asking is None or self._asking.done():
            self._asking = in_background(self._answers)
        try:
            return self._asking.result(HANGS_AFTER_S)
        except TimeoutError:
            log.warning("broker away: no answer within %s s", HANGS_AFTER_S)
            self.refusal = None
            self._away_until = time.monotonic() + AWAY_S
            return False

    def _answers(self) -> bool:
        try:
            with self._application.connection_for_write() as connection:
                connection.ensure_connection(max_retries=1, interval_start=0, timeout=ANSWERS_IN_S)
                client = getattr(connection.default_channel, "client", None)
                if client is not None:  # of Redis alone
                    client.set(PROBE, "", px=1000)
        except self._refusals as error:
            self._tell(error)
            return False
        self._away_until, self.refusal = 0.0, None
        return True

    def close(self) -> None:
        if "_application" in self.__dict__:
            self._application.close()

    def _send(self, job: str, *arguments: int) -> bool:
        if time.monotonic() < self._away_until:
            log.info("broker was away just now, %s%r waits for the sweeper", job, arguments)
            return False
        try:
            self._application.send_task(job, args=arguments, expiration=FORGOTTEN_AFTER_S)
        except self._refusals as error:
            self._tell(error, f", {job}{arguments!r} waits for the sweeper")
            return False
        self.refusal = None
        return True

    def _tell(self, error: Exception, what_waits: str = "") -> None:
        self._away_until = time.monotonic() + AWAY_S
        self.refusal = refusal = refusal_of(error, self._application.connection_for_write().channel_errors)
        if refusal is None:
            log.warning("broker away%s: %s", what_waits, error)
        else:
            text = "the broker %s%s: %s"
            log.warning(text, refusal.told, what_waits, error, extra={"code": refusal.code})

    @cached_property
    def _refusals(self) -> tuple[type[Exception], ...]:
        """Also those of the broker's own, such as a Redis that has no memory left."""
        connection = self._application.connection_for_write()
        return OperationalError, OSError, *connection.connection_errors, *connection.channel_errors

    @cached_property
    def _application(self) -> "Celery":
        from app.queue.application import celery_application

        return celery_application(self._settings, answers_in_s=ANSWERS_IN_S)


def in_background(ask: Callable[[], bool]) -> Future[bool]:
    """In a thread that no process waits for when it ends, as it would for one of a pool."""
    asking: Future[bool] = Future()

    def run() -> None:
        try:
            asking.set_result(ask())
        except BaseException as error:  # noqa: BLE001 - whoever awaits the answer is told
            asking.set_exception(error)

    Thread(target=run, name="broker", daemon=True).start()
    return asking
