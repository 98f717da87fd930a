"""What a command says while it compiles the engine: at the first start of a version it computes nothing for minutes."""

from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.synchronize import Lock

from app import kernel_cache
from app.cli.messages import say

AT_FIRST = "loopaudit: compiling the engine; at the first start of a version this takes a minute or two"


class _Told:
    """here: by this process. by_one: held by the one of several processes that says it; None: there is no other."""

    here = False
    by_one: Lock | None = None


def told_by_one(lock: Lock) -> None:
    """In each of several processes with the same lock: the first of them that compiles says so, and the others not."""
    _Told.by_one = lock


@contextmanager
def compiling_told() -> Iterator[None]:
    """In here it is said on stderr when something has to be compiled, once in a command."""
    with kernel_cache.told_of_compiling(_say):
        yield


def _say() -> None:
    if not _Told.here and (_Told.by_one is None or _Told.by_one.acquire(block=False)):
        say(AT_FIRST)
    _Told.here = True
