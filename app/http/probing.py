"""What many ask at once: answered by one asker at a time for all others, so that no crowd takes the threads."""

import asyncio
import time
from collections.abc import Callable
from typing import Generic, TypeVar

from fastapi.concurrency import run_in_threadpool

KEPT_S = 1.0
LONGEST_KEPT_S = 10.0
"""An answer that is older is not given any more while the next one is awaited."""

Answer = TypeVar("Answer")


class Probe(Generic[Answer]):
    """An answer that is kept for a moment, and given while the next one is awaited."""

    def __init__(self, ask: Callable[[], Answer], kept_s: float = KEPT_S) -> None:
        self._ask = ask
        self._kept_s = kept_s
        self._asking = asyncio.Lock()
        self._found: Answer | None = None
        self._asked_at = 0.0

    async def found(self) -> Answer:
        known = self._known(LONGEST_KEPT_S if self._asking.locked() else self._kept_s)
        if known is not None:
            return known
        async with self._asking:
            known = self._known(self._kept_s)
            if known is None:
                known = self._found = await run_in_threadpool(self._ask)
                self._asked_at = time.monotonic()
            return known

    def _known(self, at_most_s: float) -> Answer | None:
        return self._found if time.monotonic() - self._asked_at < at_most_s else None
