"""Keeps a claim alive while its work takes longer than a lease."""

import threading
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Self

from sqlalchemy import Connection
from sqlalchemy.exc import SQLAlchemyError

from app.services.backend import Backend

Renew = Callable[[Connection, float], bool]


class Heartbeat:
    """Renews a claim as long as this process lives, however long a part of the work takes.

    `renew` is given a writing connection and the lease in seconds, and says whether the claim still holds.
    """

    def __init__(self, backend: Backend, renew: Renew) -> None:
        self._backend = backend
        self._renew = renew
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._beat, name="heartbeat", daemon=True)

    def _beat(self) -> None:
        lease_s = self._backend.settings.lease_s
        while not self._stop.wait(lease_s / 3):
            # A database that is away for a moment costs a beat; the next write finds out if the claim still holds.
            with suppress(SQLAlchemyError), self._backend.database.write() as connection:
                if not self._renew(connection, lease_s):
                    return

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._stop.set()
        self._thread.join()
