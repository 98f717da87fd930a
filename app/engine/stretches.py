"""The stretch that speaks for a long record: one of several that are judged each by itself, the middle one of them.

Over days the load wanders, a unit stands still for a shift, set points are moved: that is the strongest movement of
the whole, and a limit cycle of minutes within it is neither its oscillation nor its shape. Within an hour it is.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from app.engine.fitness import Whole
from app.engine.fitness.signals import newest_long_run, run_lengths
from app.engine.oscillation import Oscillation, detect
from app.engine.recording import IntArray, UniformRecord
from app.engine.verdict import weigh

LONG_SAMPLES = 2000
"""Samples above which a record is judged by stretches."""

NEWEST_SAMPLES = 5000
"""Samples on which a model of the loop is identified, at most."""

# Chosen on simulated loops under loads that wander (`testbench.days`); what swings is as an episode's windows ask.
_PARTS = (6, 12, 24, 48)  # into which a record is cut, each of at least so many samples, a dozen of them looked at
_LEAST_PART, _MOST_LOOKED_AT = 400, 12
_SWINGING_SHARE = 2.0 / 3.0
_REGULAR_STRENGTH, _IRREGULAR_STRENGTH, _FEWEST_CYCLES = 0.2, 0.3, 5.0
_LEAST_PER_CYCLE = 5.0
# Cycles of a stretch, as a window of the shapes has them, and its samples at least.
_CYCLES, _LEAST_STRETCH = 15.0, 600
_FEWEST, _MOST = 3, 7
_CLOSER = 3  # so many times as many stretches are tried where some stand still
_DEAD_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Stretch:
    """record: the stretch. oscillation: its own. whole: what it speaks for."""

    record: UniformRecord
    oscillation: Oscillation
    whole: Whole


def speaking_stretch(record: UniformRecord, oscillation: Oscillation) -> Stretch | None:
    """The stretch whose log-odds of stiction are the middle ones of up to seven spread over a long record; None where
    the record is not long, where no scale is found on which most of it swings, or where fewer than three are left.

    oscillation: of the whole. A stretch has some fifteen cycles of the scale on which the parts of the record swing
    most clearly; what stands still for half of its time (a unit that is shut down) is not judged. Misleads where a
    valve sticks for less than half of the time: that is for the episodes to say.
    """
    if record.samples <= LONG_SAMPLES:
        return None
    per_cycle = cycle_of_parts(record) or (oscillation.samples_per_cycle if oscillation.regular else None)
    if per_cycle is None:
        return None
    stands = _standing(record)
    parts = _spread(record, per_cycle, _MOST)
    moving = [part for part in parts if not _touches(stands, part)]
    standing = len(parts) - len(moving)
    if standing:
        more = [part for part in _spread(record, per_cycle, _CLOSER * _MOST) if not _touches(stands, part)]
        moving = [more[k] for k in _evenly(len(more), _MOST)]
    weighed = [found for part in moving if (found := _weighed(record.part(part))) is not None]
    if len(weighed) < _FEWEST or _dead_at_its_end(record):
        return None
    middle = sorted(weighed, key=lambda one: one.log_odds)[(len(weighed) - 1) // 2]
    sides = [(one.log_odds > 0.0) == (middle.log_odds > 0.0) for one in weighed]
    whole = Whole(record, oscillation, sum(sides), len(sides), any(sides[-2:]), standing)
    return Stretch(middle.record, middle.oscillation, whole)


def newest(record: UniformRecord, max_samples: int) -> UniformRecord:
    """The newest `max_samples` of a record, or all of it where it has no more."""
    first = record.samples - max_samples
    if first <= 0:
        return record
    return record.part(slice(first, None))


def newest_moving(record: UniformRecord, max_samples: int) -> UniformRecord:
    """The newest stretch of up to `max_samples` in which OP nowhere stands still for long, as where a unit is shut down
    or a loop is in manual; the longest where none has half of that.

    All of a record that has no more. Where OP hardly moves without standing still, the newest `max_samples` in which it
    moves, or the newest of all: a PV that stands still against an OP that moves is what is to be said.
    """
    if record.samples <= max_samples:
        return record
    moving = newest_long_run(run_lengths(record.op) < _LEAST_STRETCH, 0.0, max_samples // 2)
    if moving.stop - moving.start >= max_samples // 5:
        return newest(record.part(moving), max_samples)
    blocks = (newest(record.part(slice(0, last)), max_samples) for last in range(record.samples, 0, -max_samples))
    return next((block for block in blocks if np.ptp(block.op) > 0.0), newest(record, max_samples))


def _dead_at_its_end(record: UniformRecord) -> bool:
    """Whether PV has stood still for a stretch up to the end of the record while OP moved: that comes first."""
    still = int(run_lengths(record.pv)[-1])
    return still >= _LEAST_STRETCH and float(np.ptp(record.op[-still:])) > 0.0


def cycle_of_parts(record: UniformRecord) -> float | None:
    """Samples a cycle on the scale on which the parts of a record swing most clearly; None where most do not swing.

    The record is cut into 6 to 48 parts, of which a dozen are looked at, without those that stand still; the number of
    parts counts whose median oscillation is the strongest and most regular.
    """
    best, per_cycle, stands = 0.0, None, _standing(record)
    for count in _PARTS:
        if record.samples // count < _LEAST_PART:
            break
        found = [detect(record.part(part)) for part in _parts(record, count) if not _touches(stands, part)]
        if len(found) < _FEWEST:
            continue
        swinging = [one for one in found if _swings(one)]
        if len(swinging) < _SWINGING_SHARE * len(found):
            continue
        clear = float(np.median([one.clarity for one in swinging])) * len(swinging) / len(found)
        if clear > best:
            best, per_cycle = clear, float(np.median([one.samples_per_cycle for one in swinging]))
    return per_cycle


def _parts(record: UniformRecord, count: int) -> Iterator[slice]:
    length = record.samples // count
    for k in _evenly(count, _MOST_LOOKED_AT):
        yield slice(k * length, (k + 1) * length)


def _standing(record: UniformRecord) -> IntArray:
    """(N,) for how many samples in a row PV or OP, whichever does longer, holds the value that it has there."""
    return np.maximum(run_lengths(record.pv), run_lengths(record.op))


def _touches(stands: IntArray, part: slice) -> bool:
    """Whether PV or OP holds one value for half as long as a part is, in it or across its edge: a unit that is shut
    down, a loop in manual.
    """
    return bool(stands[part].max() >= _DEAD_SHARE * (part.stop - part.start))


def _swings(oscillation: Oscillation) -> bool:
    enough = oscillation.swings(_REGULAR_STRENGTH, _IRREGULAR_STRENGTH, _FEWEST_CYCLES)
    return enough and (oscillation.samples_per_cycle or 0.0) >= _LEAST_PER_CYCLE


def _spread(record: UniformRecord, per_cycle: float, most: int) -> list[slice]:
    """At most so many stretches from the record's start to its end, each overlapping the next by half, or by all but a
    sixth where the record is short for more than _MOST.
    """
    length = int(np.clip(_CYCLES * per_cycle, _LEAST_STRETCH, record.samples))
    count = min(most, most // _MOST * (2 * (record.samples // length) - 1))
    starts = np.linspace(0, record.samples - length, count).astype(int).tolist()
    return [slice(start, start + length) for start in starts]


def _evenly(count: int, most: int) -> list[int]:
    """At most so many of 0 to count - 1, spread over them."""
    return sorted({round(k) for k in np.linspace(0, count - 1, min(count, most)).tolist()})


@dataclass(frozen=True, eq=False)
class _Weighed:
    record: UniformRecord
    oscillation: Oscillation
    log_odds: float


def _weighed(part: UniformRecord) -> _Weighed | None:
    oscillation = detect(part)
    weighing = weigh(part, oscillation)
    return None if weighing is None else _Weighed(part, oscillation, weighing.log_odds)
