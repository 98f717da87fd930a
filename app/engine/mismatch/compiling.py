"""Short made-up records that run every kernel of a comparison once, so that the first real one compiles nothing."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from app.engine.mismatch.compare.comparison import Comparison, LinearSimulation
from app.engine.mismatch.compare.patterns import find_patterns
from app.engine.mismatch.compare.preparing import prepare
from app.engine.mismatch.compete.competition import glance
from app.engine.mismatch.fit.closed_loop import close_again
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.refitting import offered_beside
from app.engine.mismatch.fit.stems import shown_stems
from app.engine.mismatch.judge.between_samples import by_prediction
from app.engine.mismatch.location import locate
from app.engine.mismatch.loop.block import Context
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.physics import library
from app.engine.recording import FloatArray

_SAMPLES, _INTERVAL_S = 240, 1.0
_GAIN, _INTEGRAL = 0.4, 0.08
_FEW = 4  # starts of each block in a scan, or some more
Starts = Callable[[Context, FloatArray], FloatArray]
_STRUCTURES = (
    LinearSimulation(1.0, (8.0,), 2.0),
    LinearSimulation(1.0, (8.0, 3.0), 2.0),
    LinearSimulation(0.1, (3.0,), 2.0, integrating=True),
)


def compile_kernels() -> None:
    """Compiles the kernels of explanations, or loads them where they were compiled before: seconds, or a minute."""
    sp, op, pv = _closed_loop()
    first, *others = (
        Comparison("warm-up", _INTERVAL_S, op, pv, sp, simulation=simulation) for simulation in _STRUCTURES
    )
    locate(first)
    find_patterns(experiment(_INTERVAL_S, op, _held_from(pv, _irregular())))
    find_patterns(experiment(_INTERVAL_S, op, np.interp(np.arange(_SAMPLES), _irregular(), pv[_irregular()])))
    # A speed that comes to rest has a kernel of its own; exactly at rest it would pass for the end of a range.
    at_rest = np.maximum(pv - np.quantile(pv, 0.2), 0.0) + 1e-3 * np.cos(2.3 * np.arange(_SAMPLES))
    for comparison in (*others, replace(first, pv=at_rest)):
        _scan_all(prepare(comparison).base)
    base = prepare(first).base
    close_again(base, base, ())
    shown_stems(base.record, base.noise)
    by_prediction(base.record)


def _scan_all(base: Fit) -> None:
    """Each block along a record: what else `locate` does is compiled by then. A few starts of each, because a kernel is
    the same all over a grid, and each start of a worker pays for this.
    """
    blocks = (*library(base.record), *offered_beside(base))
    glance(base, tuple(replace(block, starts=_some_of(block.starts)) for block in blocks))


def _some_of(starts: Starts) -> Starts:
    """Some starts all over a grid."""

    def thinned(context: Context, residual: FloatArray) -> FloatArray:
        grid = starts(context, residual)
        return grid[:: max(len(grid) // _FEW, 1)]

    return thinned


def _held_from(pv: FloatArray, kept: np.ndarray) -> FloatArray:
    return pv[kept[np.searchsorted(kept, np.arange(_SAMPLES), side="right") - 1]]


def _irregular() -> np.ndarray:
    """Instants that a historian might keep, samples."""
    steps = np.tile((3, 5, 9, 4, 7), _SAMPLES // 28 + 1)
    kept = np.concatenate(([0], np.cumsum(steps)))
    return np.concatenate((kept[kept < _SAMPLES - 1], [_SAMPLES - 1]))


def _closed_loop() -> tuple[FloatArray, FloatArray, FloatArray]:
    """SP, OP and PV (N,) of a PI loop around a lag, under a small periodic load."""
    sp = 20.0 + 2.0 * np.sign(np.sin(np.arange(_SAMPLES) / 25.0))
    op, pv = np.full(_SAMPLES, 50.0), np.full(_SAMPLES, 20.0)
    for t in range(1, _SAMPLES):
        pv[t] = pv[t - 1] + (op[t - 1] - 30.0 - pv[t - 1]) / 8.0 + 0.05 * np.sin(1.7 * t)
        error, before = sp[t] - pv[t], sp[t - 1] - pv[t - 1]
        op[t] = op[t - 1] + _GAIN * (error - before) + _INTEGRAL * error
    return sp, op, pv
