"""Long without a row of names: a column of times (or date and clock), one of tags, one of values and perhaps one of
good and bad, in any order."""

from collections import Counter
from dataclasses import replace

import numpy as np

from app.ingest.columns.clocks import date_and_clock
from app.ingest.columns.headings import begins_with_data
from app.ingest.columns.names import counts_rows, mostly_numbers, mostly_signals, numbers_of
from app.ingest.columns.plans import LongPlan
from app.ingest.columns.time_columns import first_row_of_times, form_of
from app.ingest.columns.widths import refuse_parted_decimals, usual_width
from app.ingest.files.head import Head, is_number
from app.ingest.model import FloatArray, IngestOptions
from app.ingest.tags.quality import tell_good_from_bad, tell_quality_for_sure
from app.ingest.times.stamps import TimeForm, find_form

_MOST_ALIKE = 0.9  # of the rows have the same code


def sniff(head: Head, options: IngestOptions) -> LongPlan | None:
    width = usual_width(head, 0)
    if not 3 <= width <= 12:
        return None
    full = [row for row in head.rows if len(row) == width]
    columns = [[row[index] for row in full if row[index]] for index in range(width)]
    found = _times(replace(head, rows=tuple(full)), columns, options)
    if found is None:
        return None
    time, form = found
    rest = [index for index in range(width) if index not in time]
    values = [index for index in rest if mostly_numbers(columns[index], head.decimal_mark)]
    if not values:
        return None
    words = [index for index in rest if _are_tags(columns[index], head.decimal_mark)]
    value = _value(head, columns, values, several=any(len(set(columns[index])) > 1 for index in words))
    quality = next((index for index in rest if index != value and _tell_quality(columns[index])), None)
    tags = [index for index in words if index != quality]
    if not tags or not _begins_with_data(head, columns, time, value, options):
        return None
    refuse_parted_decimals(head, value)
    return LongPlan("long_bare", 0, width, time, form, _tag(columns, tags), value, quality)


def _tag(columns: list[list[str]], found: list[int]) -> int:
    """The first column of signals that has as many words as the first one of tags, which else has them."""
    least = len(set(columns[found[0]]))
    signals = (index for index in found if len(set(columns[index])) >= least and mostly_signals(columns[index]))
    return next(signals, found[0])


def _times(full: Head, columns: list[list[str]], options: IngestOptions) -> tuple[tuple[int, ...], TimeForm] | None:
    """The first column of stamps, or date and clock, by the rows that have all fields; and their form."""
    forms = ((index, find_form(column, "", options)) for index, column in enumerate(columns))
    first = next((index for index, form in forms if form is not None and form.kind != "relative"), None)
    if first is None:
        return None
    time = date_and_clock(full, (first,), (), 0, options)
    form = form_of(full, time, 0, options)
    return None if form is None else (time, form)


def _begins_with_data(
    head: Head, columns: list[list[str]], time: tuple[int, ...], value: int, options: IngestOptions
) -> bool:
    """Whether nothing above the first whole row with a time names anything; a short one may be a title of a number."""
    first_row = first_row_of_times(head, time[0], options)
    if first_row >= 0 and is_number(head.row(first_row)[time[0]]):
        whole = next((at for at, row in enumerate(head.rows) if len(row) == len(columns)), 0)
        first_row = first_row_of_times(head, time[0], options, start=whole)
    return begins_with_data(head, first_row, [value], start=int(_is_cut(head, columns)))


def _value(head: Head, columns: list[list[str]], numbers: list[int], several: bool) -> int:
    """The first column of numbers that least are qualities, count the rows or are codes, the same in most rows. Values
    may rest, as a set point of 192, and rise as well: what has no fractions is a code or a number of the row, behind
    the first column, only beside another one that has some and moves, and a quality there or where several tags have
    the same one."""
    told = {index: numbers_of(head, index, 0) for index in numbers}
    found = {index: values[np.isfinite(values)] for index, values in told.items()}
    rest = {index for index, values in found.items() if _rests(values)}
    exact = {index for index, values in found.items() if np.any(values % 1) and index not in rest}

    def doubts(index: int) -> tuple[int, bool]:
        beside = bool(exact) and not np.any(found[index] % 1)
        counts = (beside or index == 0) and counts_rows(found[index])
        tells_quality = (beside or (several and index in rest)) and _tell_quality(columns[index])
        return sum((beside and index in rest, counts, tells_quality)), counts

    return min(numbers, key=doubts)


def _rests(values: FloatArray) -> bool:
    return max(Counter(values.tolist()).values(), default=0) >= _MOST_ALIKE * len(values)


def _tell_quality(fields: list[str]) -> bool:
    words = (text for text in fields if not text.lower().startswith(("bad", "uncertain")))
    return tell_good_from_bad(fields) or (tell_quality_for_sure(fields) and any(words))


def _is_cut(head: Head, columns: list[list[str]]) -> bool:
    """Whether the first line lost its begin, as where a log was cut to a size: behind its first field stands what
    stands at the end of the others."""
    rest = head.row(0)[1:]
    return 0 < len(rest) < len(columns) - 1 and all(
        text in fields or (is_number(text, head.decimal_mark) and mostly_numbers(fields, head.decimal_mark))
        for text, fields in zip(rest, columns[-len(rest) :], strict=True)
    )


def _are_tags(fields: list[str], decimal_mark: str) -> bool:
    if not fields or any(is_number(field, decimal_mark) for field in fields):
        return False
    return any(character.isdigit() or character in "._-/:" for field in fields for character in field)
