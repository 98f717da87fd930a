"""Names of loops and files within a sentence: they may hold anything, a line end too, and may be many."""

from collections.abc import Sequence

NAMED = 5
"""So many are named, of others it is told how many there are."""


def one_line(text: str) -> str:
    return " ".join(text.split())


def named(names: Sequence[str], count: int | None = None) -> str:
    """ "A, B, C, D, E and 3 more". count: how many there are, where `names` are not all of them."""
    shown = [one_line(name) for name in names[:NAMED]]
    more = (len(names) if count is None else count) - len(shown)
    return f"{', '.join(shown)}{f' and {more} more' if more > 0 else ''}"
