"""Whose turn it is: uploads, which are waited for, go before other work.

In equal turns of all queues each upload would wait for an explanation and a chunk of an audit, ten seconds of work; a
hundred uploads behind a night's explanations would take a quarter of an hour. After a few uploads in a row something
else gets its turn all the same: doorbells of uploads whose files are away are rung again and again.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from kombu.utils.scheduling import FairCycle, round_robin_cycle

from app.queue.jobs import KIND_OF, READ_UPLOAD

AHEAD = f"-{KIND_OF[READ_UPLOAD]}"
MOST_IN_A_ROW = 8


def goes_ahead(queue: str) -> bool:
    """Whether a worker looks into this queue before the others."""
    return queue.endswith(AHEAD)


class OrderOfQueues(round_robin_cycle):
    """In which order queues are looked into, for a broker that is asked for all at once, as Redis is: uploads, then the
    others, of which those first that were served longest ago.
    """

    _in_a_row = 0

    def consume(self, n: int) -> list[str]:
        """The first n queues."""
        others_first = self._in_a_row >= MOST_IN_A_ROW
        return sorted(self.items, key=lambda queue: goes_ahead(queue) == others_first)[:n]

    def rotate(self, last_used: str) -> str:
        """Told which queue had something."""
        self._in_a_row = self._in_a_row + 1 if goes_ahead(last_used) else 0
        return super().rotate(last_used)


class QueuesOneByOne(FairCycle):
    """The same order for a broker whose queues are asked one after the other, as those of the folder are."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._order = OrderOfQueues([])

    def get(self, callback: Callable[..., Any], **options: Any) -> Any:
        if set(self._order.items) != set(self.resources):
            self._order.update(self.resources)
        for queue in self._order.consume(len(self.resources)):
            with suppress(self.predicate):
                found = self.fun(queue, callback, **options)
                self._order.rotate(queue)
                return found
        raise self.predicate()
