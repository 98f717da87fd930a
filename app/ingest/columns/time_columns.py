"""Columns of times by their names and by what they hold: which they are, their form, and the first row that has one."""

import re
from collections import Counter
from collections.abc import Sized
from dataclasses import replace

import numpy as np

from app.errors import DataError
from app.ingest.columns.clocks import MOST, SHOWN, are_clocks, are_midnights, date_and_clock, is_half_of_day
from app.ingest.columns.headings import is_data
from app.ingest.columns.joined_stamps import stamps_of_rows
from app.ingest.columns.names import SKIPPED_NAMES, name_at, numbers_of, numbers_rows, rises
from app.ingest.columns.plain_names import plain
from app.ingest.columns.stamp_parts import parts_of_stamps
from app.ingest.columns.time_names import is_full_time, time_columns
from app.ingest.files.head import PREAMBLE_ROWS, Head, is_number
from app.ingest.model import FloatArray, IngestOptions
from app.ingest.tags.grouping import SIMULATED, place, without_unit
from app.ingest.times.counted_times import OURS_FROM_S, OURS_TO_S
from app.ingest.times.digit_clocks import IN_DOUBT, UNKNOWN, digits_of, digits_told
from app.ingest.times.stamps import TimeForm, find_form
from app.nanoseconds import NS_PER_S

NO_ROWS = -1
_DATE_AND_CLOCK = 2  # columns
_MAY_BE_STAMP = re.compile(r"\d\D+\d+\D+\d|\d{8}|年|^\d{5}([.,]|$)")


def time_columns_in(head: Head, names: tuple[str, ...], first_row: int, options: IngestOptions) -> tuple[int, ...]:
    """The columns of times by their names and by what they hold from a row on: of several with such names, one of dates
    and clocks that is filled and moves goes before one of counts, and those of all parts of a stamp before one of
    them, such as Seconds."""
    named = time_columns(names)
    parts = parts_of_stamps(head, names, first_row) if named else ()
    if set(named) < set(parts):
        return parts
    others = [(index,) for index, name in enumerate(names) if is_full_time(name) and (index,) != named]
    if not others or _are_instants(form_of(head, named, first_row, options)):
        return named
    moving = (time for time in others if _moves(head, time[0], first_row))
    return next((time for time in moving if _are_instants(form_of(head, time, first_row, options))), named)


def stamps_in(
    head: Head, names: tuple[str, ...], first_row: int, options: IngestOptions, of_rows: bool = False
) -> tuple[int, ...]:
    """The first column, or date and clock, that holds stamps from a row on, whatever it is called; one of dates alone
    where there is no other, or else those of their parts by name. of_rows: a row is an instant, and beside a first
    column of seconds from a start those that do not tell the rows apart are of something else, as of the export or the
    batch."""
    dates: tuple[int, ...] = ()
    without_clocks = False
    beside_seconds = of_rows and _first_are_seconds(head, names, first_row, options)
    for index in range(min(len(names), max(map(len, head.rows[first_row:]), default=0))):
        form = _form_of_stamps(head, index, names[index], first_row, options)
        if form is None:
            continue
        are_dates = form.is_date or are_midnights(head.column(index, first_row))
        single = are_dates and without_clocks  # clocks are looked for in all columns, and there is none
        time = (index,) if single else date_and_clock(head, (index,), names, first_row, options)
        without_clocks = without_clocks or (are_dates and len(time) == 1)
        if max(time) >= len(names) or (beside_seconds and not _tell_rows(head, names, time, first_row, are_dates)):
            continue
        if len(time) > 1 or not are_dates:
            return time
        dates = dates or time
    return dates or parts_of_stamps(head, names, first_row)


def _first_are_seconds(head: Head, names: tuple[str, ...], first_row: int, options: IngestOptions) -> bool:
    """Whether the first column counts from a start under a name that may be that of times."""
    form = find_form(head.column(0, first_row), "", options)
    if not names or form is None or form.kind != "relative":
        return False
    return may_be_times(names[0], numbers_of(head, 0, first_row))


def _tell_rows(head: Head, names: tuple[str, ...], time: tuple[int, ...], first_row: int, are_dates: bool) -> bool:
    """Whether stamps, or dates with clocks, stand in the rows and differ from one to the next; those of minutes need
    not beside what may be the number of a row."""
    if plain(names[0]) in SKIPPED_NAMES and not (are_dates and len(time) == 1):
        return _moves(head, time[-1], first_row)
    fields = list(zip(*(head.column(index, first_row) for index in time), strict=False))
    return _is_filled(head, fields, first_row) and 2 * len(set(fields)) > len(fields)


def _form_of_stamps(head: Head, column: int, name: str, first_row: int, options: IngestOptions) -> TimeForm | None:
    """None where a column has seconds from a start, or tells a signal. Behind the first one, numbers are stamps where
    they are seconds since 1970 of our time and rise: days since 1900 may be anything."""
    fields = head.column(column, first_row)
    if place(name, "").signal != "OTHER" or not any(map(_MAY_BE_STAMP.search, fields[:SHOWN])):
        return None
    form = find_form(fields, "", options)
    if form is None or form.kind == "relative" or (form.kind == "serial" and column):
        return None
    if form.kind != "epoch" or not column:
        return form
    numbers = numbers_of(head, column, first_row)
    seconds = (numbers * form.scale + form.origin_ns) / NS_PER_S
    ours = np.all((seconds > OURS_FROM_S) & (seconds < OURS_TO_S))
    return form if len(numbers) > 1 and ours and rises(numbers) else None


