"""Which column of a long table has the units of its values, row by row."""

from dataclasses import replace

from app.ingest.columns.plain_names import plain
from app.ingest.columns.plans import LongPlan
from app.ingest.files.head import Head
from app.ingest.numbers.units import is_unit

_NAMES = frozenset(
    ("uom", "unitofmeasure", "engunits", "engunit", "engineeringunits", "engineeringunit", "eu", "units", "valueunit")
)


def with_unit_column(plan: LongPlan, head: Head) -> LongPlan:
    """The plan with it, where a row has one value: it is called so, or most of what differs there are units."""
    if plan.has_signals:
        return plan
    names = head.row(plan.first_row - 1) if plan.first_row else ()
    for index in sorted(set(range(plan.width)) - plan.read):
        words = set(head.column(index, plan.first_row))
        named = index < len(names) and plain(names[index]) in _NAMES
        if words and (named or 2 * sum(map(is_unit, words)) > len(words)):
            return replace(plan, unit=index)
    return plan
