"""Columns of words that may tell the rows of a table apart, as the tag of each does; further down if not in the first
rows."""

from collections.abc import Collection
from itertools import pairwise

import numpy as np
import polars as pl

from app.ingest.columns.clocks import MOST, joined_stamp
from app.ingest.columns.plans import LongPlan, Plan, WidePlan
from app.ingest.files.head import Head, is_number
from app.ingest.model import IngestOptions
from app.ingest.tags.modes import UNKNOWN_MODE, automatic_flags
from app.ingest.tags.quality import holds_quality_words
from app.ingest.times.stamps import NO_TIME, TimeReader


def may_part_rows_below(plan: Plan, head: Head) -> bool:
    """Whether more rows than the first ones are to be asked: the words of a column hardly change in these."""
    if isinstance(plan, LongPlan):
        return bool(plan.signals) and len(set(head.column(plan.tag, plan.first_row))) == 1
    return bool(_word_columns(plan, head))


def _word_columns(plan: WidePlan, head: Head) -> dict[int, list[str]]:
    """By column that is filled with words, not many different ones and no states, those of each row."""
    rows = [row for row in head.rows[plan.first_row :] if any(row)]
    times = {index for group in plan.groups for index in group.time}
    columns = {
        index: [row[index] if index < len(row) else "" for row in rows]
        for index in sorted(set(range(plan.width)) - times)
    }
    return {index: words for index, words in columns.items() if _are_few_words(words, head.decimal_mark)}


def _are_few_words(fields: list[str], decimal_mark: str) -> bool:
    words = set(fields) - {""}
    if fields.count("") > (1 - MOST) * len(fields) or 2 * len(words) > len(fields):
        return False
    return not any(is_number(word, decimal_mark) for word in words) and not are_states(words)


def are_states(words: Collection[str]) -> bool:
    """Whether some are modes or qualities."""
    flags = automatic_flags(pl.Series(sorted(words), dtype=pl.String))
    modes = np.isfinite(flags) & (flags != UNKNOWN_MODE)
    return bool(np.any(modes)) or any(holds_quality_words([word]) for word in words)


def column_that_sorts(plan: WidePlan, head: Head, options: IngestOptions) -> int | None:
    """The column by whose words the rows are sorted before their times: these go back where one word follows another,
    which does not come again, and nowhere else."""
    group = plan.groups[0]
    for index, words in _word_columns(plan, head).items():
        rows = [row for row in head.rows[plan.first_row :] if any(row)]
        stamps = [joined_stamp([row[at] if at < len(row) else "" for at in group.time]) for row in rows]
        time_ns = TimeReader(group.form, options).read(pl.Series(stamps, dtype=pl.String)).tolist()
        timed = [(word, at) for word, at in zip(words, time_ns, strict=True) if at != NO_TIME]
        if _is_sorted_by_words(timed) or _is_sorted_by_words([(word, -at) for word, at in timed]):
            return index
    return None


def _is_sorted_by_words(rows: list[tuple[str, int]]) -> bool:
    changes = [(one, other) for one, other in pairwise(rows) if one[0] != other[0]]
    once = len(changes) + 1 == len({word for word, _ in rows})
    within = all(one[1] <= other[1] for one, other in pairwise(rows) if one[0] == other[0])
    return once and within and any(one[1] > other[1] for one, other in changes)
