"""Connections to an SQLite file are to the one that bears its name: its folder may be a share that is away."""

import os
import sqlite3
from contextlib import suppress
from typing import Any

from sqlalchemy import Engine, event
from sqlalchemy.exc import InvalidatePoolError


class OwnFile:
    """The file of a database for all its engines. It is made where it is new, and never again: an empty one in the
    place of one that is away would be the database of this process for good. A connection to a file that bears the
    name no more is let go.

    What is in memory, or has a URI, is left to SQLite.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._was_there = False

    def keep(self, engine: Engine) -> None:
        if not self._name or self._name == ":memory:" or self._name.startswith("file:"):
            return
        event.listen(engine, "do_connect", self._begin)
        event.listen(engine, "connect", self._note)
        event.listen(engine, "checkout", self._compare)

    def _begin(self, *_: Any) -> None:
        if self._was_there and self._identity() is None:
            raise sqlite3.OperationalError(f"unable to open database file: {self._name} was there, and is gone")
        _make_private(self._name)

    def _note(self, _: Any, record: Any) -> None:
        record.info["file"] = self._identity()
        self._was_there = True

    def _compare(self, _: Any, record: Any, __: Any) -> None:
        if record.info["file"] != self._identity():
            raise InvalidatePoolError

    def _identity(self) -> tuple[int, int] | None:
        try:
            found = os.stat(self._name)
        except OSError:
            return None
        return found.st_dev, found.st_ino


def _make_private(name: str) -> None:
    """A new file is for its owner alone, and so are its journals, which SQLite gives its mode. One that is there is not
    opened: closing it would end the locks that this process has on it. SQLite says what is wrong with a path."""
    with suppress(OSError):
        os.close(os.open(name, os.O_CREAT | os.O_EXCL, 0o600))
