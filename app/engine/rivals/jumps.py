"""PV jumps, and between its jumps it moves with OP: a load in steps that the controller takes back."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from app.engine.features import PER_CYCLE, ShapeWindow
from app.engine.recording import FloatArray
from app.engine.signals.sampled import ROUNDING, moving_average

_SMOOTHING_HALF = 1
_LATEST = PER_CYCLE // 10
_QUIET = 0.7
_BEFORE_JUMPS = 0.9
_REFITS = 7
_STANDS = 1e-9


@dataclass(frozen=True)
class Jumps:
    """jumping: share of PV's movement (sum of squared steps) that falls into the liveliest tenth of the time.

    along: share of the quieter steps of PV that OP explains, at most a tenth of a cycle later and with the sign of a
    closed loop; negative if OP explains them with the other sign.
    """

    jumping: float
    along: float

    @property
    def taken_back(self) -> float:
        """-1..1: from one half on, PV mostly jumps, and its other movement is due to OP."""
        return self.along - (1.0 - self.jumping)


def jumps(windows: tuple[ShapeWindow, ...]) -> Jumps:
    """The mean over windows of PV and OP.

    A sticking valve makes PV jump as well, but while it is stuck OP moves and PV does not. The quieter steps are those
    that the fit explains best (least trimmed squares, Rousseeuw 1984, doi 10.1080/01621459.1984.10477105): a tenth of
    jumps or more takes no part in it, and the jumps need not be found.
    """
    each = [_of(window) for window in windows]
    return Jumps(float(np.mean([x.jumping for x in each])), float(np.mean([x.along for x in each])))


def _of(window: ShapeWindow) -> Jumps:
    pv, op = moving_average(window.pv, _SMOOTHING_HALF), moving_average(window.op, _SMOOTHING_HALF)
    pv_steps, op_steps = np.diff(pv), np.diff(op)
    # The controller integrates PV's deviation against the sign of the process gain.
    gain_sign = -np.sign(float(op_steps @ (pv[1:] + pv[:-1])))
    answers = pv_steps[_LATEST:]
    size = np.sort(np.abs(answers))
    moved = float(size @ size)
    if moved <= _STANDS:
        return Jumps(0.0, 0.0)
    calm = size[: int(_BEFORE_JUMPS * len(size))]
    along = max(
        float(_explained(answers, gain_sign * op_steps[_LATEST - late : len(op_steps) - late], _QUIET))
        for late in range(_LATEST + 1)
    )
    return Jumps(1.0 - float(calm @ calm) / moved, along)


@njit(cache=True, nogil=True)
def _explained(y: FloatArray, x: FloatArray, share: float) -> float:
    """Share of y's squares that x explains on the `share` of samples that it explains best, with the gain's sign."""
    last = int(share * len(y)) - 1
    left = np.abs(y)
    gain = 0.0
    for _ in range(_REFITS):
        # Steps of a coarse signal come in equal sizes, which a change of unit parts by rounding: all of them or none.
        most = np.partition(left, last)[last] + ROUNDING
        xy, xx, yy = 0.0, 0.0, 0.0
        for i in range(len(y)):
            if left[i] <= most:
                xy += x[i] * y[i]
                xx += x[i] * x[i]
                yy += y[i] * y[i]
        if xx <= _STANDS or yy <= _STANDS:
            return 0.0
        gain = xy / xx
        rest = yy - gain * xy
        left = np.abs(y - gain * x)
    return float(np.sign(gain) * (1.0 - rest / yy))
