"""What rows from further down a file may tell that its first ones do not: one may be of a single tag or loop alone."""

from app.ingest.columns.names import mostly_signals
from app.ingest.columns.of_loops import OF_ANYTHING
from app.ingest.columns.of_words import word_columns
from app.ingest.columns.plain_names import plain
from app.ingest.columns.plans import LongPlan, Plan
from app.ingest.files.head import Head


def may_part_rows_below(plan: Plan, head: Head) -> bool:
    """Whether more rows than the first ones are to be asked: the words of a column hardly change in these, and it may
    be one of tags or loops, or one of batches that was taken for them."""
    if not isinstance(plan, LongPlan):
        return bool(word_columns(plan, head))
    words = head.column(plan.tag, plan.first_row)
    return _may_be_batches(plan, head) and len(set(words)) == 1 if plan.signals else mostly_signals(words)


def _may_be_batches(plan: LongPlan, head: Head) -> bool:
    names = head.row(plan.first_row - 1)
    return plan.tag < len(names) and plain(names[plan.tag]) in OF_ANYTHING


def tells_more(found: Plan, plan: Plan) -> bool:
    """Whether the plan by more rows has a column of tags or loops that the one by the first rows lacks, or lacks one
    that was of batches."""
    if isinstance(plan, LongPlan) and plan.signals:
        return not isinstance(found, LongPlan) or found.tag != plan.tag
    return isinstance(found, LongPlan) and (not isinstance(plan, LongPlan) or found.tag != plan.tag)
