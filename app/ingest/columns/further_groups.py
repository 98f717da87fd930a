"""Rows of a table of a tag a row that hold further tags with values of their own: Time,Tag,Value,Tag,Value."""

from collections.abc import Iterator

import numpy as np

from app.errors import DataError
from app.ingest.columns.names import mostly_signals, name_at, numbers_of
from app.ingest.columns.plain_names import plain
from app.ingest.columns.plans import LongPlan
from app.ingest.files.head import Head

_MOST_BETWEEN = 3  # columns from that of a tag to that of its value: date and clock stand between them


def refuse_further_groups(plan: LongPlan, head: Head) -> None:
    """Raises DataError("unknown_layout") where a row holds a further tag with a value: that would be lost."""
    if plan.has_signals:
        return
    left = [at for at in range(plan.width) if at not in plan.read and head.column(at, plan.first_row)]
    further = next(_named(plan, head, left) if plan.first_row else _without_names(head, left), None)
    if further is not None:
        tag, value = further
        shown = next(((row[tag], row[value]) for row in head.rows[plan.first_row :] if len(row) > value), ("", ""))
        raise DataError(
            "unknown_layout",
            f"a row holds several tags, each with a value: columns {tag + 1} and {value + 1} have a further one "
            f"({shown[0][:60]!r}, {shown[1][:60]!r}); needed is a row a value of one tag, or a column a tag",
        )


def _named(plan: LongPlan, head: Head, left: list[int]) -> Iterator[tuple[int, int]]:
    """Columns that are called as those of tags and of values are."""
    names = head.row(plan.first_row - 1)

    def called_as(column: int) -> list[int]:
        name = plain(name_at(names, column))
        return [at for at in left if name and plain(name_at(names, at)) == name]

    values = called_as(plan.value)
    tags = [at for key in plan.keys for at in called_as(key)]
    yield from ((tag, value) for tag in tags for value in values if value > tag)


def _without_names(head: Head, left: list[int]) -> Iterator[tuple[int, int]]:
    """Columns of signals with one of numbers behind, or behind their times, that move and have fractions: no codes."""
    for place, tag in enumerate(left):
        if not mostly_signals(head.column(tag, 0)):
            continue
        for value in left[place + 1 : place + 1 + _MOST_BETWEEN]:
            numbers = numbers_of(head, value, 0)
            known = numbers[np.isfinite(numbers)]
            if 2 * len(known) > len(numbers) and np.any(known % 1) and np.ptp(known):
                yield tag, value
