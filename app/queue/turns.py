"""Whose turn it is: what is quick and waited for goes before audits and explanations, which take equal turns.

In equal turns of all queues each upload would wait for an explanation and a chunk of an audit, ten seconds of work; a
hundred uploads behind a night's explanations would take a quarter of an hour.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from kombu.utils.scheduling import FairCycle, round_robin_cycle

from app.queue.jobs import KIND_OF, READ_UPLOAD, SWEEP

AHEAD = tuple(f"-{KIND_OF[job]}" for job in (SWEEP, READ_UPLOAD))


def goes_ahead(queue: str) -> bool:
    """Whether a worker looks into this queue before the others."""
    return queue.endswith(AHEAD)


class OneAsk(round_robin_cycle):
    """The order for a broker that is asked for all queues at once, as Redis is."""

    def consume(self, n: int) -> list[str]:
        return sorted(super().consume(n), key=lambda queue: not goes_ahead(queue))


class OneByOne(FairCycle):
    """The order for a broker whose queues are asked one after the other, as those of the folder are."""

    def get(self, callback: Callable[..., Any], **options: Any) -> Any:
        for queue in filter(goes_ahead, tuple(self.resources)):
            with suppress(self.predicate):
                return self.fun(queue, callback, **options)
        return super().get(callback, **options)
