"""How well a record tells the fitted numbers: 95 % intervals by slopes where the simulation is smooth, by trying other
numbers where it bends or jumps with them.
"""

import numpy as np

from app.engine.mismatch.fit.fitting import Fit, descend, residual_rows, slopes, task_of
from app.engine.mismatch.fit.task import Task
from app.engine.mismatch.judge.result import Estimate
from app.engine.recording import FloatArray

CHI2_95 = 3.84
_WEAKENED = 3.0
"""By how much less the cost of another moment or rate counts than if the cost were a parabola: it has many small
valleys, and the least of them is the best of many. Measured: docs/PROOF.md."""
_MOVES = (1.0, 1.5, 2.2, 3.3, 5.0, 7.5, 11.0, 17.0, 25.0)  # standard deviations by slopes
BETWEEN_SAMPLES = ("start", "end")  # what is there at a sample and was not before may have come at any time between
_FOLLOWING = 2  # descents of the other numbers at each


def deviations(found: Fit) -> FloatArray:
    """Standard deviation of each free number of a fit, from its whitened slopes; infinite where nothing hangs on it."""
    task = task_of(found)
    jacobian = slopes(task, found.x, found.noise, residual_rows(task, found.x, found.noise))
    information = jacobian.T @ jacobian
    covariance = np.linalg.pinv(information, rcond=1e-12)
    return np.where(np.diag(information) > 0.0, np.sqrt(np.maximum(np.diag(covariance), 0.0)), np.inf)


def interval(found: Fit, name: str, shift: float, unit: str, label: str, spread: FloatArray) -> Estimate:
    k = [f.name for f in found.free].index(name)
    f, x = found.free[k], float(found.x[k])
    low, high = (f.value(float(np.clip(x + side * 1.96 * spread[k], f.low, f.high))) for side in (-1.0, 1.0))
    return Estimate(label, f.value(x) + shift, min(low, high) + shift, max(low, high) + shift, unit)


def interval_tried(found: Fit, name: str, shift: float, unit: str, label: str, spread: FloatArray) -> Estimate:
    """As `interval`, but as far as other values explain the record nearly as well, all other numbers following: a
    moment at which something sets in, or a rate, whose slopes hold no farther than a few samples.

    Source: the profile likelihood of Venzon, Moolgavkar 1988, doi 10.2307/2347496.
    """
    k = [f.name for f in found.free].index(name)
    f, by_slopes = found.free[k], interval(found, name, shift, unit, label, spread)
    if not np.isfinite(spread[k]):
        return by_slopes
    task, others = task_of(found), [j for j in range(len(found.x)) if j != k]
    # A fit by the free run alone is not at the least cost of its other numbers.
    least = descend(task, found.x, found.noise, _FOLLOWING, others)
    ends = [_passing(found, task, least, k, side * float(spread[k])) for side in (-1.0, 1.0)]
    ends = [f.value(end) + shift for end in ends]
    if label in BETWEEN_SAMPLES:
        ts = found.record.sampling_interval_s
        ends.append(ts * (round(by_slopes.value / ts) + 1))
    return Estimate(label, by_slopes.value, min(*ends, by_slopes.low), max(*ends, by_slopes.high), unit)


def _passing(found: Fit, task: Task, least: FloatArray, k: int, deviation: float) -> float:
    """The last coordinate k, going from `least` (P,) by so many deviations (of either sign), at which the record is
    explained nearly as well as there, all others following.
    """
    x, at, others = least, float(found.x[k]), [j for j in range(len(least)) if j != k]
    cost = residual_rows(task, x, found.noise).cost
    allowed = cost + _WEAKENED * CHI2_95
    for move in _MOVES:
        there = x.copy()
        there[k] = np.clip(found.x[k] + move * deviation, task.low[k], task.high[k])
        if there[k] == at:
            return at  # at a bound
        there = descend(task, there, found.noise, _FOLLOWING, others)
        costs = residual_rows(task, there, found.noise).cost
        if not costs <= allowed:
            return at + (float(there[k]) - at) * (allowed - cost) / (costs - cost)
        x, at, cost = there, float(there[k]), costs
    return at
