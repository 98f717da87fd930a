"""A periodic disturbance, for the whole record or for a stretch of it: a sine, or with the odd harmonics that squares
and triangles are made of.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numba import njit

from app.engine.mismatch.loop.block import Block, Context, Parameter, Part, Sum
from app.engine.mismatch.physics.moments import between, moment
from app.engine.mismatch.physics.scales import size
from app.engine.recording import FloatArray

_PERIODS_TRIED = 3
_PERIOD_STEP = 1e-6  # of its logarithm: a wave of thousands of turns is a hundredth of one off by then
_ODD = (3, 5)
_WINDOWS = tuple((a / 14.0, b / 14.0) for a in range(14) for b in range(a + 1, 15))
_COARSE_WINDOWS = tuple((a / 5.0, b / 5.0) for a in range(5) for b in range(a + 1, 6))


def _parameters(context: Context) -> tuple[Parameter, ...]:
    ts, duration = context.record.sampling_interval_s, context.record.duration_s
    period = Parameter("period", "s", 2.5 * ts, 0.6 * duration, 10.0 * ts, log=True, step=_PERIOD_STEP)
    return (moment("start", context), moment("end", context), period, size(context, "sine"), size(context, "cosine"))


def _likely_periods(context: Context, innovations: FloatArray) -> FloatArray:
    """The periods at which the whitened residual is strongest, over the record or over a third of it."""
    n, ts = len(innovations), context.record.sampling_interval_s
    found: list[float] = []
    stretches = [(0, n), *((n * a // 6, n * (a + 2) // 6) for a in range(5))]
    strengths = []
    for a, b in stretches:
        power = np.abs(np.fft.rfft(innovations[a:b] * np.hanning(b - a), 4 * n)) ** 2 / (b - a)
        periods = 4 * n * ts / np.maximum(np.arange(len(power)), 1)
        power[(periods > 0.5 * (b - a) * ts) | (periods < 2.5 * ts)] = 0.0
        at = int(np.argmax(power))
        strengths.append((float(power[at]), float(periods[at])))
    for _, period in sorted(strengths, reverse=True):
        if all(abs(np.log(period / other)) > 0.06 for other in found):
            found.append(period)
    return np.array(found[:_PERIODS_TRIED])


def _starts(context: Context, innovations: FloatArray) -> FloatArray:
    duration = context.record.duration_s
    periods = _likely_periods(context, innovations)
    return np.array(
        [
            (a * duration, b * duration, p, 0.0, 0.0)
            for p in periods
            for a, b in _WINDOWS
            if (b - a) * duration > 1.5 * p
        ]
    )


def wave(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """A signal (N,) with a wave: begin, end, period (s), and the sizes of sine and cosine of each odd harmonic."""
    begin, end, period = values[:3].tolist()
    inside, a_second = _samples_between(context, begin, end), 2.0 * np.pi / period
    out, ts = signal.copy(), context.record.sampling_interval_s
    _add_harmonics(out[inside], a_second * ts * inside.start, a_second * ts, values[3:])
    return out


@njit(cache=True, nogil=True)
def _add_harmonics(out: FloatArray, phase: float, turn: float, sizes: FloatArray) -> None:
    """Adds the odd harmonics of these sizes (2 M,) to a signal (N,) that begins at a phase and turns on each sample.

    Each sample's is the one before it turned, and each harmonic the one before it turned by twice the phase.
    """
    sine, cosine = np.sin(phase), np.cos(phase)
    step_sine, step_cosine = np.sin(turn), np.cos(turn)
    for t in range(len(out)):
        s, c = sine, cosine
        twice_sine, twice_cosine = 2.0 * s * c, 1.0 - 2.0 * s * s
        out[t] += sizes[0] * s + sizes[1] * c
        for k in range(2, len(sizes), 2):
            s, c = s * twice_cosine + c * twice_sine, c * twice_cosine - s * twice_sine
            out[t] += sizes[k] * s + sizes[k + 1] * c
        sine, cosine = sine * step_cosine + cosine * step_sine, cosine * step_cosine - sine * step_sine


def _samples_between(context: Context, begin_s: float, end_s: float) -> slice:
    """The samples from begin_s up to, not at, end_s."""
    return slice(*np.searchsorted(context.time_s, (begin_s, end_s)).tolist())


def _shaped_parameters(context: Context) -> tuple[Parameter, ...]:
    more = tuple(size(context, f"{name}_{order}") for order in _ODD for name in ("sine", "cosine"))
    return (*_parameters(context), *more)


def _shaped_starts(context: Context, innovations: FloatArray) -> FloatArray:
    duration = context.record.duration_s
    rest = (0.0,) * (2 + 2 * len(_ODD))
    return np.array(
        [
            (a * duration, b * duration, p, *rest)
            for p in _likely_periods(context, innovations)
            for a, b in _COARSE_WINDOWS
            if (b - a) * duration > 1.5 * p
        ]
    )


def _stretches_of(block: Block) -> Callable[[FloatArray, Context], Sum]:
    """Waves between two moments as sums of those between neighbours of all these moments."""

    def stretches(points: FloatArray, _: Context) -> Sum:
        pieces, weights = [], []
        for period in np.unique(points[:, 2]):
            here = points[:, 2] == period
            for a, b in pairwise(np.unique(points[here, :2])):
                pieces.append(Part(block, np.array([a, b, period, *np.zeros(points.shape[1] - 3)])))
                weights.append(here & (points[:, 0] <= a) & (b <= points[:, 1]))
        return Sum(tuple(pieces), np.stack(weights, axis=1).astype(np.float64))

    return stretches


def _lasts(values: FloatArray, _: Context) -> bool:
    """Fewer than three turns are no oscillation."""
    return bool(values[1] - values[0] >= 3.0 * values[2])


WAVE = Block(
    "disturbance.oscillation",
    "disturbance",
    "output",
    "at one frequency",
    _parameters,
    _starts,
    apply=wave,
    active=between,
    penalty=25.0,
    rough=True,
    finalists=3,
    sensible=_lasts,
    affine=True,
)
_SHAPED = replace(WAVE, parameters=_shaped_parameters, starts=_shaped_starts, form="shaped", penalty=32.0, finalists=2)
BLOCKS = tuple(replace(block, sum_of=_stretches_of(block)) for block in (WAVE, _SHAPED))
