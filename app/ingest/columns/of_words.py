"""Columns of words that may tell the rows of a table apart, as the tag of each does; further down if not in the first
rows."""

import re
from collections.abc import Collection, Iterable, Sequence
from itertools import islice, pairwise, zip_longest

import numpy as np
import polars as pl

from app.errors import DataError
from app.ingest.columns.clocks import MOST
from app.ingest.columns.joined_stamps import stamps_of_rows
from app.ingest.columns.plans import LongPlan, Plan, WidePlan
from app.ingest.files.head import Head, is_number
from app.ingest.model import NO_TIME, IngestOptions
from app.ingest.numbers.units import as_number
from app.ingest.tags.modes import UNKNOWN_MODE, automatic_flags
from app.ingest.tags.quality import holds_quality_words
from app.ingest.times.time_reader import TimeReader
from app.nanoseconds import NS_PER_H

_ALL = 0.98  # of the rows, at least
_NUMBERED = re.compile("[A-Za-z][0-9]+")  # M1 and M2 are machines, though M is manual
_OFTEN, _OFTEN_SHARE = 8, 0.3  # words that take turns do so as many times at least, in so many of the rows
_STATES = """
    on off open opened close closed run running stop stopped start started idle busy true false yes no
    hi lo hihi lolo normal norm alarm ok rising falling loaded unloaded active inactive
"""
OF_THE_PROCESS = frozenset(_STATES.split())
"""States that a valve, a pump or an alarm goes through, and values with it; none is a place or a machine."""
_LEVELS = 3.0  # how much further than the next value of its word the one of the next row is, where words have their own
_HOLE, _USUAL = 1.5, 0.25  # how many usual steps a hole is longer than, and which share of steps, at least, are usual


class WordsPartRows(DataError):
    """The words in `column` tell rows of one time apart, and it is not read: what they have would be mixed."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__("unknown_layout", message)
        self.column = column

    def __reduce__(self) -> tuple[type, tuple[str, int]]:  # type: ignore[override]  # what makes it anew is other
        return type(self), (self.message, self.column)


def word_columns(plan: WidePlan, head: Head) -> dict[int, list[str]]:
    """By column that is filled with words, not many different ones and no states, those of each row."""
    rows = [row for row in head.rows[plan.first_row :] if any(row)]
    times = {index for group in plan.groups for index in group.time}
    columns = enumerate(islice(zip_longest(*rows, fillvalue=""), plan.width))
    return {index: list(words) for index, words in columns if index not in times and _are_few_words(words)}


def _are_few_words(fields: Sequence[str]) -> bool:
    """Numbers are no words, with a comma or a point: cells of text may have another mark than the file."""
    words = set(fields) - {""}
    if fields.count("") > (1 - MOST) * len(fields) or 2 * len(words) > len(fields):
        return False
    return not any(is_number(word, ",") for word in words) and not states_among(words)


def states_among(words: Collection[str]) -> set[str]:
    """Those that are modes or qualities."""
    different = sorted(word for word in set(words) if not _NUMBERED.fullmatch(word))
    flags = automatic_flags(pl.Series(different, dtype=pl.String))
    modes = np.isfinite(flags) & (flags != UNKNOWN_MODE)
    return {word for word, is_mode in zip(different, modes, strict=True) if is_mode or holds_quality_words([word])}


def column_that_sorts(plan: WidePlan, head: Head, options: IngestOptions) -> int | None:
    """The column by whose words rows come before their times: these go back where one word follows another, and nowhere
    else; and the words have rows among each other's."""
    rows = [row for row in head.rows[plan.first_row :] if any(row)]
    stamps = stamps_of_rows(rows, plan.groups[0].time)
    for index, words in word_columns(plan, head).items():
        if are_sorted_by(words, stamps, plan, options, head.sampled):
            return index
    return None


def are_sorted_by(
    words: Sequence[str], stamps: Sequence[str], plan: Plan, options: IngestOptions, sampled: bool = False
) -> bool:
    """The same of the words and stamps of rows. sampled: the last ones are some of many."""
    time_ns = TimeReader(plan.form, options).read(pl.Series(stamps, dtype=pl.String)).tolist()
    timed = [(word, at) for word, at in zip(words, time_ns, strict=True) if at != NO_TIME]
    turned = [(word, -at) for word, at in timed]
    return _is_sorted_by_words(timed, sampled) or _is_sorted_by_words(turned, sampled)


def _is_sorted_by_words(rows: list[tuple[str, int]], sampled: bool) -> bool:
    changes = [(one, other) for one, other in pairwise(rows) if one[0] != other[0]]
    times = times_by_word(rows)
    within = all(one <= other for own in times.values() for one, other in pairwise(own))
    longest = max((other[1] - one[1] for one, other in pairwise(rows) if one[0] == other[0]), default=0)
    back = dict.fromkeys(
        (one[0], other[0])
        for one, other in changes
        if one[1] > other[1] and not _is_hour_of_autumn(one[1] - other[1], longest)
    )
    return within and any(_are_among(times[one], times[other], sampled) for one, other in back)


