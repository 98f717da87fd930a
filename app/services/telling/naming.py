"""How a sentence begins, and names of loops and files within it: they may hold anything, a line end too, and may be
many."""

import re
from collections.abc import Sequence

NAMED = 5
"""So many are named, of others it is told how many there are."""

ISOLATE, END = "\u2068", "\u2069"
OPENS = frozenset("\u2066\u2067\u2068")

TURNING = (
    "\u0590-\u08ff\u200f\u202a-\u202e\u2066-\u2069\ufb1d-\ufdff\ufe70-\ufefc\U00010800-\U00010fff\U0001e800-\U0001efff"
)
"""Letters that are read from the right, and those that turn the direction of what stands behind them: what is put
between brackets of a pattern."""
TURNS = re.compile(f"[{TURNING}]")
_WORD = rf"[^\s,;(){TURNING}]*[{TURNING}][^\s,;()]*"
TURNED_WORDS = re.compile(rf"{_WORD}(?:\s+{_WORD})*(?<![:.])")


COMMANDS = re.compile(r"[\x00-\x08\x0e-\x1f\x7f-\x84\x86-\x9f]")
"""What shows nothing and parts no words or lines: a terminal on which a text is printed would do what it says."""


def without_commands(text: str) -> str:
    return COMMANDS.sub("", text)


def one_line(text: str) -> str:
    """Without line ends; what turns the direction does so within the name alone, and not of the rest of a sentence."""
    line = " ".join(text.split())
    return _alone(line) if TURNS.search(line) else line


def isolated(sentence: str) -> str:
    """The same of a sentence that is kept with names in it, of which it is not known where they begin."""
    return TURNED_WORDS.sub(lambda found: _alone(found[0]), sentence)


def _alone(name: str) -> str:
    """Isolated from what is around it. A name that ends more isolates than it opens would end ours, and one that opens
    more would be ended in its place by our end."""
    opened = ended = 0
    for letter in name:
        if letter in OPENS:
            opened += 1
        elif letter == END and opened:
            opened -= 1
        elif letter == END:
            ended += 1
    return f"{ISOLATE * (1 + ended)}{name}{END * (1 + opened)}"


def with_capital(text: str) -> str:
    """As a sentence begins; `capitalize`, of Jinja too, makes all other letters small."""
    return text[:1].upper() + text[1:]


def named(names: Sequence[str], count: int | None = None) -> str:
    """ "A, B, C, D, E and 3 more". count: how many there are, where `names` are not all of them."""
    shown = [one_line(name) for name in names[:NAMED]]
    more = (len(names) if count is None else count) - len(shown)
    return f"{', '.join(shown)}{f' and {more:,} more' if more > 0 else ''}"
