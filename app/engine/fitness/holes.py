"""Holes in a recording, and the stretch between two of them that is audited."""

from dataclasses import dataclass

import numpy as np

from app.engine.fitness.config import FitnessConfig
from app.engine.fitness.resample import lasting, most_filled, to_uniform
from app.engine.fitness.signals import newest_long
from app.engine.recording import FloatArray, UniformRecord


@dataclass(frozen=True)
class Unbroken:
    """The samples of the newest long stretch without a hole, how many holes the whole has, and from how many sampling
    intervals on they are none that is filled.
    """

    samples: slice
    holes: int
    most_filled: float


def newest_without_hole(time_s: FloatArray, config: FitnessConfig) -> Unbroken:
    """Of samples at `time_s` (N,), N > 1, in s: a hole is longer than what is filled."""
    most = most_filled(len(time_s), config)
    holes = np.flatnonzero(np.diff(time_s) > lasting(most, time_s))
    edges = np.concatenate(([0], holes + 1, [len(time_s)]))
    return Unbroken(newest_long(edges[:-1], edges[1:], config.newest_share, config.min_samples), len(holes), most)


def newest_even(
    time_s: FloatArray, pv: FloatArray, op: FloatArray, fewest: int, config: FitnessConfig
) -> UniformRecord | None:
    """The newest long stretch without a hole on a uniform time base, as an audit takes it; None where it has fewer than
    `fewest` samples.

    time_s: (N,) s, increasing; the record begins by this clock. pv, op: (N,) finite, in engineering units.
    """
    if len(time_s) < fewest:
        return None
    whole = newest_without_hole(time_s, config).samples
    time_s = time_s[whole]
    if len(time_s) < fewest:
        return None
    return to_uniform(time_s, pv[whole], op[whole], None, 0.0, config)
