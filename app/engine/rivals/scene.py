"""The record as the rivals see it: the same windows as for stiction, with what several of them need."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from app.engine.features import PER_CYCLE, Features, cycle_samples, spans
from app.engine.freerun import controller_action, cycle_range
from app.engine.oscillation import Oscillation, autocorrelation
from app.engine.recording import FloatArray, UniformRecord
from app.engine.rivals.line import Line, line, worst
from app.engine.rivals.periodic import held_out_sine
from app.engine.rivals.response import response
from app.engine.signals.sampled import (
    ROUNDING,
    correlation,
    deviation,
    moving_average,
    resample,
    without_drift,
    without_line,
)

_WINDOWS = 2
_SMOOTHING_HALF = 2
_LEAST_SWING = 0.3
# Share of PV along the set point from which on its jumps may be the set point's.
_ALONG_SP = 0.1


@dataclass(frozen=True, eq=False)
class Scene:
    """One loop with its oscillation and features.

    Windows are the first and the last of the features', at PER_CYCLE samples a cycle.
    """

    record: UniformRecord
    oscillation: Oscillation
    features: Features

    @cached_property
    def _spans(self) -> list[slice]:
        return spans(self.record, self.per_cycle, _WINDOWS)

    @cached_property
    def per_cycle(self) -> float:
        return cycle_samples(self.record, self.oscillation)

    @cached_property
    def pv(self) -> list[FloatArray]:
        return self._windows(self.record.pv)

    @cached_property
    def op(self) -> list[FloatArray]:
        return self._windows(self.record.op)

    @cached_property
    def sp(self) -> list[FloatArray]:
        """Empty if the set point is unknown or does not move."""
        if self.record.sp is None or float(np.ptp(self.record.sp)) == 0.0:
            return []
        return self._windows(self.record.sp)

    @cached_property
    def pv_along_sp(self) -> float:
        """Share of PV's variance that a straight line over SP explains; 0 if SP is unknown or constant."""
        return 0.0 if self.record.sp is None else correlation(self.record.pv, self.record.sp) ** 2

    @property
    def along_sp(self) -> bool:
        """Whether PV moves with the set point, so that its jumps may be the set point's."""
        return self.pv_along_sp >= _ALONG_SP

    @cached_property
    def from_sp(self) -> tuple[float, float]:
        """Shares of the variance of PV and of OP that follow from SP through a lag and a dead time, on unseen cycles.

        0 if SP is unknown or constant.
        """
        moving = [k for k, sp in enumerate(self.sp) if float(np.ptp(sp)) > 0.0]
        if not moving:
            return 0.0, 0.0
        pv = float(np.mean([response(self.pv[k], self.sp[k]).held_out for k in moving]))
        op = float(np.mean([response(self.op[k], self.sp[k]).held_out for k in moving]))
        return pv, op

    @cached_property
    def line(self) -> Line | None:
        """The spectral line of PV and OP in the first and the last window, the worst of them; None if cycles are too
        few.
        """
        windows = self.features.windows
        apart = max(len(windows) - 1, 1)
        return worst([line(x) for window in windows[::apart] for x in (window.pv, window.op)])

    @property
    def raw_pv(self) -> list[FloatArray]:
        return [self.record.pv[part] for part in self._spans]

    @property
    def raw_op(self) -> list[FloatArray]:
        return [self.record.op[part] for part in self._spans]

    @cached_property
    def opposition(self) -> float:
        """Share of the steps in which OP moves against PV, less the share in which it moves with it: -1..1.

        Signed so that a proportional controller gives 1, whatever the sign of its gain. The negative of Haegglund's
        idle index, with both signals smoothed.
        """
        return float(np.mean([_opposition(pv, op) for pv, op in zip(self.pv, self.op, strict=True)]))

    @cached_property
    def decay_ratio(self) -> float:
        """How little the swings of PV's autocorrelation decay: 0 no swing, 1 undamped."""
        return float(np.median([decay_ratio(autocorrelation(without_line(pv))) for pv in self.pv]))

    @cached_property
    def wave(self) -> float:
        """The smaller of the shares of PV and of OP that a sine explains on the half that was not fitted."""
        if self.oscillation.strength < _LEAST_SWING:
            return 0.0
        return min(held_out_sine(self.pv[0]), held_out_sine(self.op[0]))

    @cached_property
    def op_scaled(self) -> list[FloatArray]:
        """OP in units of its median range in a cycle."""
        return [(op - op.mean()) / (cycle_range(op, PER_CYCLE) or 1.0) for op in self.op]

    def _windows(self, x: FloatArray) -> list[FloatArray]:
        return [resample(x[part], self.per_cycle, PER_CYCLE) for part in self._spans]


def decay_ratio(acf: FloatArray) -> float:
    """Miao and Seborg's ratio: height of the first peak of an autocorrelation over the depth of its first trough, both
    against the straight line between their neighbours. 0 without a peak.

    Source: Miao, Seborg 1999, Automatic detection of excessively oscillatory feedback control loops, IEEE Conference
    on Control Applications, 359-364.
    """
    inner, before, after = acf[1:-1], acf[:-2], acf[2:]
    troughs = np.flatnonzero((inner < before) & (inner <= after) & (inner < 0.0)) + 1
    peaks = np.flatnonzero((inner > before) & (inner >= after) & (inner > 0.0)) + 1
    if len(troughs) == 0:
        return 0.0
    first = int(troughs[0])
    peaks = peaks[peaks > first]
    if len(peaks) == 0:
        return 0.0
    peak = int(peaks[0])
    troughs = troughs[troughs > peak]
    if len(troughs) == 0:
        return 0.0
    second = int(troughs[0])
    base = acf[first] + (acf[second] - acf[first]) * (peak - first) / (second - first)
    top = acf[0] + (acf[peak] - acf[0]) * first / peak
    depth = float(top - acf[first])
    return float(np.clip((acf[peak] - base) / depth, 0.0, 1.0)) if depth > 0.0 else 0.0


def _opposition(pv: FloatArray, op: FloatArray) -> float:
    action, _ = controller_action(without_drift(pv, 2 * PER_CYCLE), without_drift(op, 2 * PER_CYCLE))
    pv_steps, op_steps = (np.diff(moving_average(x, _SMOOTHING_HALF)) / (deviation(x) or 1.0) for x in (pv, op))
    moved = (np.abs(pv_steps) > ROUNDING) & (np.abs(op_steps) > ROUNDING)
    signs = np.sign(pv_steps[moved] * op_steps[moved])
    return action * float(signs.mean()) if len(signs) else 0.0
