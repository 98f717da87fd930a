"""Date and clock in columns of their own: which they are, by what they hold, and the stamps that they make together."""

import re
from collections.abc import Callable, Sequence

import polars as pl

from app.ingest.columns.plans import name_of
from app.ingest.columns.stamp_parts import clock_beside, days_beside
from app.ingest.files.head import Head
from app.ingest.model import IngestOptions
from app.ingest.times.spelled_times import respelled
from app.ingest.times.stamps import find_form

MOST = 0.8  # of the rows; units, footers and holes may stand between them
SHOWN = 50
_DAY_OF_NO_DATE = r"^(1899-12-3[01]|1900-01-0[01]|1904-01-01)[ T]"  # a spreadsheet's clock is a part of its first day
_CLOCK_OF_NO_CLOCK = r"(?i)[\sT](0?0:00(:00([.,]0+)?)?|12:00(:00([.,]0+)?)?\s?a[.]?m[.]?)$"  # its date
_CLOCK = re.compile(r"\d{1,2}[:.]\d{2}([:.]\d{2}([.,]\d+)?)?( ?[ap]m)?([+-]\d{2}:\d{2})?", re.IGNORECASE)
_OUR_DATE = re.compile(
    r"((199\d|20[0-4]\d)([-/.])\d{1,2}\3\d{1,2}|\d{1,2}([/.])\d{1,2}\4(199\d|20[0-4]\d))(?P<clock>[T ].*)?"
)
_YEAR = r"^\d{4}$"
_DAYS_OF_YEAR = 3  # columns: year, month and day
_NO_DECIMALS = r"^(\d+)[.,]0+$"  # a data base's whole number
_HOUR_OF_NUMBERS = r"^(\d{1,2})\.0$"  # where one of them is missing, whole ones have decimals
_ONE_DIGIT = r"^(\d)([.,]\d+)?$"
_DATE = re.compile(r"[\s\"]*\d{1,4}[/-]")
"""What begins so is no clock, however it is spelled: a cheap test before the dear one."""


def date_and_clock(
    head: Head, time: tuple[int, ...], names: Sequence[str], first_row: int, options: IngestOptions
) -> tuple[int, ...]:
    """The column of times with the one of clocks or of dates beside it where it has none itself, date before clock; or
    with those of their parts, such as Hour."""
    if len(time) != 1:
        return time
    column, width = time[0], max(map(len, head.rows[first_row:]), default=0)
    others = sorted((index for index in range(width) if index != column), key=lambda index: abs(index - column))

    def first(are: Callable[[list[str]], bool]) -> int | None:
        return next((index for index in others if are(head.column(index, first_row)[:SHOWN])), None)

    shown = head.column(column, first_row)[:SHOWN]
    if are_clocks(shown):
        date = first(lambda fields: _are_dates(fields, options))
        return (*days_beside(head, names, first_row), column) if date is None else (date, column)
    if not _are_dates(shown, options):
        return time
    clock = first(are_clocks)
    return (column, *clock_beside(head, names, column, first_row)) if clock is None else (column, clock)


def are_clocks(fields: list[str]) -> bool:
    least = MOST * len(fields)
    if not fields or sum(":" in field for field in fields) < least:  # 12.30 alone is a number
        return False
    clocks = [re.sub(_DAY_OF_NO_DATE, "", field) for field in fields]
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
    return sum(bool(re.search(_CLOCK_OF_NO_CLOCK, field)) for field in fields) >= MOST * len(fields)


def _are_dates(fields: list[str], options: IngestOptions) -> bool:
    """Without a clock, or all of midnight."""
    dates = [re.sub(_CLOCK_OF_NO_CLOCK, "", field) for field in fields]
    form = find_form(dates, "", options) if not any(":" in date for date in dates[:1]) else None
    return form is not None and form.is_date


def stamp_of(row: Sequence[str], time: Sequence[int]) -> str:
    """The text of a row's time, of date and clock together; what lies behind the row's end is empty."""
    date, *clock = (row[at] if at < len(row) else "" for at in time)
    if len(clock) != 1:
        return _of_parts((date, *clock)) if clock else date
    day, hour = re.sub(_CLOCK_OF_NO_CLOCK, "", date), re.sub(_HOUR_OF_NUMBERS, r"\1", clock[0])
    return " ".join((day, re.sub(_DAY_OF_NO_DATE, "", hour)))


def stamps_of(frame: pl.DataFrame, time: tuple[int, ...]) -> pl.Series:
    """The same of all rows of a frame; one column alone as it is."""
    if len(time) == 1:
        return frame[name_of(time[0])]
    date, *clock = (frame[name_of(index)].cast(pl.String).str.strip_chars() for index in time)
    if len(clock) > 1:
        return _of_columns_of_parts((date, *clock))
    hour = clock[0].str.replace(_HOUR_OF_NUMBERS, "${1}").str.replace(_DAY_OF_NO_DATE, "")
    return pl.select(
        pl.concat_str(date.str.replace(_CLOCK_OF_NO_CLOCK, ""), hour, separator=" ").alias("t")
    ).to_series()


def _of_parts(parts: Sequence[str]) -> str:
    """Of a date, or of year, month and day, and the parts of a clock."""
    whole = (re.sub(_CLOCK_OF_NO_CLOCK, "", parts[0]), *parts[1:])
    written = [re.sub(_ONE_DIGIT, r"0\1\2", re.sub(_NO_DECIMALS, r"\1", part)) for part in whole]
    days = _DAYS_OF_YEAR if re.search(_YEAR, written[0]) else 1
    return " ".join(("-".join(written[:days]), ":".join(written[days:])))


def _of_columns_of_parts(parts: Sequence[pl.Series]) -> pl.Series:
    """The same of whole columns."""
    whole = (parts[0].str.replace(_CLOCK_OF_NO_CLOCK, ""), *parts[1:])
    written = [part.str.replace(_NO_DECIMALS, "${1}").str.replace(_ONE_DIGIT, "0${1}${2}") for part in whole]

    def joined(days: int) -> pl.Expr:
        date, clock = (pl.concat_str(written[:days], separator="-"), pl.concat_str(written[days:], separator=":"))
        return pl.concat_str(date, clock, separator=" ")

    stamps = joined(1)
    if len(parts) > _DAYS_OF_YEAR:
        stamps = pl.when(written[0].str.contains(_YEAR)).then(joined(_DAYS_OF_YEAR)).otherwise(stamps)
    return pl.select(stamps.alias("t")).to_series()
