"""Columns of words that may tell the rows of a table apart, as the tag of each does; further down if not in the first
rows."""

from collections.abc import Collection, Iterable
from itertools import pairwise

import numpy as np
import polars as pl

from app.errors import DataError
from app.ingest.columns.clocks import MOST, joined_stamp
from app.ingest.columns.plans import LongPlan, WidePlan
from app.ingest.files.head import Head, is_number
from app.ingest.model import IngestOptions
from app.ingest.tags.grouping import place
from app.ingest.tags.modes import UNKNOWN_MODE, automatic_flags
from app.ingest.tags.quality import holds_quality_words
from app.ingest.times.half_clock import HOUR_NS
from app.ingest.times.stamps import NO_TIME, TimeReader

_ALL = 0.98  # of the rows, at least


def word_columns(plan: WidePlan, head: Head) -> dict[int, list[str]]:
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
    return not any(is_number(word, decimal_mark) for word in words) and not states_among(words)


def states_among(words: Collection[str]) -> set[str]:
    """Those that are modes or qualities."""
    different = sorted(set(words))
    flags = automatic_flags(pl.Series(different, dtype=pl.String))
    modes = np.isfinite(flags) & (flags != UNKNOWN_MODE)
    return {word for word, is_mode in zip(different, modes, strict=True) if is_mode or holds_quality_words([word])}


def column_that_sorts(plan: WidePlan, head: Head, options: IngestOptions) -> int | None:
    """The column by whose words the rows are sorted before their times: these go back where one word follows another,
    which does not come again, and nowhere else; and the words have rows of the same times."""
    group = plan.groups[0]
    for index, words in word_columns(plan, head).items():
        rows = [row for row in head.rows[plan.first_row :] if any(row)]
        stamps = [joined_stamp([row[at] if at < len(row) else "" for at in group.time]) for row in rows]
        time_ns = TimeReader(group.form, options).read(pl.Series(stamps, dtype=pl.String)).tolist()
        timed = [(word, at) for word, at in zip(words, time_ns, strict=True) if at != NO_TIME]
        turned = [(word, -at) for word, at in timed]
        if _is_sorted_by_words(timed, head.sampled) or _is_sorted_by_words(turned, head.sampled):
            return index
    return None


def _is_sorted_by_words(rows: list[tuple[str, int]], sampled: bool) -> bool:
    changes = [(one, other) for one, other in pairwise(rows) if one[0] != other[0]]
    once = len(changes) + 1 == len({word for word, _ in rows})
    within = all(one[1] <= other[1] for one, other in pairwise(rows) if one[0] == other[0])
    longest = max((other[1] - one[1] for one, other in pairwise(rows) if one[0] == other[0]), default=0)
    back = [
        (one[0], other[0])
        for one, other in changes
        if one[1] > other[1] and not _is_hour_of_autumn(one[1] - other[1], longest)
    ]
    times = times_by_word(rows)
    return once and within and any(_have_same(times[one], times[other], sampled) for one, other in back)


def column_that_parts_signals(plan: LongPlan, head: Head) -> int | None:
    """Where tags are words of signals alone, the column whose words tell their rows of one time apart: it has loops."""
    of_key = (plan.tag, *plan.time)
    rows = [row for row in head.rows[plan.first_row :] if len(row) > max(of_key) and all(row[at] for at in of_key)]
    keys = [tuple(row[at] for at in of_key) for row in rows]
    places = [place(tag, "") for tag in {row[plan.tag] for row in rows}]
    if len(set(keys)) > MOST * len(keys) or any(at.loop or at.signal == "OTHER" for at in places):
        return None
    for index in sorted(set(range(plan.width)) - plan.read):
        words = [row[index] if index < len(row) else "" for row in rows]
        if _are_few_words(words, head.decimal_mark) and len(set(zip(keys, words, strict=True))) >= _ALL * len(keys):
            return index
    return None


def refuse_to_mix(names: tuple[str, ...], column: int | None) -> None:
    """Raises DataError("unknown_layout") where there is a column that tells rows of one time apart and is not read."""
    if column is None:
        return
    name = names[column][:80] if column < len(names) else ""
    raise DataError(
        "unknown_layout",
        f"the column {name!r} tells the rows of one time apart, and would be mixed; needed is a tag, such as "
        "FIC101.PV, with a time and a value in each row, or a column Loop beside PV and OP",
    )


def times_by_word(rows: Iterable[tuple[str, int]]) -> dict[str, list[int]]:
    times: dict[str, list[int]] = {}
    for word, at in rows:
        times.setdefault(word, []).append(at)
    return times


def lie_among(one: list[int], other: list[int]) -> bool:
    """Whether most times of one of the two lie between the other's, and of these some between those."""
    of_one, of_other = _share_between(one, other), _share_between(other, one)
    return min(of_one, of_other) > 0 and max(of_one, of_other) > 1 / 2


def _share_between(inner: list[int], outer: list[int]) -> float:
    first, last = min(outer), max(outer)
    return sum(first <= at <= last for at in inner) / len(inner)


def _have_same(one: list[int], other: list[int], sampled: bool) -> bool:
    """Whether two words have rows of the same times. Appended in another order, batches lie apart; what fills the holes
    of others lies between, at no same times. Of rows that are some of many, their spans tell it."""
    if not sampled:
        return lie_among(one, other) and not set(one).isdisjoint(other)
    shared_ns = min(max(one), max(other)) - max(min(one), min(other))
    return 2 * shared_ns > min(max(one) - min(one), max(other) - min(other))


def _is_hour_of_autumn(back_ns: int, longest_ns: int) -> bool:
    """Whether clocks were put back by an hour: its last row and the first one behind may each be a step off."""
    return HOUR_NS - 2 * longest_ns <= back_ns <= HOUR_NS
