"""Stamps of rows whose parts stand in several columns: date and clock, or year, month, day, hour and so on."""

from collections.abc import Iterable, Sequence

import polars as pl

from app.ingest.columns.plans import name_of

DAY_OF_NO_DATE = r"^(1899-12-3[01]|1900-01-0[01]|1904-01-01)[ T]"  # a spreadsheet's clock is a part of its first day
CLOCK_OF_NO_CLOCK = r"(?i)[\sT](0?0:00(:00([.,]0+)?)?|12:00(:00([.,]0+)?)?\s?a[.]?m[.]?)$"  # its date
_YEAR = r"^\d{4}$"
_DAYS_OF_YEAR = 3  # columns: year, month and day
_NO_DECIMALS = r"^(\d+)[.,]0+$"  # a database's whole number
_HOUR_OF_NUMBERS = r"^(\d{1,6})\.0$"  # where one of them is missing, whole ones have decimals
_ONE_DIGIT = r"^(\d)([.,]\d+)?$"
_HALF = r"(?i):([ap])\.?m\.?$"  # of the day, in a column behind those of the clock
_SHOWN = 1000  # rows, of which one tells whether a column is of AM and PM
HALF_OF_DAY = r"(?i)^[ap]\.?m\.?$"
CLOCK_WITH_HALF = r"(?P<hour>\d{1,2})(?P<behind>([:.]\d{2}){0,2}([.,]\d+)?\s)(?P<half>[ap])"
_OF_24_HOURS = rf"(?i)^(?P<before>.*\d[ T]){CLOCK_WITH_HALF}"
_DAY_OF_YEAR = (r"^(\d{2}) (\d{4}):", "${2}-0${1} "), (r"^(\d{3}) (\d{4}):", "${2}-${1} ")  # before its year


def stamps_of(frame: pl.DataFrame, time: Sequence[int]) -> pl.Series:
    """(n,) the texts of the rows' times; one column alone as it is."""
    if len(time) == 1:
        return frame[name_of(time[0])]
    date, *clock = (frame[name_of(index)].cast(pl.String).str.strip_chars() for index in time)
    half = clock[-1].drop_nulls().head(_SHOWN).str.contains(HALF_OF_DAY)
    if not (len(clock) == 1 and half.any()):
        date = date.str.replace(CLOCK_OF_NO_CLOCK, "")
    if len(clock) > 1:
        stamps = _of_parts((date, *clock))
    else:
        hour = clock[0].str.replace(_HOUR_OF_NUMBERS, "${1}").str.replace(DAY_OF_NO_DATE, "")
        stamps = _joined((date, hour), " ")
    return _of_twelve_hours(stamps) if half.any() else stamps


def stamps_of_rows(rows: Iterable[Sequence[str]], time: Sequence[int]) -> list[str]:
    """The same of rows of fields; what lies behind a row's end is empty."""
    fields = [[row[at] if at < len(row) else "" for at in time] for row in rows]
    frame = pl.DataFrame(fields, schema={name_of(at): pl.String for at in range(len(time))}, orient="row")
    return stamps_of(frame, range(len(time))).to_list()


def _of_parts(parts: Sequence[pl.Series]) -> pl.Series:
    """Of a date, or of year, month and day, or of day of the year and year, and the parts of a clock."""
    written = [part.str.replace(_NO_DECIMALS, "${1}").str.replace(_ONE_DIGIT, "0${1}${2}") for part in parts]

    def joined(days: int) -> pl.Series:
        return _joined((_joined(written[:days], "-"), _joined(written[days:], ":")), " ")

    stamps = joined(1)
    for day, date in _DAY_OF_YEAR:
        stamps = stamps.str.replace(day, date)
    if len(parts) > _DAYS_OF_YEAR:
        whole = written[0].str.contains(_YEAR)
        stamps = pl.select(pl.when(whole).then(joined(_DAYS_OF_YEAR)).otherwise(stamps).alias("t")).to_series()
    return stamps.str.replace(_HALF, " ${1}m")


def _of_twelve_hours(stamps: pl.Series) -> pl.Series:
    """With 01:05 PM for 13:05 PM and 12:05 AM for 00:05 AM, as clocks of 24 hours stand beside a column of AM and PM;
    what contradicts itself, as 13:05 AM, stays, and is no time."""
    parts = stamps.str.extract_groups(_OF_24_HOURS).struct.unnest()
    hour, half = parts["hour"].cast(pl.Int64), parts["half"].str.to_lowercase()
    begins = (hour == 0) & (half == "a")
    odd = (begins | (hour.is_between(13, 23) & (half == "p"))).fill_null(False)
    if not odd.any():
        return stamps
    of_twelve = ((hour + 11) % 12 + 1).cast(pl.String).str.zfill(2)
    return _joined((parts["before"], of_twelve, parts["behind"], half + "m"), "").zip_with(odd, stamps)


def _joined(parts: Sequence[pl.Series], separator: str) -> pl.Series:
    return pl.select(pl.concat_str(parts, separator=separator).alias("t")).to_series()
