"""Compiles the kernels of an audit, or loads them: a first audit otherwise pays for it out of its loop's time limit."""

from collections.abc import Callable

from app import kernel_cache
from app.engine.compiling import audits, identifications, verdicts

__all__ = ["audits", "identifications", "verdicts", "warm_up"]


def warm_up(deadline_s: float | None = None, waits: Callable[[], None] | None = None) -> None:
    """Of several processes that would compile for one cache, the first does; deadline_s, waits: of who waits for it, as
    in `kernel_cache.one_at_a_time`."""
    with kernel_cache.one_at_a_time(deadline_s, waits):
        audits()
