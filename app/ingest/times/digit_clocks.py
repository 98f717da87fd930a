"""Clocks behind a date that are written in digits alone, as 600, 0615 or 61500: HHMM or HHMMSS without their zeros."""

import re
from collections.abc import Sequence
from itertools import pairwise

import polars as pl

_DATE = (
    r"(?:\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{2,4}|\d{8}|\d{4}-\d{3}|\d{1,2}-[A-Za-z]{3}-\d{2,4})"
)
BEHIND_DATE = re.compile(rf"(?P<date>{_DATE}) (?P<clock>\d{{1,6}})")
HHMM, HHMMSS = 4, 6
"""Digits."""
UNKNOWN, IN_DOUBT = 0, -1
_FEWEST = 3  # digits of what is no hour
_MOST = 0.98  # of a sample; the others are damaged
ONE_WAY = 0.9  # of the steps within a day
_TOLD = re.compile(r"(?i)\bhh?:?mm(?P<seconds>:?ss)?\b")


def digits_told(name: str) -> int:
    """Of the clocks of a column by its name, as HHMM tells them."""
    told = _TOLD.search(name)
    return UNKNOWN if told is None else HHMMSS if told["seconds"] else HHMM


def digits_of(stamps: Sequence[str], told: int = UNKNOWN) -> int:
    """How many digits the clocks of stamps in the order of the rows have when whole: UNKNOWN where they are none,
    IN_DOUBT where 600 may be 6:00:00 or 0:06:00. Within a day nothing but a zero before it tells them apart; several
    days of which only the first 24 minutes are known are not sent. A clock of five digits among many shorter ones may
    be damaged."""
    found = _behind_dates(stamps)
    clocks = [match["clock"] for match in found]
    if max(map(len, clocks), default=0) < _FEWEST:
        return UNKNOWN
    longer = sum(len(clock) > HHMM for clock in clocks)
    if not told and 0 < longer <= (1.0 - _MOST) * len(clocks):
        return IN_DOUBT
    digits = told or (HHMMSS if longer else HHMM)
    if sum(_is_clock(clock, digits) for clock in clocks) < _MOST * len(clocks):
        return UNKNOWN
    padded = any(clock.startswith("0") and len(clock) == digits for clock in clocks)
    several_days = len({match["date"] for match in found}) > 1
    return digits if told or digits == HHMMSS or padded or several_days else IN_DOUBT


def _is_clock(text: str, digits: int) -> bool:
    whole = text.zfill(digits)
    hour, *others = (int(whole[at : at + 2]) for at in range(0, digits, 2))
    return len(whole) == digits and max(others) < 60 and (hour < 24 or (hour == 24 and not any(others)))


def go_one_way(stamps: Sequence[str]) -> bool:
    """Whether the clocks of stamps in the order of the rows go one way within a day, as those of values do not."""
    pairs = pairwise(_behind_dates(stamps))
    steps = [int(other["clock"]) - int(one["clock"]) for one, other in pairs if one["date"] == other["date"]]
    return not steps or (any(steps) and to_one_side(steps))


def to_one_side(steps: Sequence[float]) -> bool:
    """Whether nearly all steps, those that stand too, go to one side."""
    return max(sum(step >= 0 for step in steps), sum(step <= 0 for step in steps)) >= ONE_WAY * len(steps)


def _behind_dates(stamps: Sequence[str]) -> list[re.Match[str]]:
    return [match for stamp in stamps if (match := BEHIND_DATE.fullmatch(stamp))]


def with_clock(stamps: pl.Series, digits: int) -> pl.Series:
    """(n,) the same with 06:15:00 for 61500; what has more digits stays, and is no time."""
    parts = stamps.str.extract_groups(rf"^(?P<before>.*\d) (?P<clock>\d{{1,{digits}}})$").struct.unnest()
    whole = parts["clock"].str.zfill(digits)
    pairs = [whole.str.slice(at, 2) for at in range(0, digits, 2)]
    clocks = pl.select(pl.concat_str(pairs, separator=":").alias("clock")).to_series()
    spelled = pl.select(pl.concat_str((parts["before"], clocks), separator=" ")).to_series()
    return pl.select(pl.when(spelled.is_not_null()).then(spelled).otherwise(stamps)).to_series()
