"""What many ask at once: answered by one asker at a time for all others, so that no crowd takes the threads."""

import asyncio
import time
from collections.abc import Callable
from typing import Generic, TypeVar

KEPT_S = 1.0
LONGEST_KEPT_S = 10.0
"""An answer that is older is not given any more while the next one is awaited."""
PATIENCE_S = 5.0

Answer = TypeVar("Answer")


class Probe(Generic[Answer]):
    """An answer that is kept for a moment, and given while the next one is awaited. late: what is answered where that
    one takes longer than `patience_s`, in seconds, and none is known that is young enough; None: it is waited for."""

    def __init__(
        self,
        ask: Callable[[], Answer],
        kept_s: float = KEPT_S,
        *,
        late: Answer | None = None,
        patience_s: float = PATIENCE_S,
    ) -> None:
        self._ask = ask
        self._kept_s = kept_s
        self._late = late
        self._patience_s = None if late is None else patience_s
        self._asking: asyncio.Task[Answer] | None = None
        self._found: Answer | None = None
        self._asked_at = 0.0

    async def found(self) -> Answer:
        asking = self._asking if self._asking is not None and not self._asking.done() else None
        known = self._known(self._kept_s if asking is None else LONGEST_KEPT_S)
        if known is not None:
            return known
        if asking is None:
            asking = self._asking = asyncio.create_task(self._ask_anew())
        await asyncio.wait({asking}, timeout=self._patience_s)
        if asking.done() or self._late is None:
            return asking.result()
        return self._known(LONGEST_KEPT_S) or self._late

    async def _ask_anew(self) -> Answer:
        # Not in one of the threads of the requests, which may all wait for what is asked here.
        found = self._found = await asyncio.to_thread(self._ask)
        self._asked_at = time.monotonic()
        return found

    def _known(self, at_most_s: float) -> Answer | None:
        return self._found if time.monotonic() - self._asked_at < at_most_s else None
