"""Ctrl-C is remembered: compiled code, and generators that are let go of, swallow the exception that it raises."""

import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs


ONE_PRESS_S = 1.0  # a key pressed twice in haste, or a terminal and a parent that both pass it on


class _Interrupts:
    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        self.came_at: float | None = None
        self.put_off = False

    def note(self, _signal: int, _frame: FrameType | None) -> None:
        now = time.monotonic()
        if self.came_at is not None and now - self.came_at < ONE_PRESS_S:
            return
        self.came_at = now
        if not self.put_off:
            raise KeyboardInterrupt


_interrupts = _Interrupts()


@contextmanager
def remembered() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt as ever, is known of afterwards, and is not printed where it was swallowed. Once
    it came, the program is about to end: one more ends it at once, and in silence.

    Where it is ignored, as in the background of a script, it stays so.
    """
    _interrupts.forget()
    before, told = signal.getsignal(signal.SIGINT), sys.unraisablehook
    if before is not signal.default_int_handler:
        yield
        return

    def told_but_interrupts(what: "UnraisableHookArgs") -> None:
        if not issubclass(what.exc_type, KeyboardInterrupt):
            told(what)

    signal.signal(signal.SIGINT, _interrupts.note)
    sys.unraisablehook = told_but_interrupts
    try:
        yield
    finally:
        sys.unraisablehook = told
        signal.signal(signal.SIGINT, signal.SIG_DFL if came() else before)


def came() -> bool:
    return _interrupts.came_at is not None


def raise_swallowed() -> None:
    """Raises KeyboardInterrupt where one came that did not end what was done then."""
    if came():
        raise KeyboardInterrupt


@contextmanager
def done_whole() -> Iterator[None]:
    """What is done herein is done to its end; an interrupt that comes meanwhile is raised behind it."""
    _interrupts.put_off = True
    try:
        yield
    finally:
        _interrupts.put_off = False
    raise_swallowed()


@contextmanager
def held_off() -> Iterator[None]:
    """Processes started herein never see Ctrl-C, which goes to the whole terminal: who started them ends them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def ended_in_order(*numbers: signal.Signals) -> Iterator[None]:
    """These signals, SIGTERM where none is named, end what is done herein as an exception, so that who started
    processes ends them; unless one is handled or ignored already, or this is not the thread that is told of signals.
    """
    in_main = threading.current_thread() is threading.main_thread()
    ours = [one for one in numbers or (signal.SIGTERM,) if in_main and signal.getsignal(one) is signal.SIG_DFL]

    def end(number: int, _frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    for one in ours:
        signal.signal(one, end)
    try:
        yield
    finally:
        for one in ours:
            signal.signal(one, signal.SIG_DFL)
