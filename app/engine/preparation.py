"""What of a recording is judged: its fit stretch with its oscillation, the rest of a set point that hides one, or the
stretch that speaks for a long record."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.features import at_rest
from app.engine.fitness import Fitness, FitnessConfig, assess, with_cycles
from app.engine.long_records.stretches import speaking_stretch
from app.engine.oscillation import Oscillation, detect
from app.engine.recording import FloatArray, Recording, UniformRecord
from app.engine.verdict.shape_model import ShapeModel

# A part is judged for the whole only where it swings beyond doubt.
_STRONG_SWING, _FEWEST_CYCLES = 0.6, 5.0
# PV and OP have settled where they stay within their later range, widened by this share.
_WIDER = 0.1


@dataclass(frozen=True, eq=False)
class Preparation:
    """One recording, ready to be judged.

    fitness: of the stretch that is judged. oscillation: in it; None where the recording is not auditable.
    rest_of: the stretch of which only the rest of its set point is judged; None where it is not.
    """

    fitness: Fitness
    oscillation: Oscillation | None
    rest_of: UniformRecord | None = None


def prepare(recording: Recording, config: FitnessConfig | None = None, model: ShapeModel | None = None) -> Preparation:
    """The fitness checks, the oscillation, and the stretch that shows it best.

    A step of the set point much larger than a limit cycle makes most of what PV and OP do: where the set point rests
    for long and the loop cycles meanwhile, the rest is judged alone, from when PV and OP have settled. Misleads as any
    judgement of a part does: what the valve did in the remainder is not looked at. model: by which a stretch of a long
    record is the middle one; the shipped one where None.
    """
    fitness = assess(recording, config)
    if fitness.record is None or not fitness.auditable:
        return Preparation(with_cycles(fitness, None, config), None)
    rest = _settled_rest(fitness.record)
    alone = None if rest is None else _alone(recording, rest, fitness, config)
    if alone is not None:
        return replace(alone, rest_of=fitness.record)
    oscillation = detect(fitness.record)
    spoken_for = _spoken_for(fitness, oscillation, config, model)
    return spoken_for or Preparation(with_cycles(fitness, oscillation, config), oscillation)


def _spoken_for(
    fitness: Fitness, oscillation: Oscillation, config: FitnessConfig | None, model: ShapeModel | None
) -> Preparation | None:
    """The stretch of a long record that is judged for it, where there is one."""
    stretch = speaking_stretch(fitness.audited, oscillation, model)
    if stretch is None:
        return None
    part = replace(fitness, record=stretch.record, speaks_for=stretch.whole)
    own = with_cycles(part, stretch.oscillation, config)
    return Preparation(own, stretch.oscillation) if own.auditable else None


def _settled_rest(whole: UniformRecord) -> UniformRecord | None:
    rest = at_rest(whole)
    if rest is None or rest.start_s == whole.start_s:
        return rest
    return rest.part(slice(max(_settled_from(rest.pv), _settled_from(rest.op)), None))


def _settled_from(x: FloatArray) -> int:
    """The sample of the first half of x (n,) from which on it stays within its range in the second."""
    half = len(x) // 2
    low, high = float(np.min(x[half:])), float(np.max(x[half:]))
    margin = _WIDER * (high - low)
    outside = np.flatnonzero((x[:half] < low - margin) | (x[:half] > high + margin))
    return int(outside[-1]) + 1 if len(outside) else 0


def _alone(
    recording: Recording, rest: UniformRecord, fitness: Fitness, config: FitnessConfig | None
) -> Preparation | None:
    """The rest as a recording of its own, where it is fit and cycles; None where it does not."""
    oscillation = detect(rest)
    if not _can_be_limit_cycle(oscillation):
        return None
    part = _between(recording, rest.start_s, rest.end_s)
    own = assess(part, config)
    if own.record is None:
        return None
    start_s = own.record.start_s + float(part.time_s[0] - recording.time_s[0])
    # Findings, record and what was filled are the rest's; what is missing, and how all of it ended, is the recording's.
    record = replace(own.record, start_s=start_s)
    own = replace(fitness, findings=own.findings, record=record, filled_share=own.filled_share)
    oscillation = detect(own.audited)
    own = with_cycles(own, oscillation, config)
    return Preparation(own, oscillation) if own.auditable and _can_be_limit_cycle(oscillation) else None


def _between(recording: Recording, start_s: float, end_s: float) -> Recording:
    """The samples of a recording from `start_s` to before `end_s`, in seconds from its first sample."""
    since = recording.time_s - recording.time_s[0]
    first, last = np.searchsorted(since, [start_s, end_s])
    return recording.part(slice(int(first), int(last)))


def _can_be_limit_cycle(oscillation: Oscillation) -> bool:
    return oscillation.regular and oscillation.strength >= _STRONG_SWING and oscillation.cycles >= _FEWEST_CYCLES
