"""A heading whose quoted names hold line ends, as spreadsheets write wrapped cells, made one line."""

from dataclasses import dataclass
from itertools import pairwise
from typing import AnyStr

from app.ingest.files.head import HEAD_ROWS, PREAMBLE_ROWS, find_delimiter, split_line

MOST_LINES = 1 << 16


@dataclass(frozen=True)
class Heading:
    """The first `count` lines of a file made anew, as many lines as they were; no lines where nothing is broken."""

    count: int
    text: str


NOTHING_BROKEN = Heading(0, "")


def whole_heading(head: str) -> Heading:
    """The row of names in one line where it was broken inside quotes, empty lines before it: line numbers stay.

    It is a row of names, and not rows of data with quotes left open, where it has as many fields as the rows behind it
    and none of the lines it was broken into has.
    """
    lines = head.split("\n", MOST_LINES)[:-1]
    odd = [i for i, line in enumerate(lines) if line.count('"') % 2]
    pairs = ((first, last) for first, last in pairwise(odd) if first < PREAMBLE_ROWS)
    return next((heading for first, last in pairs if (heading := _joined(lines, first, last)).count), NOTHING_BROKEN)


def _joined(lines: list[str], first: int, last: int) -> Heading:
    """With one line in place of those from `first` to `last`, where it is a row of names: the quote that the first one
    leaves open may be a title's."""
    following = [line for line in lines[last + 1 : last + 1 + HEAD_ROWS] if line.strip()]
    if not following:
        return NOTHING_BROKEN
    delimiter = find_delimiter(following)
    broken, names = lines[first : last + 1], " ".join(lines[first : last + 1])
    width = len(split_line(following[len(following) // 2], delimiter))
    whole = len(split_line(names, delimiter)) == width > 1 and _goes_on(broken[0], broken[-1], delimiter)
    if not whole or any(line.count(delimiter) >= width - 1 for line in broken[1:]):
        return NOTHING_BROKEN
    return Heading(last + 1, "\n".join([*lines[:first], *[""] * (last - first), names]) + "\n")


def _goes_on(first: str, last: str, delimiter: str) -> bool:
    """Whether the first line opens a quote where a field begins, and the last one closes it where a field ends."""
    opened, closed = first.replace('""', "").rpartition('"')[0], last.replace('""', "").partition('"')[2]
    return (not opened or opened.endswith(delimiter)) and (not closed or closed.startswith(delimiter))


def after_lines(text: AnyStr, count: int) -> AnyStr:
    """What follows the first `count` lines."""
    end = 0
    for _ in range(count):
        end = text.find("\n" if isinstance(text, str) else b"\n", end) + 1
    return text[end:]
