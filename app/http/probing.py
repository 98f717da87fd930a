"""What everybody may ask: answered by one asker at a time for all others, so that no crowd takes the threads."""

import asyncio
import time
from collections.abc import Callable
from typing import Any

from fastapi.concurrency import run_in_threadpool

from app.services.results import Readiness

KEPT_S = 1.0
LONGEST_KEPT_S = 10.0
"""An answer that is older is not given any more while the next one is awaited."""


class Probe:
    """An answer that is kept for a moment, and given while the next one is awaited."""

    def __init__(self) -> None:
        self._asking = asyncio.Lock()
        self._found: Readiness | None = None
        self._asked_at = 0.0

    async def found(self, ask: Callable[[Any], Readiness], of: Any) -> Readiness:
        known = self._known(LONGEST_KEPT_S if self._asking.locked() else KEPT_S)
        if known is not None:
            return known
        async with self._asking:
            known = self._known(KEPT_S)
            if known is None:
                known = self._found = await run_in_threadpool(ask, of)
                self._asked_at = time.monotonic()
            return known

    def _known(self, at_most_s: float) -> Readiness | None:
        return self._found if time.monotonic() - self._asked_at < at_most_s else None
