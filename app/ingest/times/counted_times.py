"""Times that are numbers: which count they are, since when, and how finely they are written."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.ingest.model import FloatArray
from app.ingest.times.told_units import ToldUnit, told_unit, unknown_unit
from app.ingest.times.told_zones import told_utc_offset_ns
from app.nanoseconds import NS_PER_DAY, NS_PER_S

NUMBER = re.compile(r"[+-]?\d+([.,]\d+)?([eE][+-]?\d+)?")
_FEW_DIGITS = re.compile(r"[+-]?\d+([.](?P<decimals>\d*))?[eE][+](?P<exponent>\d+)")
_DATE = r"(?:19|20)\d\d(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])"
_DATE_OF_DIGITS = re.compile(_DATE)
_NAME_OF_DATES = re.compile(r"(?i)\W*(?:date|datum|fecha|日期)\W*(?:[(\[].*)?")  # no Update, no Batch date
_MOST_STAMPS = 0.9  # of a sample
STAMP_OF_DIGITS = re.compile(rf"{_DATE}(?:[01]\d|2[0-4])(?:[0-5]\d(?:[0-5]\d\d{{3}})?)?")
"""To the hour, the minute or the millisecond: as counts since 1970 they would be of 2034, 1976 or no time."""
MILLIONTH_OF_DAY_NS = NS_PER_DAY / 1e6
WALL_SCALES = (NS_PER_DAY, MILLIONTH_OF_DAY_NS)  # in which clocks on the wall are counted
SHORTEST_STEP_S = 0.02  # what a historian keeps of a loop is slower: such a step at such a time is one of days
FINEST_NS, COARSEST_NS = 100_000, NS_PER_S  # to which days are rounded: what a double leaves of them, whole seconds
TICK_NS = 100.0
LEAST_EPOCH_S = 1e8  # as seconds since 1970 of 1973; since a start that is not told, three years
EPOCH_ROUNDING_NS = 1000  # doubles of our time are 238 ns apart, in whichever of its units
_EPOCH_UNITS = ((1e17, 1.0), (1e14, 1e3), (1e11, 1e6), (LEAST_EPOCH_S, 1e9))
_EPOCH_WORDS = ("ns", "us", "ms", "s")
OURS_FROM_S, OURS_TO_S = 631_152_000, 2_524_608_000  # 1990 to 2049: when plants were recorded
LONGEST_STEP_S = 100.0  # of a loop that is audited, usually
_TICKS = (
    (1.16e17, 1.90e17, -11_644_473_600, "times are 100 ns since 1601, as Windows counts them (FILETIME)"),
    (6.21e17, 6.95e17, -62_135_596_800, "times are 100 ns since year 1, as .NET counts them"),
)
"""From, to (of 1971 and 2199), seconds from 1970 to their zero. As ns since 1970 they would be of 1973 or 1990."""
_OF_SPREADSHEETS = "times are days since 1899-12-30, as spreadsheets count them"
_DAYS_FROM_1904 = 1462  # of a spreadsheet of a Macintosh: what its dates are later
_DAYS = (
    (20_000, 80_000, -25_569, _OF_SPREADSHEETS),
    (719_900, 803_000, -719_529, "times are days since year 0, as MATLAB counts them"),
)


@dataclass(frozen=True)
class Count:
    """scale: ns a unit. origin_ns: since 1970, of its zero; None: since a start that is not told. rounding_ns: to which
    times are rounded."""

    scale: float
    origin_ns: int | None = 0
    rounding_ns: int = 100
    notes: tuple[str, ...] = ()


def are_stamps_of_digits(sample: Sequence[str]) -> bool:
    """But for damaged ones."""
    return sum(map(bool, map(STAMP_OF_DIGITS.fullmatch, sample))) >= _MOST_STAMPS * len(sample)


def find_count(sample: Sequence[str], name: str) -> Count | None:
    """Of a column from some of its fields and its name; None where they can be no times, or where those of a date are
    written so short that seconds are lost, as 1.772402E+09. A unit in the name goes before the size of the numbers, but
    where these are a date of our time in another one."""
    texts = [text.replace(",", ".") for text in sample if NUMBER.fullmatch(text)]
    values = np.array([float(text) for text in texts])
    middle = float(np.median(values))
    if re.fullmatch(r"(19|20)\d{12}", sample[0]) or are_stamps_of_digits(sample):
        return None
    if _NAME_OF_DATES.fullmatch(name) and all(map(_DATE_OF_DIGITS.fullmatch, sample)):
        return None
    unit = told_unit(name)
    if unit is not None and middle * unit.seconds <= LEAST_EPOCH_S:
        dates = _belied(values, unit) or _millionths_of_days(values, texts, unit) or _days(values, texts, name, unit)
        return dates or _relative(name, unit)
    for low, high, zero_s, note in _TICKS:
        if low < middle < high:
            return _sharp(Count(TICK_NS, zero_s * NS_PER_S, 10_000, (note,)), texts)
    for above, scale in _EPOCH_UNITS:
        if middle > above:
            return _sharp(Count(scale, 0, EPOCH_ROUNDING_NS), texts) if middle < above * 100 else None
    return _days(values, texts, name, unit) or _relative(name, unit)


def _belied(values: FloatArray, unit: ToldUnit) -> Count | None:
    """Of numbers that are dates of our time in a coarser unit than the name tells, with steps as a loop's: as a span
    they would begin days from zero, with steps of a tenth of a second at most."""
    middle, steps = float(np.median(values)), np.diff(np.unique(values))
    step = float(np.median(steps)) if len(steps) else np.inf
    for (_, scale), word in zip(_EPOCH_UNITS, _EPOCH_WORDS, strict=True):
        seconds = scale / NS_PER_S
        ours = OURS_FROM_S < middle * seconds < OURS_TO_S and step * seconds <= LONGEST_STEP_S
        if ours and unit.seconds < seconds:
            note = f"times are {word} since 1970 by their size, though their column's name tells {unit.word}"
            return Count(scale, 0, EPOCH_ROUNDING_NS, (note,))
    return None


def _millionths_of_days(values: FloatArray, texts: list[str], unit: ToldUnit) -> Count | None:
    """What WinCC calls Time_ms: of our time, with fractions, which a count of ms from a start a year ago has not. Under
    another name, as Uptime [ms] is, it may have."""
    zero = _DAYS[0][2]
    seconds = (values / 1e6 + zero) * NS_PER_DAY / NS_PER_S
    ours = np.all((seconds > OURS_FROM_S) & (seconds < OURS_TO_S))
    if unit.seconds != 1e-3 or unit.bare != "time" or not ours or np.mean(values % 1 > 0.0) < 0.5:
        return None
    note = f"times are millionths of days since 1899-12-30, as WinCC counts them, though their name tells {unit.word}"
    step_ns = _step_ns(MILLIONTH_OF_DAY_NS, texts)
    return Count(MILLIONTH_OF_DAY_NS, zero * NS_PER_DAY, _rounding_ns(step_ns), (note,))


def _step_ns(unit_ns: float, texts: list[str]) -> float:
    """One of the last digit that is written of such units."""
    return unit_ns / 10.0 ** max(len(text.partition(".")[2]) for text in texts)


def _rounding_ns(step_ns: float) -> int:
    """To a power of ten that the last digits tell."""
    return min(max(10 ** int(np.ceil(np.log10(step_ns))), FINEST_NS), COARSEST_NS)


def _sharp(count: Count, texts: list[str]) -> Count | None:
    """None where not even seconds are written: `1.772402E+09`, as spreadsheets and C show numbers with few digits. What
    is written as 1.7724e9 has all its digits."""
    cut = [found for text in texts if (found := _FEW_DIGITS.fullmatch(text))]
    if not cut:
        return count
    step = min(10.0 ** (int(found["exponent"]) - len(found["decimals"] or "")) for found in cut)
    return count if step * count.scale <= NS_PER_S else None


def _days(values: FloatArray, texts: list[str], name: str, unit: ToldUnit | None) -> Count | None:
    for low, high, zero, note in _DAYS:
        if low < float(np.median(values)) < high and _steps_are_of_days(values, name, unit):
            step_ns = _step_ns(NS_PER_DAY, texts)
            cut = (f"times are written to {step_ns / NS_PER_S:.3g} s only",) if step_ns > NS_PER_S else ()
            note = _with_1904(_first_between(low, high, values) + zero) if note == _OF_SPREADSHEETS else note
            return Count(float(NS_PER_DAY), zero * NS_PER_DAY, _rounding_ns(step_ns), (note, *cut))
    return None


def _first_between(low: float, high: float, values: FloatArray) -> float:
    """A first row may hold anything."""
    between = values[(low < values) & (values < high)]
    return float(between[0] if len(between) else np.median(values))


def _with_1904(first_day: float) -> str:
    here, there = (np.datetime64(int(first_day) + days, "D") for days in (0, _DAYS_FROM_1904))
    return f"{_OF_SPREADSHEETS}: the first one is of {here} ({there} where the workbook counts from 1904)"


def _steps_are_of_days(values: FloatArray, name: str, unit: ToldUnit | None) -> bool:
    """By their fractions and their step, where the name does not tell another unit."""
    if not np.any(values % 1) or (unit and unit.seconds * NS_PER_S != NS_PER_DAY):
        return False
    steps = np.diff(np.unique(values))  # a long table has a stamp once a tag
    step = float(np.median(steps)) if len(steps) else np.inf
    dated = re.search(r"date|stamp", name, re.IGNORECASE) is not None
    return step < (0.5 if dated or unit else SHORTEST_STEP_S)


def _relative(name: str, unit: ToldUnit | None) -> Count:
    """Seconds, where the name tells no other unit."""
    if unit is not None:
        notes = () if unit.seconds == 1.0 else (f"times are in {unit.word} by the column's name",)
        return Count(unit.seconds * NS_PER_S, None, notes=notes)
    odd = "" if told_utc_offset_ns(name) is not None else unknown_unit(name)
    note = f"{odd[:80]!r} in the name of the times is no unit that is known: they were read as seconds"
    return Count(float(NS_PER_S), None, notes=(note,) if odd else ())
