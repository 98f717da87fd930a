"""Whether a swing's corners come from outside: PV turns by itself, and not where OP has gone far enough.

A valve that sticks lets go where OP has travelled by its band since it last turned, however long that takes, and what
PV does next follows from its stem. Where a load goes to and fro elsewhere (a pump, a batch, a neighbour's valve), the
valve follows OP: what PV did tells which way the load goes, better than a stem does that only OP moves, and the load's
own time repeats, not the travel of OP that answers it.
"""

from dataclasses import dataclass

import numpy as np

from app.engine.causality.own_cycle import cycle_stems, in_a_cycle, turned_stems
from app.engine.causality.stem_search import asked_of, moving_part
from app.engine.features.travel import reversals
from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.sampled import deviation

FEWEST_SAMPLES = 30
"""Samples a cycle: in coarser ones the means hold too much of a cycle for a stem to tell what PV does next."""

FEWEST_CYCLES = 8
"""In fewer, how much a stem tells over PV's turns is chance: of 20 textbook limit cycles with fewer 5 looked as if they
came from outside, of 44 with more none."""

FEWEST_LEGS = 6
LEG_SHARE = 0.5
"""Of what OP moves in a cycle, by which it has to come back for a leg to end: less is noise."""

LEAST_SPREAD = 0.01
"""Of the logarithms of travels and times, below which neither is told from rounding."""

LEAST_RATIO = 1.5
"""Of 544 simulated loops whose valves stick and that all else relies on 1.5 % are below it, of 356 healthy ones under
loads in corners 44 %."""


@dataclass(frozen=True)
class OutsideCorners:
    """stem_over_turns: nats of PV that the best stem tells, over what the best of PV's own turns tells, a nat added to
    each; of the stride on which it is greatest. time_over_travel: spread of the times of OP's legs between its turns
    over the spread of its travels, each as the standard deviation of the logarithms beside the median of its direction.
    """

    stem_over_turns: float
    time_over_travel: float

    @property
    def ratio(self) -> float:
        """Of the valve to what is outside, by both: small where neither speaks for the valve."""
        return float(self.stem_over_turns * np.sqrt(self.time_over_travel))

    @property
    def shown(self) -> bool:
        return self.ratio < LEAST_RATIO


def outside_corners(record: UniformRecord, period_s: float) -> OutsideCorners | None:
    """Whether what shapes PV and OP of a loop that cycles with this period is likelier outside than its valve.

    None where a cycle has fewer than FEWEST_SAMPLES samples, the record fewer than FEWEST_CYCLES of them, OP fewer than
    FEWEST_LEGS legs, or too little is recorded.
    The travel's spread counts half, in logarithms, as a logistic of the two on simulated loops weighs them.
    Misleads: loads of one and the same height, and what switches between two levels upstream, repeat the travel of OP
    as a stem does; a valve that sticks in few cycles under a load that turns in corners itself may look so.
    Source: foretelling as in Granger 1969, doi 10.2307/1912791, of stems as in Kano et al. 2004, Practical model and
    detection algorithm for valve stiction.
    """
    moving = moving_part(record)
    if moving is None:
        return None
    period = period_s / moving.sampling_interval_s
    if period < FEWEST_SAMPLES or moving.samples < FEWEST_CYCLES * period:
        return None
    legs = _time_over_travel(moving.op, in_a_cycle(moving.op, period))
    ratio = None if legs is None else _stem_over_turns(moving, period)
    return None if legs is None or ratio is None else OutsideCorners(ratio, legs)


def _stem_over_turns(moving: UniformRecord, period: float) -> float | None:
    moved, turned = cycle_stems(moving.op, period), turned_stems(moving.pv)
    found = []
    for asked in asked_of(moving):
        stem, turns = (float(asked.most_worth(signals)[1].sum()) for signals in (moved, turned))
        found.append((stem + 1.0) / (turns + 1.0))
    return max(found, default=None)


def _time_over_travel(op: FloatArray, moves: float) -> float | None:
    """moves: how far OP (N,) mostly moves within a cycle."""
    unit = float(deviation(op))
    ends = reversals(op / unit, LEG_SHARE * moves / unit)
    if len(ends) <= FEWEST_LEGS:
        return None
    times, travels = np.diff(ends).astype(np.float64), np.abs(np.diff(op[ends]))
    return (_spread(times) + LEAST_SPREAD) / (_spread(travels) + LEAST_SPREAD)


def _spread(legs: FloatArray) -> float:
    """Of the logarithms of legs (n,), up and down in turn, each beside the median of its direction."""
    logarithms = np.log(legs)
    ways = (logarithms[0::2], logarithms[1::2])
    return float(np.std(np.concatenate([way - np.median(way) for way in ways])))
