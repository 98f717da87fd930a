"""Groups of loops that one process has found, kept by the state of the verdicts that they were found among."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from app.services.outward import GroupOut

Groups = tuple[GroupOut, ...]
State = tuple[Any, ...]

KEPT = 8
PARTING_S = 5.0
"""So long `close` waits for a search that goes on: a process that is told to stop has not much longer."""


@dataclass(frozen=True)
class Known:
    """Groups, and when they had been found."""

    groups: Groups
    at: datetime


class FoundGroups:
    """Found once for a state of the verdicts: who asks again, for a page or a dashboard, gets the same answer at once,
    and who asks while they are sought waits for that search. One at a time, each in a thread of its own: a page need
    not wait for the end. Safe to use from several threads."""

    def __init__(self) -> None:
        self._found: dict[State, Future[Groups]] = {}
        self._last: Known | None = None
        self._searches: list[threading.Thread] = []
        self._looking = threading.Lock()
        self._one_at_a_time = threading.Lock()
        self._closed = False

    def of(self, state: State, search: Callable[[], Groups]) -> Future[Groups]:
        """The groups of this state, which `search` finds where nobody has begun to."""
        with self._looking:
            if state in self._found:
                return self._found[state]
            while len(self._found) >= KEPT:
                self._found.pop(next(iter(self._found)))
            finding = self._found[state] = Future()
            thread = threading.Thread(target=self._find, args=(state, search, finding), name="groups", daemon=True)
            self._searches = [one for one in self._searches if one.is_alive()] + [thread]
            thread.start()
        return finding

    def only_others_sought(self, state: State) -> bool:
        """Whether those of another state are being sought, and nobody has asked for this one's."""
        with self._looking:
            return state not in self._found and any(not finding.done() for finding in self._found.values())

    @property
    def last(self) -> Known | None:
        """Those that were found last, of whichever state: what there is to show until those of the newest are."""
        with self._looking:
            return self._last

    def close(self, parting_s: float = PARTING_S) -> None:
        """Ends with the search that goes on, or after parting_s seconds; those that wait for their turn are called
        off."""
        with self._looking:
            self._closed = True
            searches = self._searches
        until = time.monotonic() + parting_s
        for search in searches:
            search.join(max(0.0, until - time.monotonic()))

    def _find(self, state: State, search: Callable[[], Groups], finding: Future[Groups]) -> None:
        try:
            with self._one_at_a_time:
                if self._closed:
                    finding.cancel()
                else:
                    found = search()
                    with self._looking:
                        self._last = Known(found, datetime.now(UTC))
                    finding.set_result(found)
        except BaseException as error:  # noqa: BLE001 - whoever waits is told
            with self._looking:
                self._found.pop(state, None)  # and whoever comes next asks anew
            finding.set_exception(error)
