"""Redis as Celery's broker, with a worker that goes on where its acknowledgement was lost, and queues that end.

A task that ends while Redis is away cannot be acknowledged. kombu's own channel counts it as unfinished from then on,
asks for no other as long as a worker may hold one, and so never hears that Redis has come back: the worker stands still
for good. Here it is finished for the worker, whatever Redis was told: what Redis still holds of it is given out again
after the visibility timeout, to somebody who finds nothing to do; so is a message that could not be put back.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from kombu.transport import redis, virtual

from app.queue.jobs import MOST_WAITING


class QoS(redis.QoS):
    """Which messages this worker holds."""

    def ack(self, delivery_tag: str) -> None:
        with self._let_go(delivery_tag):
            super().ack(delivery_tag)

    def reject(self, delivery_tag: str, requeue: bool = False) -> None:
        with self._let_go(delivery_tag):
            super().reject(delivery_tag, requeue=requeue)

    @contextmanager
    def _let_go(self, delivery_tag: str) -> Iterator[None]:
        """Whatever kept Redis from hearing it is raised, once the message is none of this worker's."""
        try:
            yield
        except Exception:
            virtual.QoS.ack(self, delivery_tag)
            raise


class Channel(redis.Channel):
    """A channel of such messages."""

    QoS = QoS

    def _put(self, queue: str, message: Any, **options: Any) -> None:
        """What is left out is announced again by a sweep, once there is less."""
        if self._size(queue) < MOST_WAITING:
            super()._put(queue, message, **options)


class Transport(redis.Transport):
    """What `redis://` stands for here."""

    Channel: Any = Channel
