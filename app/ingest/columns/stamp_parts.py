"""Parts of a stamp in columns of their own: Year, Month, Day, Hour, Minute and Second, or Hour, or a clock as 0615,
beside a date. They are known by their names and by what they hold."""

from collections.abc import Sequence
from itertools import chain, pairwise

from app.ingest.columns.plain_names import plain
from app.ingest.files.head import Head, is_number
from app.ingest.numbers.units import as_number
from app.ingest.times.digit_clocks import ONE_WAY, digits_of, digits_told, to_one_side

_ANY_DATE = "2024-01-01"
_MOST = 0.8  # of the rows
_YEARS = frozenset(("year", "yr", "jahr", "annee", "ano", "anno", "jaar", "年"))
_MONTHS = frozenset(("month", "monat", "mois", "mes", "mese", "maand", "月"))
_DAYS = frozenset(("day", "dayofmonth", "tag", "jour", "dia", "giorno", "dag", "日"))
_DAYS_OF_YEAR = frozenset(("doy", "dayofyear", "julianday", "jday", "yday", "yearday", "tagdesjahres", "jourdelannee"))
_HOURS = frozenset(("hour", "hours", "hr", "hrs", "hourofday", "stunde", "std", "heure", "hora", "ora", "uur", "小时"))
_MINUTES = frozenset(("minute", "minuto", "minuut", "分", "分钟"))
_SECONDS = frozenset(("second", "sekunde", "seconde", "segundo", "secondo", "秒"))
_ALSO_MINUTES, _ALSO_SECONDS = frozenset(("minutes", "min")), frozenset(("seconds", "sec", "sek"))
"""Next to hours, or to minutes; elsewhere they may be a span, or the lowest value."""
_OF_DAY = ((_YEARS, 1990, 2049), (_MONTHS, 1, 12), (_DAYS, 1, 31))
_LAST_OF_YEAR = 366
_CLOCKS = frozenset((*_HOURS, "time", "timeofday", "clock", "zeit", "uhrzeit", "heures", "hhmm", "hhmmss"))
_BESIDE_MINIMUM = frozenset(("max", "maximum", "mean", "avg", "average"))


def parts_of_stamps(head: Head, names: Sequence[str], first_row: int) -> tuple[int, ...]:
    """The columns of year, month, day and hour with those of minutes and seconds behind it, or with one of a clock in
    digits; empty where one lacks, and where hours without minutes are none of a clock."""
    date = days_beside(head, names, first_row)
    if date and (digits := _clock_of_digits(head, names, date, first_row)):
        return (*date, *digits)
    clock = _clock(head, names, first_row) if date else ()
    is_clock = len(clock) > 1 or (clock and _go_on_in_days(head, names, date, clock, first_row))
    return (*date, *clock) if is_clock else ()


def days_beside(head: Head, names: Sequence[str], first_row: int) -> tuple[int, ...]:
    """The columns of year, month and day, or of the day of the year and the year, in this order; empty where one
    lacks."""
    known = [plain(name) for name in names]

    def of(called: frozenset[str], low: int, high: int) -> int | None:
        named = (at for at, name in enumerate(known) if name in called)
        return next((at for at in named if _are_whole(head, at, first_row, low, high)), None)

    columns = tuple(at for part in _OF_DAY if (at := of(*part)) is not None)
    if len(columns) == len(_OF_DAY):
        return columns
    year, day = of(*_OF_DAY[0]), of(_DAYS_OF_YEAR, 1, _LAST_OF_YEAR)
    if day is None and _MONTHS.isdisjoint(known) and of(_DAYS, 1, 31) is None:
        day = of(_DAYS, 1, _LAST_OF_YEAR)
    return () if year is None or day is None else (day, year)


def clock_beside(head: Head, names: Sequence[str], date: int, first_row: int) -> tuple[int, ...]:
    """The columns of the hour, and of minutes and seconds, beside one of dates."""
    if digits := _clock_of_digits(head, names, (date,), first_row):
        return digits
    clock = _clock(head, names, first_row)
    return clock if clock and _go_on_in_days(head, names, (date,), clock, first_row) else ()


def _clock_of_digits(head: Head, names: Sequence[str], date: Sequence[int], first_row: int) -> tuple[int, ...]:
    """The column of clocks that are written as 600, 0615 or 61500."""
    named = (at for at, name in enumerate(names) if plain(name) in _CLOCKS and at not in date)
    return next(((at,) for at in named if _are_digits(head, names, date, at, first_row)), ())


