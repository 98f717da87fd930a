"""Long with a row of names: tag, time, value and, where there is one, a quality. Lines above it and * comments are
passed over."""

from app.ingest.columns.names import mostly_numbers
from app.ingest.columns.of_words import column_that_parts_tags, refuse_to_mix
from app.ingest.columns.plans import LongPlan
from app.ingest.columns.plans_by_names import long_from
from app.ingest.files.head import PREAMBLE_ROWS, Head
from app.ingest.model import IngestOptions
from app.ingest.tags.grouping import place


def sniff(head: Head, options: IngestOptions) -> LongPlan | None:
    for index, written in enumerate(head.rows[:PREAMBLE_ROWS]):
        names = _without_table(written)
        if len(names) >= 3:
            plan = long_from(head, "long", names, index + 1, options)
            if plan is not None and (names == written or _is_table(head, plan, written)):
                refuse_to_mix(names, column_that_parts_tags(plan, head))
                return plan
    return None


def _is_table(head: Head, plan: LongPlan, names: tuple[str, ...]) -> bool:
    """Whether a table stands before all names, and no loop: that has signals, or numbers where the table has tags."""
    if any(place(name, "").signal != "OTHER" for name in names):
        return False
    return not mostly_numbers(head.column(plan.tag, plan.first_row), head.decimal_mark)


def _without_table(names: tuple[str, ...]) -> tuple[str, ...]:
    """As a query may name its columns: picomp2.tag, picomp2.time."""
    tables = {name.rpartition(".")[0] for name in names if name}
    return tuple(name.rpartition(".")[2] for name in names) if len(tables) == 1 else names
