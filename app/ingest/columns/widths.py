"""How many fields a row should have, and files whose rows have more fields than names."""

import re
from collections import Counter
from itertools import pairwise

from app.errors import DataError
from app.ingest.files.head import Head, is_number
from app.ingest.tags.grouping import place

_DIGITS = re.compile(r"-?\d+")
_DECIMALS = re.compile(r"0\d+")
_UNSIGNED, _MOST_DIGITS = re.compile(r"\d+"), 9
PARTED = ("PV", "OP", "SP")


def usual_width(head: Head, first_row: int) -> int:
    counts = Counter(len(row) for row in head.rows[first_row:] if any(row))
    return counts.most_common(1)[0][0] if counts else 0


def named_width(head: Head, names: tuple[str, ...], first_row: int, time: tuple[int, ...] = ()) -> int:
    """Of rows under a row of names: a row that has something behind the last name may have it anywhere, its fields are
    not those of the names. In cells, instead of text, nothing is moved, and neither is it where the row of names has
    empty ones to the end of the rows and decimals have points. time: columns of times, which may stand last under an
    empty name.

    Raises DataError("more_fields_than_names") where most rows are so.
    """
    rows = [row for row in head.rows[first_row:] if any(row)]
    width = max(usual_width(head, first_row), len(names))
    begin = head.rows.index(names) if names in head.rows[:first_row] else first_row
    heading = (names, *head.rows[begin:first_row])  # units or descriptions may stand below an empty name
    named = max((index + 1 for row in heading for index, name in enumerate(row[: len(names)]) if name), default=0)
    named = max(named, *(index + 1 for index in time if index < len(names)), 0)
    over = [] if head.typed else [row for row in rows if any(row[named:])]
    if 2 * len(over) > len(rows):
        parted = _parts_decimals(head, names, over)
        if _have_cells_in_names(head, names, over) and not parted:
            return len(names)
        raise _more_fields(head, named, over, parted=parted)
    return named if over else width


def _have_cells_in_names(head: Head, names: tuple[str, ...], over: list[tuple[str, ...]]) -> bool:
    """Whether each field has a name, be it an empty one, and none is the decimals of another."""
    whole = head.delimiter != "," or 2 * sum(any(map(_has_point, row)) for row in over) > len(over)
    return whole and all(len(row) == len(names) for row in over)


def _parts_decimals(head: Head, names: tuple[str, ...], over: list[tuple[str, ...]]) -> bool:
    """Whether decimals of a signal stand in the field behind it, though those of others have points: whole numbers, and
    behind them digits as of decimals alone."""
    if head.delimiter != ",":
        return False
    signals = [at for at, name in enumerate(names[:-1]) if _is_parted(name)]
    return any(_are_parted(names, over, at) for at in signals)


def _are_parted(names: tuple[str, ...], over: list[tuple[str, ...]], at: int) -> bool:
    """Whether those of a column stand in the next one: if that is a signal's, its own values stand behind them."""
    whole, behind = [row[at] for row in over], [row[at + 1] for row in over]
    is_signal = _is_parted(names[at + 1])
    if is_signal and not all(is_number(row[at + 2]) for row in over if row[at + 2]):
        return False
    return _are_decimals_of(whole, behind, of_signal=is_signal)


def _is_parted(name: str) -> bool:
    return bool(name) and place(name, "").signal in PARTED


def _are_decimals_of(whole: list[str], behind: list[str], *, of_signal: bool) -> bool:
    """With a nought before them, or of one digit, of which nearly all are there. of_signal: whether a signal's name is
    above them, whose numbers have no nought before them. Below another one, or none, may be a step or a code such as
    07: decimals change with the numbers before them."""
    if not all(map(_DIGITS.fullmatch, whole)) or not all(map(_UNSIGNED.fullmatch, behind)):
        return False
    each = set(behind)
    with_nought = any(map(_DECIMALS.fullmatch, each))
    if with_nought and of_signal:
        return True
    return (with_nought or (max(map(len, each)) == 1 and len(each) >= _MOST_DIGITS)) and _change_with(whole, behind)


def _change_with(whole: list[str], behind: list[str]) -> bool:
    """Whether what stands behind is another in most rows in which the number before it is; not where none ever is."""
    rows = list(zip(whole, behind, strict=True))
    changed = [one[1] != other[1] for one, other in pairwise(rows) if one[0] != other[0]]
    return 2 * sum(changed) > len(changed)


def _has_point(text: str) -> bool:
    return "." in text and is_number(text)


def refuse_parted_decimals(head: Head, value: int) -> None:
    """Raises DataError("more_fields_than_names") where, without a row of names, what stands behind the values of
    a column can only be their decimals, as 07 of 50,07."""
    behind = head.column(value + 1, 0)
    whole = all(_DIGITS.fullmatch(text) for text in (*head.column(value, 0), *behind))
    if head.delimiter == "," and whole and any(_DECIMALS.fullmatch(text) for text in behind):
        raise DataError("more_fields_than_names", f"the rows have decimals in a field of their own; {_REMEDY}")


_REMEDY = (
    "it looks like decimal commas between fields that commas part: export it with decimal points, with semicolons or "
    "tabs between the fields, or with its fields in quotes"
)


def _more_fields(head: Head, named: int, over: list[tuple[str, ...]], *, parted: bool) -> DataError:
    """The row of which it is told is the first one. parted: whether decimals are known to stand in their own fields."""
    digits = parted or all(_DIGITS.fullmatch(text) or not is_number(text) for row in over for text in row)
    why = f"; {_REMEDY}" if head.delimiter == "," and digits else "; which field belongs to which name is not told"
    found = f"{len(over[0])} fields ({head.delimiter.join(over[0])[:80]!r}) below {named} names"
    return DataError("more_fields_than_names", f"most rows have more fields than there are names: {found}{why}")
