"""In which order day, month and year stand in dates of digits alone, where several orders can be read."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.ingest.model import IngestOptions, TimeArray
from app.nanoseconds import NS_PER_DAY, NS_PER_S

DAY_FIRST = ("%d/%m/%Y", "%d/%m/%y", "%d-%m-%Y", "%d-%m-%y")
MONTH_FIRST = ("%m/%d/%Y", "%m/%d/%y", "%m-%d-%Y", "%m-%d-%y")
YEAR_FIRST = ("%y/%m/%d", "%y-%m-%d")
AMBIGUOUS = (*DAY_FIRST, *MONTH_FIRST, *YEAR_FIRST)
CLOCKS_APART_NS = NS_PER_DAY  # another clock, another zone
_DATE = 8  # characters of a format
EXAMPLES = {"day": "03/04/2026 is 3 April", "month": "03/04/2026 is 4 March", "year": "26/04/03 is 3 April 2026"}


@dataclass(frozen=True, eq=False)
class Reading:
    """A sample of stamps as a format gives them, in order of the rows; `read` (n,): those that it can read."""

    format: str
    times: TimeArray
    read: NDArray[np.bool_]


@dataclass(frozen=True)
class Chosen:
    """The format to read, those of other orders that fit as well, and what is to be said of that."""

    format: str
    rivals: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def in_other_order(format_: str) -> str:
    """The same with day and month exchanged; empty where not both stand first, or their order is told."""
    orders = {**dict(zip(DAY_FIRST, MONTH_FIRST, strict=True)), **dict(zip(MONTH_FIRST, DAY_FIRST, strict=True))}
    return next((other + format_[len(own) :] for own, other in orders.items() if format_.startswith(own)), "")


def choose(readings: Sequence[Reading], options: IngestOptions) -> Chosen:
    """The first reading in the order that was said; else of those that are not ahead of the clock, if any, the one in
    which time runs most evenly."""
    common = np.logical_and.reduce([reading.read & _runs_on(reading.times) for reading in readings])
    unevenness = {reading.format: _unevenness(reading, common) for reading in readings}
    said = [reading for reading in readings if options.day_first is not None and _is_said(reading, options)]
    if said and not any(_tells_more(reading, said[0], unevenness) for reading in readings):
        return Chosen(said[0].format)
    past = [reading for reading in readings if not _ahead(reading, options)] or list(readings)
    ranked = sorted(past, key=lambda reading: unevenness[reading.format])
    chosen = ranked[0]
    rivals = _others([*ranked[1:], *(reading for reading in readings if reading not in past)], chosen)
    if not rivals:
        return Chosen(chosen.format, notes=_unlike_said(chosen, options))
    why = "nothing in the file tells"
    if not _others(past, chosen):
        why = "read otherwise, times lie ahead of the clock"
    elif unevenness[ranked[1].format] > unevenness[chosen.format]:
        why = "time runs forward most evenly so"
    note = f"dates were read {_example(chosen.format)}, because {why}; {_otherwise(rivals, readings, chosen)}"
    return Chosen(chosen.format, rivals, (*_unlike_said(chosen, options), note))


def _first(format_: str) -> str:
    """What stands first in it."""
    return "day" if format_.startswith(DAY_FIRST) else "month" if format_.startswith(MONTH_FIRST) else "year"


def _example(format_: str) -> str:
    return f"{(first := _first(format_))} first ({EXAMPLES[first]})"


def _otherwise(rivals: Sequence[str], readings: Sequence[Reading], chosen: Reading) -> str:
    """How else they can be read, and how that is asked for: that the year stands first cannot be said, so what the
    first date was read as is told."""
    sayable = [first for first in map(_first, rivals) if first != "year"]
    if sayable:
        return f"`--date-order {sayable[0]}` reads them the other way"
    year_first = next(reading for reading in readings if reading.format == rivals[0])
    at = np.flatnonzero(chosen.read & year_first.read)
    if not len(at):
        return "the year may stand first too"
    here, there = (str(reading.times[at[0]].astype("datetime64[ns]"))[:10] for reading in (chosen, year_first))
    return f"check this first, the year may stand first too: the first one was read as {here}, and is {there} then"


def _is_said(reading: Reading, options: IngestOptions) -> bool:
    return reading.format.startswith(DAY_FIRST if options.day_first else MONTH_FIRST)


def _unlike_said(chosen: Reading, options: IngestOptions) -> tuple[str, ...]:
    if options.day_first is None:
        return ()
    said = "day" if options.day_first else "month"
    return (f"the {said} was said to stand first, but more dates can be read as {chosen.format}",)


def _ahead(reading: Reading, options: IngestOptions) -> bool:
    if options.now_ns is None or not reading.read.any():
        return False
    return int(reading.times[reading.read].max()) > options.now_ns + CLOCKS_APART_NS


def _others(readings: Sequence[Reading], chosen: Reading) -> tuple[str, ...]:
    return tuple(reading.format for reading in readings if reading.format[:_DATE] != chosen.format[:_DATE])


def _tells_more(reading: Reading, other: Reading, unevenness: Mapping[str, tuple[int, int]]) -> bool:
    """Whether one reads more stamps than another, which are no damaged ones: time runs on in them."""
    more = int(np.sum(reading.read)) > int(np.sum(other.read))
    return more and unevenness[reading.format][0] < unevenness[other.format][0]


def _runs_on(times: TimeArray) -> NDArray[np.bool_]:
    """Which stamps do not jump away from those around them and back."""
    ways = np.sign(np.diff(times.astype(np.float64)))
    return np.concatenate(([True], ways[1:] * ways[:-1] >= 0, [True]))[: len(times)]


def _unevenness(reading: Reading, common: NDArray[np.bool_]) -> tuple[int, int]:
    """Steps backward and stamps that are not read, then the span of those that run on in any order: the wrong order
    of day and month makes time jump, and so does a damaged stamp that is read in it."""
    steps = np.diff(reading.times[reading.read])
    backward = min(int(np.sum(steps < 0)), int(np.sum(steps > 0)))
    span = np.sum(np.abs(np.diff(reading.times[common])))
    return backward + int(np.sum(~reading.read)), int(span // NS_PER_S)