def column_that_takes_turns(plan: WidePlan, head: Head) -> int | None:
    """The column whose words follow each other all the time, each with values of its own: those of the next row are
    further off than those of the next one with its word. What tells how a value came about stands beside values that
    go on, and a state of the process beside those that it brings about."""
    rows = [row for row in head.rows[plan.first_row :] if any(row)]
    for index, words in word_columns(plan, head).items():
        if _take_turns_as_places(words) and any(
            _have_levels(words, _numbers(rows, value.index, head)) for value in plan.groups[0].values
        ):
            return index
    return None


def take_turns(words: Sequence[str]) -> bool:
    """Whether words follow each other all the time."""
    return sum(one != other for one, other in pairwise(words)) >= max(_OFTEN, _OFTEN_SHARE * len(words))


def _take_turns_as_places(words: Sequence[str]) -> bool:
    return take_turns(words) and not {word.lower() for word in words} - {""} <= OF_THE_PROCESS


def _numbers(rows: Sequence[tuple[str, ...]], column: int, head: Head) -> list[float]:
    """Of a column, row by row; NaN where none stands."""
    fields = (row[column] if column < len(row) else "" for row in rows)
    return [as_number(text) if is_number(text, head.decimal_mark) else np.nan for text in fields]


def _have_levels(words: Sequence[str], numbers: Sequence[float]) -> bool:
    known = [(word, number) for word, number in zip(words, numbers, strict=True) if np.isfinite(number)]
    across = [abs(other[1] - one[1]) for one, other in pairwise(known) if one[0] != other[0]]
    of_word: dict[str, list[float]] = {}
    for word, number in known:
        of_word.setdefault(word, []).append(number)
    within = [abs(other - one) for own in of_word.values() for one, other in pairwise(own)]
    return len(across) >= _OFTEN and len(within) > 0 and bool(np.median(across) > _LEVELS * np.median(within))


def column_that_parts_tags(plan: LongPlan, head: Head) -> int | None:
    """The column whose words tell the rows of a tag and a time apart, or take turns over a tag, each with values of its
    own: of loops, servers or ways to sum up."""
    of_key = (plan.tag, *plan.time)
    rows = [row for row in head.rows[plan.first_row :] if len(row) > max(of_key) and all(row[at] for at in of_key)]
    keys = [tuple(row[at] for at in of_key) for row in rows]
    for index in sorted(set(range(plan.width)) - plan.read):
        words = [row[index] if index < len(row) else "" for row in rows]
        if not _are_few_words(words):
            continue
        different = len(set(zip(keys, words, strict=True)))
        if len(set(keys)) <= MOST * len(keys) and different >= _ALL * len(keys):
            return index
        if _take_turns_over_tags(words, rows, plan, head):
            return index
    return None


def _take_turns_over_tags(words: Sequence[str], rows: list[tuple[str, ...]], plan: LongPlan, head: Head) -> bool:
    numbers = _numbers(rows, plan.value, head)
    of_tag: dict[str, list[tuple[str, float]]] = {}
    for row, word, found in zip(rows, words, numbers, strict=True):
        of_tag.setdefault(row[plan.tag], []).append((word, found))
    each = (list(zip(*own, strict=True)) for own in of_tag.values())
    return any(_take_turns_as_places(own) and _have_levels(own, found) for own, found in each)


def refuse_to_mix(names: tuple[str, ...], column: int | None) -> None:
    """Raises WordsPartRows where there is a column that tells rows of one time apart and is not read."""
    if column is not None:
        raise would_mix(names[column] if column < len(names) else "", column)


def would_mix(name: str, column: int) -> WordsPartRows:
    return WordsPartRows(
        f"the column {name[:80]!r} tells the rows of one time apart, and would be mixed; needed is a tag, such as "
        "FIC101.PV, with a time and a value in each row, or a column Loop beside PV and OP",
        column,
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


def _are_among(one: list[int], other: list[int], sampled: bool) -> bool:
    """Whether two words have rows among each other's. Appended in another order, batches lie apart; what fills the
    holes of others lies between, and nowhere else. Of rows that are some of many, their spans tell it."""
    if not sampled:
        return lie_among(one, other) and not (_fill_holes(one, other) or _fill_holes(other, one))
    shared_ns = min(max(one), max(other)) - max(min(one), min(other))
    return 2 * shared_ns > min(max(one) - min(one), max(other) - min(other))


def _fill_holes(holed: list[int], filling: list[int]) -> bool:
    """Whether the times of some rows lie in the holes of others, or outside of them; a few may repeat what is there."""
    times, asked = np.unique(holed), np.array(filling)
    steps = np.diff(times)
    if not len(steps):
        return False
    place = np.searchsorted(times, asked, side="right")
    inside = (place > 0) & (place < len(times))
    in_holes = np.full(len(asked), fill_value=True)
    in_holes[inside] = steps[place[inside] - 1] > _HOLE * np.quantile(steps, _USUAL)
    at = np.minimum(np.maximum(place - 1, 0), len(times) - 1)
    return bool(np.mean(in_holes & (times[at] != asked)) >= _ALL)


def _is_hour_of_autumn(back_ns: int, longest_ns: int) -> bool:
    """Whether clocks were put back by an hour: its last row and the first one behind may each be a step off."""
    return NS_PER_H - 2 * longest_ns <= back_ns <= NS_PER_H
