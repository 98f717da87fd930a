"""Long with a row of names: tag, time, value and, where there is one, a quality. Lines above it and * comments are
passed over."""

from app.ingest.columns.names import long_from, mostly_numbers
from app.ingest.columns.of_words import column_that_parts_tags, refuse_to_mix
from app.ingest.columns.plans import LongPlan
from app.ingest.files.head import PREAMBLE_ROWS, Head
from app.ingest.model import IngestOptions


def sniff(head: Head, options: IngestOptions) -> LongPlan | None:
    for index, written in enumerate(head.rows[:PREAMBLE_ROWS]):
        names = _without_table(written)
        if len(names) >= 3:
            plan = long_from(head, "long", names, index + 1, options)
            if plan is not None and (names == written or _has_words(head, plan)):
                refuse_to_mix(names, column_that_parts_tags(plan, head))
                return plan
    return None


def _has_words(head: Head, plan: LongPlan) -> bool:
    """Whether its tags are words: a loop may have signals called so, and stand before their names as a table does."""
    return not mostly_numbers(head.column(plan.tag, plan.first_row), head.decimal_mark)


def _without_table(names: tuple[str, ...]) -> tuple[str, ...]:
    """As a query may name its columns: picomp2.tag, picomp2.time."""
    tables = {name.rpartition(".")[0] for name in names if name}
    return tuple(name.rpartition(".")[2] for name in names) if len(tables) == 1 else names
