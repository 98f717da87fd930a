"""Bounds for one loop's audit: an alarm that raises, and behind it a watchdog that ends the process."""

import faulthandler
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

WATCHDOG_AFTER = 2.0
"""The watchdog barks after this many time limits: code that does not return to Python cannot hear the alarm."""
RING_AGAIN_S = 0.5


class TimeLimitError(Exception):
    """A loop's audit took longer than it may."""


@contextmanager
def time_limit(seconds: float, *, watchdog: bool) -> Iterator[None]:
    """Raises TimeLimitError in the block after `seconds`, where signals can be had (the main thread).

    watchdog: in a process of its own, ends the process where even that does not help; its claim then runs out.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGALRM, _ring)
    if watchdog:
        faulthandler.dump_traceback_later(WATCHDOG_AFTER * seconds, exit=True, file=sys.__stderr__ or 2)
    # Again and again: what is raised while C code calls back into Python is ignored.
    signal.setitimer(signal.ITIMER_REAL, seconds, RING_AGAIN_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        if watchdog:
            faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGALRM, before)


def _ring(signum: int, frame: FrameType | None) -> None:
    raise TimeLimitError
