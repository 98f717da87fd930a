"""The HTTP protocol with a deadline for the head of a request and a limit of connections, which uvicorn's has not."""

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

from app.services.access.rates import counted_as

HEAD_DEADLINE_S = 20.0
LARGEST_HEAD_BYTES = 64 << 10


class HeadDeadline(H11Protocol):
    """Closes a connection that does not tell a whole request (line and headers) in time: nobody can hold connections
    open by sending a byte now and then. Between requests uvicorn's keep-alive time holds.

    A connection above the limit of the server is closed at once, whatever it would ask: each is an open file, of which
    a process has so many. Of one address half of them are taken."""

    _waiting: asyncio.TimerHandle | None = None
    _of = ""
    """Whom it is counted with, found out once; of a socket without addresses, nobody by name."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        # At its limit uvicorn would refuse what those ask that it keeps.
        self._most, self.limit_concurrency = self.limit_concurrency, None

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        self._of = counted_as(self.client[0]) if self.client else ""
        if self._is_too_many():
            self.connections.discard(self)  # at once: those of a moment would count until the next, and push out others
            transport.abort()
        else:
            self._wait_for_head()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.cycle is not None and not self.cycle.response_complete:
            self._stop_waiting()
        elif self._waiting is None:
            self._wait_for_head()

    def connection_lost(self, exc: Exception | None) -> None:
        self._stop_waiting()
        super().connection_lost(exc)

    def _is_too_many(self) -> bool:
        most, now = self._most, len(self.connections)
        if most is None or now <= most // 2:
            return False
        return now > most or sum(getattr(other, "_of", None) == self._of for other in self.connections) > most // 2

    def _wait_for_head(self) -> None:
        self._waiting = self.loop.call_later(HEAD_DEADLINE_S, self._give_up)

    def _stop_waiting(self) -> None:
        if self._waiting is not None:
            self._waiting.cancel()
            self._waiting = None

    def _give_up(self) -> None:
        self._waiting = None
        if not self.transport.is_closing():
            self.transport.close()
