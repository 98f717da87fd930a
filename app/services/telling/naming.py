"""Names of loops and files within a sentence: they may hold anything, a line end too, and may be many."""

import re
from collections.abc import Sequence

NAMED = 5
"""So many are named, of others it is told how many there are."""

TURNS = re.compile("[\u202a-\u202e\u2066-\u2069]")
"""Letters that turn the direction of what stands behind them."""


COMMANDS = re.compile(r"[\x00-\x08\x0e-\x1f\x7f-\x84\x86-\x9f]")
"""What shows nothing and parts no words or lines: a terminal on which a text is printed would do what it says."""


def without_commands(text: str) -> str:
    return COMMANDS.sub("", text)


def one_line(text: str) -> str:
    """Without line ends; what turns the direction does so within the name alone, and not of the rest of a sentence."""
    line = " ".join(text.split())
    return f"\u2068{line}\u2069" if TURNS.search(line) else line


def named(names: Sequence[str], count: int | None = None) -> str:
    """ "A, B, C, D, E and 3 more". count: how many there are, where `names` are not all of them."""
    shown = [one_line(name) for name in names[:NAMED]]
    more = (len(names) if count is None else count) - len(shown)
    return f"{', '.join(shown)}{f' and {more} more' if more > 0 else ''}"
