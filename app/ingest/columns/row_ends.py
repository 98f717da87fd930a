"""After how many fields a row may end, because what it leaves out was empty or is not read."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.ingest.columns.names import mostly_numbers
from app.ingest.columns.plain_names import plain
from app.ingest.columns.plans import LongPlan, Plan, WidePlan
from app.ingest.files.head import Head, is_number
from app.ingest.model import FloatArray
from app.ingest.numbers.units import as_number

Rows = Sequence[tuple[str, ...]]
_SOME_ROWS, _SOME_SHARE = 3, 0.1
_REMARKS = frozenset(("comment", "comments", "remark", "remarks", "kommentar", "bemerkung", "commentaire"))


def with_ends(plan: Plan, head: Head) -> Plan:
    """The plan with what a row may leave out, but for its times and its first values.

    A column that is read may stay out where most full rows are empty there, and so many rows leave it out that it was
    no accident: a spreadsheet leaves out what is empty behind the last cell of sixteen rows. One that is not read may
    always, unless it has numbers: of a row that lost another field, one of them would be taken for a value.
    """
    if head.typed:
        return plan
    rows = [row for row in head.rows[plan.first_row :] if any(row)]
    counts = Counter(map(len, rows))
    often = max(_SOME_ROWS, _SOME_SHARE * counts.total())
    full = [row for row in rows if len(row) >= plan.width]
    read, ends, seldom = plan.read, set(plan.ends), True
    if not full and isinstance(plan, WidePlan) and _end_before_remarks(plan, rows, head):
        ends.add(plan.width - 1)
    if isinstance(plan, LongPlan) and not plan.signals:
        ends.update(end for end in range(_least(plan), plan.width) if counts[end] >= often)
    for end in range(plan.width - 1, _least(plan) - 1, -1):
        if end in read:
            seldom = False
            if 2 * sum(not row[end] for row in full) <= len(full) and not _is_left_out(end, rows, full, plan, head):
                break
        elif mostly_numbers(head.column(end, plan.first_row), head.decimal_mark):
            break
        if seldom or counts[end] >= often:
            ends.add(end)
    return replace(plan, ends=frozenset(ends))


def _end_before_remarks(plan: WidePlan, rows: Rows, head: Head) -> bool:
    """Whether all rows end before the last name, which is that of remarks, and lost no other field: the last one is not
    empty all along, as remarks are, nothing else stands where values are, and these are not parted at decimal commas,
    as where commas part whole numbers alone."""
    last = plan.width - 1
    named = len(plan.names) > last and plain(plan.names[last]) in _REMARKS
    if not named or any(len(row) != last for row in rows) or not any(row[-1] for row in rows):
        return False
    values = [value.index for group in plan.groups for value in group.values if value.index != last]
    told = head.delimiter != "," or head.marks_told
    return told and all(is_number(row[at], head.decimal_mark) for row in rows for at in values if row[at])


def _is_left_out(end: int, rows: Rows, full: Rows, plan: Plan, head: Head) -> bool:
    """Whether rows that end there leave out what stands in full ones, and lost nothing else: most rows do, or words are
    left out, and what stands before is as large as in full rows."""
    short = [row for row in rows if len(row) == end]
    words = not mostly_numbers(head.column(end, plan.first_row), head.decimal_mark)
    if len(full) < _SOME_ROWS or not (2 * len(short) >= len(rows) or words):
        return False
    return all(_are_alike(_numbers(short, at, head), _numbers(full, at, head)) for at in plan.read if at and at < end)


def _numbers(rows: Rows, column: int, head: Head) -> FloatArray:
    texts = (row[column] for row in rows)
    return np.array([as_number(text) for text in texts if is_number(text, head.decimal_mark)])


def _are_alike(short: FloatArray, full: FloatArray) -> bool:
    """Whether those of rows that end early lie about where those of full rows do; words stand in both or in none."""
    if not len(short) or not len(full):
        return len(short) == len(full)
    low, high = float(full.min()), float(full.max())
    return low - (high - low) <= float(np.median(short)) <= high + (high - low)


def _least(plan: Plan) -> int:
    """The fewest fields that a row has: as far as its times and the first of its values."""
    if isinstance(plan, WidePlan):
        return 1 + max(max(*group.time, *(value.index for value in group.values[:1])) for group in plan.groups)
    return 1 + max(plan.tag, plan.value, *plan.time)
