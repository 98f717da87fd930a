"""After how many fields a row may end, because what it leaves out was empty or is not read."""

from collections import Counter
from dataclasses import replace

from app.ingest.columns.names import mostly_numbers
from app.ingest.columns.plans import Plan, WidePlan
from app.ingest.files.head import Head

_SOME_ROWS, _SOME_SHARE = 3, 0.1


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
    for end in range(plan.width - 1, _least(plan) - 1, -1):
        if end in read:
            seldom = False
            if 2 * sum(not row[end] for row in full) <= len(full):
                break
        elif mostly_numbers(head.column(end, plan.first_row), head.decimal_mark):
            break
        if seldom or counts[end] >= often:
            ends.add(end)
    return replace(plan, ends=frozenset(ends))


def _least(plan: Plan) -> int:
    """The fewest fields that a row has: as far as its times and the first of its values."""
    if isinstance(plan, WidePlan):
        return 1 + max(max(*group.time, *(value.index for value in group.values[:1])) for group in plan.groups)
    return 1 + max(plan.tag, plan.value, *plan.time)