def _moves(head: Head, column: int, first_row: int) -> bool:
    """Whether a column is filled and tells instants: not the one of the start or the export in all rows, no dates at
    midnight."""
    fields = head.column(column, first_row)
    filled = _is_filled(head, fields, first_row)
    rests = max(Counter(fields).values(), default=0) >= MOST * len(fields)
    return filled and not rests and not are_midnights(fields)


def _is_filled(head: Head, fields: Sized, first_row: int) -> bool:
    return len(fields) >= MOST * sum(any(row) for row in head.rows[first_row:])


def _are_instants(form: TimeForm | None) -> bool:
    return form is not None and form.kind != "relative" and not form.is_date and not form.is_of_hours


def may_be_times(name: str, numbers: FloatArray) -> bool:
    """Whether the numbers (n,) of a first column that no name calls times are some: the name tells neither a signal nor
    a simulation, and they rise."""
    told = place(name, "").signal != "OTHER" or without_unit(name).strip().lower() in SIMULATED
    return not told and not numbers_rows(name) and rises(numbers)


def times_assumed(name: str, form: TimeForm) -> str:
    """What is to be said where the numbers of a column are taken for times that no name tells."""
    shown = f", {name.strip()[:80]!r}," if name.strip() else ", which has no name,"
    unit = "seconds" if form.scale == NS_PER_S else f"steps of {form.scale / NS_PER_S:g} s"
    return f"no column is named as times: the numbers of the first{shown} were read as {unit}"


def form_of(
    head: Head, time: tuple[int, ...], first_row: int, options: IngestOptions, name: str = ""
) -> TimeForm | None:
    """The form of one time column, or of those of date and clock, or of their parts, joined."""
    if len(time) == 1:
        return find_form(head.column(time[0], first_row), name, options)
    rows = [row for row in head.rows[first_row:] if len(row) > max(time) and all(row[index] for index in time)]
    stamps = stamps_of_rows(rows, time)
    told = max((digits_told(name_at(row, time[-1])) for row in head.rows[:first_row]), default=UNKNOWN)
    form = find_form(stamps, name, options, told)
    if form is None:
        _refuse_doubtful_digits(stamps, told)
        return None
    apart = not any(":" in row[index] for row in rows[:SHOWN] for index in time)
    form = replace(form, hours_apart=apart and not form.clock_digits)
    if len(time) == _DATE_AND_CLOCK and not form.is_of_hours and not is_half_of_day(rows[0][time[-1]]):
        return form
    note = f"the times were joined from their parts in {len(time)} columns, {stamps[0]!r} the first of them"
    return replace(form, notes=(note, *form.notes))


def _refuse_doubtful_digits(stamps: list[str], told: int) -> None:
    """Raises DataError where clocks of digits may be of hours and minutes or of minutes and seconds."""
    if digits_of(stamps, told) == IN_DOUBT:
        raise DataError(
            "unknown_layout",
            f"the clocks beside the dates are numbers, {stamps[0]!r} the first of them, that may be HHMM or HHMMSS; "
            "needed are their zeros, as in 0600, a column named HHMM, rows of several days, or clocks such as 06:00",
        )


def first_row_of_times(head: Head, column: int, options: IngestOptions, name: str = "", start: int = 0) -> int:
    """The first row from `start` on from which on the column of this name, which may tell the unit of its numbers,
    holds times; NO_ROWS where it never does."""
    for index, row in enumerate(head.rows[start:PREAMBLE_ROWS], start):
        if column < len(row) and row[column] and find_form([row[column]], name, options) is not None:
            following = head.column(column, index)
            return index if find_form(following, name, options) is not None else NO_ROWS
    return NO_ROWS


def first_row_below(head: Head, at: int, column: int, options: IngestOptions, name: str) -> int:
    """The same below the names in a row, whatever times titles above them hold; NO_ROWS where rows of data stand there,
    as wide as the names."""
    width = sum(map(bool, head.row(at)))
    for index, row in enumerate(head.rows[:at]):
        beside = [place for place in range(len(row)) if place != column]
        wide = len(beside) < len(row) and sum(map(bool, row)) >= width
        if wide and find_form([row[column]], name, options) is not None and is_data(head, index, beside):
            return NO_ROWS
    return first_row_of_times(head, column, options, name, at + 1)


def holds_times(head: Head, column: int, first_row: int, options: IngestOptions) -> bool:
    """Whether a column has stamps or clocks in letters; values are numbers, or words without any."""
    first = next((row[column] for row in head.rows[first_row:] if column < len(row) and row[column]), "")
    if not re.search(r"\d\D+\d+\D+\d", first) or is_number(first, head.decimal_mark):
        return False
    fields = head.column(column, first_row)
    form = find_form(fields, "", options)
    return are_clocks(fields) or (form is not None and form.kind == "text")


def times_of_rows(
    head: Head, names: tuple[str, ...], first_row: int, options: IngestOptions
) -> tuple[tuple[int, ...], TimeForm] | None:
    """The column of times of a table with a value, or a loop, a row, or those of dates and clocks; and their form."""
    time = time_columns_in(head, names, first_row, options) or stamps_in(head, names, first_row, options)
    if not time:
        return None
    time = date_and_clock(head, time, names, first_row, options)
    form = form_of(head, time, first_row, options, name_at(names, time[0]))
    return None if form is None else (time, form)
