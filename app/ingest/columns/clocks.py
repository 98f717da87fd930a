"""Date and clock in columns of their own: which they are, by what they hold."""

import re
from collections.abc import Callable, Sequence
from itertools import pairwise

import polars as pl

from app.ingest.columns.joined_stamps import (
    CLOCK_OF_NO_CLOCK,
    CLOCK_WITH_HALF,
    DAY_OF_NO_DATE,
    HALF_OF_DAY,
    stamps_of_rows,
)
from app.ingest.columns.names import name_at
from app.ingest.columns.stamp_parts import clock_beside, days_beside
from app.ingest.files.head import Head
from app.ingest.model import IngestOptions
from app.ingest.times.half_clock import NOON
from app.ingest.times.spelled_times import respelled
from app.ingest.times.stamps import find_form

MOST = 0.8  # of the rows; units, footers and holes may stand between them
SHOWN = 50
_CLOCK = re.compile(r"\d{1,2}[:.]\d{2}([:.]\d{2}([.,]\d+)?)?( ?[ap]m)?([+-]\d{2}:\d{2})?", re.IGNORECASE)
_OUR_DATE = re.compile(
    r"((199\d|20[0-4]\d)([-/.])\d{1,2}\3\d{1,2}|\d{1,2}([/.])\d{1,2}\4(199\d|20[0-4]\d))(?P<clock>[T ].*)?"
)
_HOUR_WITH_HALF = re.compile(rf"(?P<day>.*\d)[ T]{CLOCK_WITH_HALF}\.?m\.?", re.IGNORECASE)
_MOST_DAMAGED = 0.02  # of the rows
_SHIFTS = re.compile(r"(?i)shift|schicht|turno|équipe|equipe|crew|班")  # those of the morning work at noon too
_DATE = re.compile(r"[\s\"]*\d{1,4}[/-]")
"""What begins so is no clock, however it is spelled: a cheap test before the dear one."""


def date_and_clock(
    head: Head, time: tuple[int, ...], names: Sequence[str], first_row: int, options: IngestOptions
) -> tuple[int, ...]:
    """The column of times with the one of clocks or of dates beside it where it has none itself, date before clock; or
    with those of their parts, such as Hour. Behind them the column of AM and PM, where it stands alone."""
    found = _date_and_clock(head, time, names, first_row, options) if len(time) == 1 else time
    return _with_half_of_day(head, found, names, first_row)


def _with_half_of_day(head: Head, time: tuple[int, ...], names: Sequence[str], first_row: int) -> tuple[int, ...]:
    """With the column of AM and PM beside clocks of twelve hours."""
    rows = [row for row in head.rows[first_row:] if any(row)]
    width = max(map(len, rows[:SHOWN]), default=0)
    halves = (at for at in range(width) if at not in time and _are_halves(head.column(at, first_row)[:SHOWN]))
    half = next((at for at in halves if not _SHIFTS.search(name_at(names, at))), None)
    if half is None:
        return time
    stamps = stamps_of_rows(rows, (*time, half))
    found = [match for stamp in stamps if (match := _HOUR_WITH_HALF.fullmatch(stamp))]
    return (*time, half) if len(found) >= MOST * len(rows) and _are_of_twelve_hours(found) else time


def _are_of_twelve_hours(stamps: Sequence[re.Match[str]]) -> bool:
    """Whether clocks beside AM and PM are such ones: no hour is above 12, and halves of a day follow each other as its
    hours do, as those of shifts do not."""
    hours = [(stamp["day"], int(stamp["hour"]), 12 * (stamp["half"] in "pP")) for stamp in stamps]
    of_24 = sum(hour > NOON or (hour == 0 and half > 0) for _, hour, half in hours)
    pairs = [(one[1:], other[1:]) for one, other in pairwise(hours) if one[0] == other[0]]
    within = [hour % 12 - before % 12 for (before, half), (hour, other) in pairs if half == other]
    goes_up = sum(step > 0 for step in within) >= sum(step < 0 for step in within)
    between = [other > half for (_, half), (_, other) in pairs if half != other]
    against = sum(up != goes_up for up in between)
    return of_24 <= _MOST_DAMAGED * len(hours) and 2 * against <= len(between)


def is_half_of_day(text: str) -> bool:
    return re.search(HALF_OF_DAY, text) is not None


def _are_halves(fields: list[str]) -> bool:
    return bool(fields) and all(map(is_half_of_day, fields))


def _date_and_clock(
    head: Head, time: tuple[int, ...], names: Sequence[str], first_row: int, options: IngestOptions
) -> tuple[int, ...]:
    column, width = time[0], max(map(len, head.rows[first_row:]), default=0)
    others = sorted((index for index in range(width) if index != column), key=lambda index: abs(index - column))

    def first(are: Callable[[list[str], str], bool]) -> int | None:
        each = ((index, head.column(index, first_row)[:SHOWN], name_at(names, index)) for index in others)
        return next((index for index, fields, name in each if are(fields, name)), None)

    shown = head.column(column, first_row)[:SHOWN]
    if are_clocks(shown):
        date = first(lambda fields, name: _are_dates(fields, name, options))
        return (*days_beside(head, names, first_row), column) if date is None else (date, column)
    if not _are_dates(shown, name_at(names, column), options):
        return time
    clock = first(lambda fields, _: are_clocks(fields))
    return (column, *clock_beside(head, names, column, first_row)) if clock is None else (column, clock)


def are_clocks(fields: list[str]) -> bool:
    least = MOST * len(fields)
    if not fields or sum(":" in field for field in fields) < least:  # 12.30 alone is a number
        return False
    clocks = [re.sub(DAY_OF_NO_DATE, "", field) for field in fields]
    if sum(not _DATE.match(text) for text in clocks) < least:
        return False
    plain = respelled(pl.Series(clocks, dtype=pl.String))
    return sum(bool(_CLOCK.fullmatch(text)) for text in plain) >= least


def is_date_or_clock(text: str) -> bool:
    """Whether a cell is a date with its whole year, of our time, or a clock: no tag, as 10-11-2034 may be one."""
    date = _OUR_DATE.fullmatch(text)
    clock = (date["clock"] or "")[1:].strip() if date else text
    return bool(date and not clock) or (":" in clock and bool(_CLOCK.fullmatch(clock)))


def are_midnights(fields: Sequence[str]) -> bool:
    """Whether stamps are of midnight, as spreadsheets write dates: they tell no instants."""
    return sum(bool(re.search(CLOCK_OF_NO_CLOCK, field)) for field in fields) >= MOST * len(fields)


def _are_dates(fields: list[str], name: str, options: IngestOptions) -> bool:
    """Without a clock, or all of midnight. Numbers are some under such a name alone."""
    dates = [re.sub(CLOCK_OF_NO_CLOCK, "", field) for field in fields]
    form = find_form(dates, name, options) if not any(":" in date for date in dates[:1]) else None
    return form is not None and form.is_date
