"""Names of loops and files within a sentence: they may hold anything, a line end too, and may be many."""

import re
from collections.abc import Sequence

NAMED = 5
"""So many are named, of others it is told how many there are."""


COMMANDS = re.compile(r"[\x00-\x08\x0e-\x1f\x7f-\x84\x86-\x9f]")
"""What shows nothing and parts no words or lines: a terminal on which a text is printed would do what it says."""


def without_commands(text: str) -> str:
    return COMMANDS.sub("", text)


def one_line(text: str) -> str:
    return " ".join(text.split())


def named(names: Sequence[str], count: int | None = None) -> str:
    """ "A, B, C, D, E and 3 more". count: how many there are, where `names` are not all of them."""
    shown = [one_line(name) for name in names[:NAMED]]
    more = (len(names) if count is None else count) - len(shown)
    return f"{', '.join(shown)}{f' and {more} more' if more > 0 else ''}"