def _are_digits(head: Head, names: Sequence[str], date: Sequence[int], column: int, first_row: int) -> bool:
    """Whether the numbers of a column are such clocks, go one way within a day and begin again with the next one, as
    those that something ran do not."""
    clocks = [clock.removesuffix(".0") for clock in head.column(column, first_row)]
    if not digits_of([f"{_ANY_DATE} {clock}" for clock in clocks], digits_told(names[column])):
        return False
    rows = [row for row in head.rows[first_row:] if len(row) > max(*date, column) and is_number(row[column])]
    days = [(tuple(row[at] for at in date), as_number(row[column])) for row in rows]
    turns = [other[1] - one[1] for one, other in pairwise(days) if one[0] != other[0]]
    goes_up = sum(other[1] - one[1] for one, other in pairwise(days) if one[0] == other[0]) >= 0
    begin_again = sum(step < 0 if goes_up else step > 0 for step in turns)
    return _go_on_in_days(head, names, date, (column,), first_row) and begin_again >= ONE_WAY * len(turns)


def _go_on_in_days(head: Head, names: Sequence[str], date: Sequence[int], clock: Sequence[int], first_row: int) -> bool:
    """Whether several rows share a day, of each tag or loop, and hours go one way within it, as those that something
    ran do not."""
    rows = [row for row in head.rows[first_row:] if len(row) > max(*date, clock[0])]
    rows = [row for row in rows if row[date[0]] and is_number(row[clock[0]])]
    words = [at for at in range(len(names)) if at not in date and _begins_with_words(head, rows, at)]
    hours = [(tuple(row[at] for at in date), as_number(row[clock[0]])) for row in rows]
    days = {(day, *(row[at] for at in words if at < len(row))) for (day, _), row in zip(hours, rows, strict=True)}
    steps = [other[1] - one[1] for one, other in pairwise(hours) if one[0] == other[0]]
    shared = 2 * len(days) <= len(rows)
    moves = any(steps) or len(clock) > 1
    return shared and moves and to_one_side(steps)


def _begins_with_words(head: Head, rows: Sequence[Sequence[str]], column: int) -> bool:
    first = next((row[column] for row in rows if column < len(row) and row[column]), "")
    return first != "" and not is_number(first, head.decimal_mark)


def _clock(head: Head, names: Sequence[str], first_row: int) -> tuple[int, ...]:
    """The column of hours, with those of minutes and seconds."""
    known = [plain(name) for name in names]
    hour = next((at for at, name in enumerate(known) if name in _HOURS), None)
    if hour is None or not _are_whole(head, hour, first_row, 0, 24):
        return ()
    minute = _named(known, _MINUTES, _ALSO_MINUTES, hour)
    if minute is None or not _are_minutes(head, known, minute, first_row):
        return (hour,)
    second = _named(known, _SECONDS, _ALSO_SECONDS, minute)
    if second is None or not _hold(head, second, first_row, 0, 60):
        return hour, minute
    return hour, minute, second


def _named(known: Sequence[str], called: frozenset[str], also: frozenset[str], beside: int) -> int | None:
    """The column that is called so, or else the one next to another that is also called so."""
    next_to = (at for at in (beside + 1, beside - 1) if 0 <= at < len(known) and known[at] in also)
    named = (at for at, name in enumerate(known) if name in called)
    return next(chain(named, next_to), None)


def _are_minutes(head: Head, known: Sequence[str], column: int, first_row: int) -> bool:
    """Min beside Max is the lowest value."""
    lowest = known[column] == "min" and not _BESIDE_MINIMUM.isdisjoint(known)
    return not lowest and _are_whole(head, column, first_row, 0, 59)


def _are_whole(head: Head, column: int, first_row: int, low: int, high: int) -> bool:
    numbers = _numbers(head, column, first_row)
    return _hold(head, column, first_row, low, high) and not any(number % 1 for number in numbers)


def _hold(head: Head, column: int, first_row: int, low: int, high: int) -> bool:
    """Whether most rows have a number there that is none beyond these."""
    numbers = _numbers(head, column, first_row)
    filled = len(numbers) >= _MOST * sum(any(row) for row in head.rows[first_row:])
    return bool(numbers) and filled and low <= min(numbers) and max(numbers) <= high


def _numbers(head: Head, column: int, first_row: int) -> list[float]:
    return [as_number(text) for text in head.column(column, first_row) if is_number(text, head.decimal_mark)]
