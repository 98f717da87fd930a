"""Ctrl-C is remembered: compiled code, and generators that are let go of, swallow the exception that it raises."""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs


class _Interrupts:
    def __init__(self) -> None:
        self.came = False
        self.put_off = False

    def note(self, _signal: int, _frame: FrameType | None) -> None:
        self.came = True
        if not self.put_off:
            raise KeyboardInterrupt


_interrupts = _Interrupts()


@contextmanager
def remembered() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt as ever, is known of afterwards, and is not printed where it was swallowed.

    Where it is ignored, as in the background of a script, it stays so.
    """
    _interrupts.came = _interrupts.put_off = False
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
        signal.signal(signal.SIGINT, before)


def came() -> bool:
    return _interrupts.came


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
