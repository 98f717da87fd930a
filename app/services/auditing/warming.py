"""Compiles the kernels of an audit, or loads them: a first audit otherwise pays for it out of its loop's time limit."""

from app import kernel_cache
from app.engine.compiling import audits, identifications, verdicts

__all__ = ["audits", "identifications", "verdicts", "warm_up"]


def warm_up() -> None:
    """Of several processes that would compile for one cache, the first does."""
    with kernel_cache.one_at_a_time():
        audits()
