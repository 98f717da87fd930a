"""Which column of a long table has the words of states beside the numbers of the values, as PI's svalue."""

from dataclasses import replace

from app.ingest.columns.names import name_at
from app.ingest.columns.plain_names import plain
from app.ingest.columns.plans import LongPlan
from app.ingest.files.head import Head, is_number
from app.ingest.numbers.no_data import NO_WORD

_NAMES = ("svalue", "stringvalue", "strvalue", "valuestring", "textvalue", "digstring", "digitalstate")
_OF_NUMBERS_TOO = "vvalue"
"""AVEVA has all values there once more, as text."""


def with_state_column(plan: LongPlan, head: Head) -> LongPlan:
    """The plan with it, where a row has one value."""
    if plan.signals or not plan.first_row:
        return plan
    row = head.row(plan.first_row - 1)
    names = {plain(name_at(row, index)): index for index in sorted(set(range(plan.width)) - plan.read, reverse=True)}
    found = next((names[name] for name in _NAMES if name in names), None)
    if found is None and _OF_NUMBERS_TOO in names and _has_words(head, plan, names[_OF_NUMBERS_TOO]):
        found = names[_OF_NUMBERS_TOO]
    return plan if found is None else replace(plan, state=found)


def _has_words(head: Head, plan: LongPlan, column: int) -> bool:
    fields = head.column(column, plan.first_row)
    return any(field.lower() not in NO_WORD and not is_number(field, head.decimal_mark) for field in fields)
