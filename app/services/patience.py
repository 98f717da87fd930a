"""Waits for a database that is away, so that its restart costs a worker seconds and not the work in its hands."""

import logging
import time
from collections.abc import Callable
from typing import TypeVar

from app.services.database_errors import DATABASE_AWAY, no_room

FIRST_PAUSE_S = 0.1
LONGEST_PAUSE_S = 5.0

T = TypeVar("T")

log = logging.getLogger("loopaudit.patience")


def patiently(action: Callable[[], T], at_most_s: float) -> T:
    """What `action` returns, tried again with growing pauses while the database is away; then its exception. A disk
    that is full is not waited for: that may last for days, and whoever is here has to give back what it holds.

    `action` is one transaction, or only reads: done twice it must have the effect of once, because a connection that
    breaks during the commit does not tell whether it was committed.
    """
    until, pause_s = time.monotonic() + at_most_s, FIRST_PAUSE_S
    while True:
        try:
            return action()
        except DATABASE_AWAY as error:
            if no_room(error) or time.monotonic() + pause_s > until:
                raise
            log.warning("database away, trying again in %.1f s: %s", pause_s, type(error).__name__)
        time.sleep(pause_s)
        pause_s = min(2 * pause_s, LONGEST_PAUSE_S)
