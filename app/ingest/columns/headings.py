"""What stands between the names of a table and its first row with a time: heading, which is told, or rows of data with
a time that cannot be read, which are refused as anywhere else."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from app.ingest.files.head import Head, is_number
from app.ingest.numbers.units import is_unit
from app.ingest.telling import first_of

COMMENTS = ("*", "#", "[")
_NO_UNIT = frozenset(("-", "1"))  # of what has none
_MOST_NUMBERS, _MOST_CHARACTERS = 5, 60


@dataclass(frozen=True)
class BelowNames:
    """The first row of data, whatever its time is, and the rows of the heading above it."""

    first_row: int
    heading: tuple[int, ...]


def below_names(head: Head, names: Collection[int], first_row: int, values: Collection[int]) -> BelowNames:
    """first_row: the first one with a time. names: the rows of names. values: the columns of values."""
    below = [at for at in range(min(names) + 1, first_row) if at not in names]
    first = next((at for at in below if at > max(names) and is_data(head, at, values)), first_row)
    return BelowNames(first, tuple(at for at in below if at < first and any(head.row(at))))


def is_data(head: Head, at: int, values: Collection[int]) -> bool:
    """Whether a row is one of data by what stands in its columns of values; units may have a 1 among them."""
    row = head.row(at)
    if _is_comment(row):
        return False
    if not head.typed and head.lines[at].count('"') % 2:
        return True
    cells = [row[index] for index in values if index < len(row) and row[index]]
    others = [text for text in cells if not is_number(text, head.decimal_mark)]
    return len(others) < len(cells) and not (others and all(map(is_unit, others)))


def begins_with_data(head: Head, first_row: int, values: Collection[int], start: int = 0) -> bool:
    """Whether all that stands above the first row with a time are rows of data, or comments that end before the values:
    nothing of it names anything. start: the first row that is looked at."""
    above = [at for at in range(start, max(first_row, 0)) if any(head.row(at))]
    return first_row >= 0 and all(is_data(head, at, values) or _is_aside(head.row(at), values) for at in above)


def heading_notes(head: Head, heading: Iterable[int]) -> tuple[str, ...]:
    """Which lines were read as what."""
    lines: dict[str, list[int]] = {}
    for at in heading:
        lines.setdefault(_kind(head.row(at)), []).append(at)
    return tuple(_told(head, kind, rows) for kind, rows in lines.items())


def units_in(head: Head, heading: Iterable[int]) -> dict[int, str]:
    """By column, of the rows that are units."""
    rows = [head.row(at) for at in heading if _kind(head.row(at)) == "units"]
    return {column: cell for row in reversed(rows) for column, cell in enumerate(row) if is_unit(cell)}


def _told(head: Head, kind: str, rows: list[int]) -> str:
    numbers = first_of([str(head.in_file(at) + head.first_line) for at in rows], _MOST_NUMBERS)
    which = f"line {numbers} was" if len(rows) == 1 else f"lines {numbers} were"
    text = ", ".join(head.row(rows[0]))
    return f"{which} read as {kind}, not as data: {text[:_MOST_CHARACTERS]!r}"


def _kind(row: tuple[str, ...]) -> str:
    if _is_comment(row):
        return "comment"
    cells = [text for text in row[1:] if text and text not in _NO_UNIT]
    return "units" if cells and all(map(is_unit, cells)) else "heading"


def _is_aside(row: tuple[str, ...], values: Collection[int]) -> bool:
    return _is_comment(row) and len(row) <= min(values)


def _is_comment(row: tuple[str, ...]) -> bool:
    return bool(row) and row[0].startswith(COMMENTS)
