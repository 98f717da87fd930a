"""The stretch that speaks for a long record: one of several that are judged each by itself, the middle one of them.

Over days the load wanders, a unit stands still for a shift, set points are moved: that is the strongest movement of
the whole, and a limit cycle of minutes within it is neither its oscillation nor its shape. Within an hour it is.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from app.engine.fitness import Whole
from app.engine.fitness.signals import newest_long_run, run_lengths, standing, still_at_its_end
from app.engine.oscillation import Oscillation, detect
from app.engine.recording import IntArray, UniformRecord
from app.engine.signals.sampled import blocks, slow_share, unlike
from app.engine.verdict.shape_model import ShapeModel
from app.engine.verdict.weighing import weigh

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
# Cycles of a block, and the share of the variance that lies between blocks: of OP at least, of PV at most.
_BLOCK_CYCLES, _OP_WORKS, _PV_HELD = 2.0, 0.5, 0.25
_CLOSER = 3  # so many times as many stretches are tried where some stand still
_DEAD_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Stretch:
    """record: the stretch. oscillation: its own. whole: what it speaks for."""

    record: UniformRecord
    oscillation: Oscillation
    whole: Whole


def speaking_stretch(
    record: UniformRecord, oscillation: Oscillation, model: ShapeModel | None = None
) -> Stretch | None:
    """The stretch whose log-odds of stiction are the middle ones of up to seven spread over a long record; None where
    the record is not long, where no scale is found to judge it on, or where fewer than three are left.

    oscillation: of the whole. A stretch has some fifteen cycles of the scale on which the parts of the record swing
    most clearly; what stands still for half of its time (a unit that is shut down) is not judged. Where most of it does
    not swing on any scale, and the whole has the few cycles of its load alone, it is the scale of what swings faintly,
    where that says no stiction and the valve answers: a limit cycle would swing. Misleads where a valve sticks for less
    than half of the time: that is for the episodes to say. model: of the shapes; the shipped one where None.
    """
    if record.samples <= LONG_SAMPLES:
        return None
    scale = scale_of(record, oscillation)
    if scale is None:
        return None
    per_cycle, stands = scale.per_cycle, standing(record.pv, record.op)
    if scale.quiet and not _held_against_load(record, per_cycle, stands):
        return None
    parts = _spread(record, per_cycle, _MOST)
    moving = [part for part in parts if not _touches(stands, part)]
    left_out = len(parts) - len(moving)
    if left_out:
        more = [part for part in _spread(record, per_cycle, _CLOSER * _MOST) if not _touches(stands, part)]
        moving = [more[k] for k in _evenly(len(more), _MOST)]
    weighed = [found for part in moving if (found := _weighed(record.part(part), model)) is not None]
    cycling = [one for one in weighed if one.oscillation.cycles >= _FEWEST_CYCLES]
    if scale.quiet and len(cycling) >= _FEWEST:  # the load's few cycles say as little in a stretch as in the whole
        weighed = cycling
    if len(weighed) < _FEWEST or _dead_at_its_end(record):
        return None
    middle = sorted(weighed, key=lambda one: one.log_odds)[(len(weighed) - 1) // 2]
    if scale.quiet and middle.log_odds > 0.0:
        return None
    sides = [(one.log_odds > 0.0) == (middle.log_odds > 0.0) for one in weighed]
    whole = Whole(record, oscillation, sum(sides), len(sides), any(sides[-2:]), left_out)
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
    return still_at_its_end(record.pv, record.op)[0] >= _LEAST_STRETCH


@dataclass(frozen=True)
class Scale:
    """On which a long record is judged. per_cycle: samples a cycle. quiet: whether most of the record does not swing on
    it, nor on any other.
    """

    per_cycle: float
    quiet: bool = False


def scale_of(record: UniformRecord, oscillation: Oscillation) -> Scale | None:
    """The scale on which the parts of a record swing most clearly; where most do not swing, that of the whole (whose
    oscillation this is) if it is regular, or of what swings faintly if the whole has few cycles.
    """
    looked_at = _oscillations(record)
    if (per_cycle := _cycle_of_most(looked_at)) is not None:
        return Scale(per_cycle)
    if oscillation.cycles < _FEWEST_CYCLES:
        per_cycle = _cycle_of_all(looked_at)
        return None if per_cycle is None else Scale(per_cycle, quiet=True)
    if oscillation.regular and oscillation.samples_per_cycle is not None:
        return Scale(oscillation.samples_per_cycle)
    return None


def _oscillations(record: UniformRecord) -> list[list[Oscillation]]:
    """The record cut into 6 to 48 parts, a list for each number of parts: of a dozen, without what stands still."""
    stands, looked_at = standing(record.pv, record.op), []
    for count in _PARTS:
        if record.samples // count < _LEAST_PART:
            break
        found = [detect(record.part(part)) for part in _parts(record, count) if not _touches(stands, part)]
        if len(found) >= _FEWEST:
            looked_at.append(found)
    return looked_at


def _cycle_of_most(looked_at: list[list[Oscillation]]) -> float | None:
    """The number of parts counts whose median oscillation is the strongest and most regular, where most swing."""
    best, per_cycle = 0.0, None
    for parts in looked_at:
        swinging = [one for one in parts if _swings(one)]
        if len(swinging) < _SWINGING_SHARE * len(parts):
            continue
        clear = _clarity(swinging) * len(swinging) / len(parts)
        if clear > best:
            best, per_cycle = clear, _per_cycle(swinging)
    return per_cycle


def _cycle_of_all(looked_at: list[list[Oscillation]]) -> float | None:
    """The same where most do not swing, of what has its cycles in a part, however faint it is."""
    best, per_cycle = 0.0, None
    for parts in looked_at:
        faint = [one for one in parts if one.cycles >= _FEWEST_CYCLES and _is_sampled(one)]
        if len(faint) >= _FEWEST and (clear := _clarity(faint)) > best:
            best, per_cycle = clear, _per_cycle(faint)
    return per_cycle


def _held_against_load(record: UniformRecord, per_cycle: float, stands: IntArray) -> bool:
    """Whether OP goes its way against a load while PV is held: a valve that stands fast lets PV go with the load, and
    where OP has no way to go nothing is known of it.
    """
    length = int(_BLOCK_CYCLES * per_cycle)
    moving = blocks(stands, length).max(axis=1) < _DEAD_SHARE * length
    if np.count_nonzero(moving) < _FEWEST:
        return False
    held = record.pv if record.sp is None else unlike(record.pv, record.sp)
    op, pv = (slow_share(blocks(signal, length)[moving]) for signal in (record.op, held))
    return op >= _OP_WORKS and pv <= _PV_HELD


def _clarity(oscillations: list[Oscillation]) -> float:
    return float(np.median([one.clarity for one in oscillations]))


def _per_cycle(oscillations: list[Oscillation]) -> float:
    return float(np.median([one.samples_per_cycle for one in oscillations]))


def _parts(record: UniformRecord, count: int) -> Iterator[slice]:
    length = record.samples // count
    for k in _evenly(count, _MOST_LOOKED_AT):
        yield slice(k * length, (k + 1) * length)


def _touches(stands: IntArray, part: slice) -> bool:
    """Whether PV or OP holds one value for half as long as a part is, in it or across its edge: a unit that is shut
    down, a loop in manual.
    """
    return bool(stands[part].max() >= _DEAD_SHARE * (part.stop - part.start))


def _swings(oscillation: Oscillation) -> bool:
    return oscillation.swings(_REGULAR_STRENGTH, _IRREGULAR_STRENGTH, _FEWEST_CYCLES) and _is_sampled(oscillation)


def _is_sampled(oscillation: Oscillation) -> bool:
    return (oscillation.samples_per_cycle or 0.0) >= _LEAST_PER_CYCLE


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


def _weighed(part: UniformRecord, model: ShapeModel | None) -> _Weighed | None:
    oscillation = detect(part)
    weighing = weigh(part, oscillation, model)
    return None if weighing is None else _Weighed(part, oscillation, weighing.log_odds)
