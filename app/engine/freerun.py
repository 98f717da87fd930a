"""Free-run identification: a low-order process behind a valve, judged by simulating PV from OP alone.

One-step prediction of a noisy record is won by its noise model. Here PV is simulated from OP through He's valve (S, J),
a first-order lag or an integrator, and a dead time; the gain is the only thing regressed. PV and the simulated PV lose
the same slow drift first, so that load changes slower than some three cycles do not count.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit

from app.engine.recording import FloatArray, IntArray
from app.engine.signals.sampled import deviation, dot, mean, median, piece_ranges, without_drift
from app.engine.valve import he_stem
from app.engine.valve.abreast import SAMPLES_ABREAST, he_stems_by_sample, write_transposed

INTEGRATOR = -1.0  # as any lag below 0, in whatever unit
_LAGS = (0.0, 0.04, 0.1, 0.25, 0.6, INTEGRATOR)
_DEAD_TIMES = (0.0, 0.03, 0.07, 0.13, 0.22)
_BANDS = (0.06, 0.12, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
_SLIPS = (0.0, 0.4, 1.0)
# An OP on few values moves by just a band, and the rounding of its unit would say whether the stem slips.
_BESIDE = 1.0 + 1e-9
# Of every valve of the grid, the linear one first.
_S = _BESIDE * np.array([0.0] + [s for s in _BANDS for _ in _SLIPS])
_J = _BESIDE * np.array([0.0] + [s * j for s in _BANDS for j in _SLIPS])
# A misfit below this share of the variance of PV is as good as none: noise decides there.
_MISFIT_FLOOR = 0.02
_WORST_MISFIT = 2.0
# Valves are moved abreast in multiples of so many, which is what the registers of most machines hold.
_LANES = 4


@dataclass(frozen=True)
class FreeRun:
    """How well PV follows from OP with a sticky valve and with a linear one.

    fit_linear, fit_sticky: share of the variance of PV that the best model without and with stiction explains.
    gain: log of the ratio of their misfits; above 0 stiction explains more.
    causal_linear, causal_sticky, causal_gain: the same with only process gains that close the loop to negative feedback
    with the controller seen in the record.
    misfit_drop, causal_drop: difference of the misfits without and with stiction.
    held_linear, held_sticky, held_gain: the same on halves that the fit has not seen (gain: difference of misfits).
    S_share, J_share: the best S as a share of a cycle's OP range, and J as a share of S.
    level_gain: the gain with an integrating process.
    integral_share: how much of the controller's action is integral, 0..1.
    """

    fit_linear: float
    fit_sticky: float
    gain: float
    causal_linear: float
    causal_sticky: float
    causal_gain: float
    misfit_drop: float
    causal_drop: float
    held_linear: float
    held_sticky: float
    held_gain: float
    S_share: float
    J_share: float
    level_gain: float
    integral_share: float


def free_run(pv: FloatArray, op: FloatArray, per_cycle: int) -> FreeRun:
    """Free-run identification of one window over a coarse grid of valves, lags and dead times.

    pv, op: (n,) with their drift, any unit, `per_cycle` samples a cycle. The S grid is relative to the median range of
    OP in a cycle, lags and dead times to the cycle. OP is taken as the cause: a loop shaken from outside lets the
    inverse of its controller pass for the process, which is why the causal fits ask for the sign of the feedback.
    """
    op = (op - op.mean()) / (cycle_range(op, per_cycle) or 1.0)
    drift = int(1.5 * per_cycle)
    found = _misfits(pv, op, _S, _J, *process_grid(per_cycle), drift)
    any_sign, causal, level, held, best, integral_share = found
    return FreeRun(
        fit_linear=1.0 - any_sign[0],
        fit_sticky=1.0 - any_sign[1],
        gain=_log_gain(any_sign),
        causal_linear=1.0 - causal[0],
        causal_sticky=1.0 - causal[1],
        causal_gain=_log_gain(causal),
        misfit_drop=any_sign[0] - any_sign[1],
        causal_drop=causal[0] - causal[1],
        held_linear=1.0 - held[0],
        held_sticky=1.0 - held[1],
        held_gain=held[0] - held[1],
        S_share=float(_S[best]),
        J_share=float(_J[best] / _S[best]),
        level_gain=_log_gain(level),
        integral_share=integral_share,
    )


@njit(cache=True, nogil=True)
def _misfits(pv, op, S, J, lags, dead_times, drift):  # type: ignore[no-untyped-def]
    """Least misfits of the linear valve and of the sticky ones: of any gain, of causal ones, of those of an integrating
    process, on halves that were not fitted; then which valve is the best sticky one, and the integral share.
    """
    y = without_drift(pv, drift)
    action, integral_share = _action(y, without_drift(op, drift))
    yy, xy, xx = _bank(y, op, S, J, lags, dead_times, drift)
    misfit, causal_misfit = _misfit(yy, xy, xx, 0.0), _misfit(yy, xy, xx, -action)
    any_sign, causal, level = _least(misfit), _least(causal_misfit), _least(causal_misfit[:, -1:])
    best = 1 + np.argmin(misfit[1:]) // misfit[0].size
    return any_sign, causal, level, _held_out(yy, xy, xx, -action), best, integral_share


@lru_cache(maxsize=64)
def process_grid(per_cycle: int) -> tuple[FloatArray, IntArray]:
    """(lags,) and (dead times,) in samples that are tried at `per_cycle` samples a cycle; of the lags INTEGRATOR, in
    whatever unit, is below 0.
    """
    lags, dead_times = per_cycle * np.array(_LAGS), np.round(np.array(_DEAD_TIMES) * per_cycle).astype(np.int64)
    lags.flags.writeable = dead_times.flags.writeable = False
    return lags, dead_times


def cycle_range(op: FloatArray, per_cycle: int) -> float:
    """Median range of op (n,) over its cycles; over all where there is not one whole cycle."""
    ranges = piece_ranges(op, per_cycle)
    usual = float(median(ranges)) if len(ranges) else 0.0
    return usual or float(np.ptp(op))


def controller_action(pv: FloatArray, op: FloatArray) -> tuple[float, float]:
    """Sign of the controller (OP over PV) and the integral share of its action, from OP fitted to PV and its integral.

    pv, op: (n,) without drift. A set point that moves blurs both.
    """
    action, share = _action(pv, op)
    return float(action), float(share)


@njit(cache=True, nogil=True)
def _action(pv: FloatArray, op: FloatArray) -> tuple[float, float]:
    proportional, integrating = _acted(pv, op)
    strongest = proportional if abs(proportional) > abs(integrating) else integrating
    return np.sign(strongest), abs(integrating) / (abs(proportional) + abs(integrating) + 1e-12)


@njit(cache=True, nogil=True)
def _acted(pv: FloatArray, op: FloatArray) -> tuple[float, float]:
    """Coefficients of op (n,) on pv (n,) and on its integral, both at unit deviation, beside what drifts."""
    rows = _acted_on(pv)
    normal, right = 1e-9 * len(pv) * np.eye(len(rows)), np.empty(len(rows))
    for i in range(len(rows)):
        right[i] = dot(rows[i], op)
        for j in range(len(rows)):
            normal[i, j] += dot(rows[i], rows[j])
    coefficients = np.linalg.solve(normal, right)
    return coefficients[0], coefficients[1]


@njit(cache=True, nogil=True)
def _acted_on(pv: FloatArray) -> FloatArray:
    """(5, n): pv (n,), its integral and what drifts, a parabola; all but the constant at unit deviation."""
    n, level, total = len(pv), mean(pv), 0.0
    rows = np.ones((5, n))
    for k in range(n):
        total += pv[k] - level
        t = 2.0 * k / max(n - 1, 1) - 1.0
        rows[0, k], rows[1, k], rows[3, k], rows[4, k] = pv[k], total, t, t * t
    for row in (0, 1, 3, 4):
        rows[row] /= max(deviation(rows[row]), 1e-12)
    return rows


@njit(cache=True, nogil=True)
def _least(misfit: FloatArray) -> tuple[float, float]:
    """Of the linear valve and of the sticky ones."""
    return misfit[0].min(), misfit[1:].min()


def _log_gain(least: tuple[float, float]) -> float:
    return math.log((least[0] + _MISFIT_FLOOR) / (least[1] + _MISFIT_FLOOR))


@njit(cache=True, nogil=True)
def _misfit(yy: FloatArray, xy: FloatArray, xx: FloatArray, sign: float) -> FloatArray:
    """(M, lags, dead times) share of the variance of PV left over, of the sums of `_bank`.

    Process gains of the other sign count as zero.
    """
    left = np.empty(xy.shape[:3])
    for m, i, k in np.ndindex(left.shape):
        usable = _usable(xy[m, i, k, 0] + xy[m, i, k, 1], sign)
        left[m, i, k] = 1.0 - usable**2 / (xx[m, i, k, 0] + xx[m, i, k, 1] + 1e-12) / (yy[k, 0] + yy[k, 1] + 1e-300)
    return left


@njit(cache=True, nogil=True)
def _usable(xy: float, sign: float) -> float:
    return xy if sign == 0.0 or xy * sign > 0.0 else 0.0


@njit(cache=True, nogil=True)
def _held_out(yy: FloatArray, xy: FloatArray, xx: FloatArray, sign: float) -> tuple[float, float]:
    """Mean misfit on the half that was not fitted, of the sums of `_bank`: linear valve, sticky valve."""
    linear, sticky = 0.0, 0.0
    for fitted in range(2):
        linear += _misfit_elsewhere(yy, xy[:1], xx[:1], fitted, sign) / 2
        sticky += _misfit_elsewhere(yy, xy[1:], xx[1:], fitted, sign) / 2
    return linear, sticky


@njit(cache=True, nogil=True)
def _misfit_elsewhere(yy: FloatArray, xy: FloatArray, xx: FloatArray, fitted: int, sign: float) -> float:
    """On the other half, of the model that is best on the one that was fitted."""
    other, least, found = 1 - fitted, np.inf, _WORST_MISFIT
    for m, i, k in np.ndindex(xy.shape[:3]):
        gain = _usable(xy[m, i, k, fitted], sign) / (xx[m, i, k, fitted] + 1e-12)
        inside = (yy[k, fitted] - gain * xy[m, i, k, fitted]) / (yy[k, fitted] + 1e-300)
        if inside < least:
            there = yy[k, other]
            outside = there - 2 * gain * xy[m, i, k, other] + gain**2 * xx[m, i, k, other]
            least, found = inside, min(outside / (there + 1e-300), _WORST_MISFIT)
    return found


def valve_position(op: FloatArray, S: float, J: float) -> FloatArray:
    """v (n,) of He's valve, in the unit of OP, starting at rest at op[0]."""
    v: FloatArray = he_stem(op, S, J, op[0])
    return v


def position_over_gaps(op: FloatArray, S: float, J: float) -> FloatArray | None:
    """v (N,) as `valve_position`, of an OP (N,) that is NaN where it is missing and goes on a straight line there; None
    where fewer than two samples of it are known.
    """
    known = np.flatnonzero(np.isfinite(op))
    if len(known) < 2:
        return None
    v: FloatArray = valve_position(np.interp(np.arange(len(op)), known, op[known]), S, J)
    return v


@njit(cache=True, nogil=True, fastmath={"contract"})
def through_process(v: FloatArray, lag: float) -> FloatArray:
    """v (n,) through a first-order lag in samples at unit gain, or summed up where lag is below 0, as INTEGRATOR is."""
    if lag == 0.0:
        return v.copy()
    x = np.empty(len(v))
    if lag < 0.0:
        mean, total = v.mean(), 0.0
        for t in range(len(v)):
            total += v[t] - mean
            x[t] = total
        return x
    keep = np.exp(-1.0 / lag)
    level = v[0]
    for t in range(len(v)):
        level = keep * level + (1.0 - keep) * v[t]
        x[t] = level
    return x


@njit(cache=True, nogil=True)
def fill_sums(y: FloatArray, v: FloatArray, grid: tuple, drift: int, xy: FloatArray, xx: FloatArray) -> None:
    """Sums over the halves of a window into xy and xx, (lags, dead times, 2) each: of the products of y (n,) with v
    (n,) through every process of the grid (`process_grid`), less its drift, and of the squares of that.
    """
    lags, dead_times = grid
    for i in range(len(lags)):
        _fill_delayed(y, without_drift(through_process(v, lags[i]), drift), dead_times, xy[i], xx[i])


@njit(cache=True, nogil=True)
def _fill_delayed(y: FloatArray, x: FloatArray, dead_times: IntArray, xy: FloatArray, xx: FloatArray) -> None:
    """The same of one lag, (dead times, 2) each; x: (n,) what comes through it, less its drift. dead_times: rising.

    From one dead time to the next shorter one the halves begin and end some samples later.
    """
    n, half, longest = len(y), len(y) // 2, dead_times[-1]
    early, late = x[: half - longest], x[half - longest : n - longest]
    in_early, in_late, began = dot(early, early), dot(late, late), longest
    for k in range(len(dead_times) - 1, -1, -1):
        theta = dead_times[k]
        for before in range(began, theta, -1):
            turned, added = x[half - before] ** 2, x[n - before] ** 2
            in_early += turned
            in_late += added - turned
        began = theta
        xx[k, 0], xx[k, 1] = in_early, in_late
        xy[k, 0], xy[k, 1] = dot(x[: half - theta], y[theta:half]), dot(x[half - theta : n - theta], y[half:])


@njit(cache=True, nogil=True)
def _bank(y, op, S, J, lags, dead_times, drift):  # type: ignore[no-untyped-def]
    """Sums over the two halves of the window, without the samples before a dead time, of which OP tells nothing.

    Returns those of the squares of PV, yy (dead times, 2), of its products with every simulated PV, xy (M, lags, dead
    times, 2), and of the squares of that, xx of the same shape. Row 0 is the first valve, the linear one.
    """
    n, half = len(y), len(y) // 2
    xy = np.zeros((len(S), len(lags), len(dead_times), 2))
    xx = np.zeros((len(S), len(lags), len(dead_times), 2))
    yy = np.empty((len(dead_times), 2))
    yy[:, 1] = dot(y[half:], y[half:])
    for k in range(len(dead_times)):
        yy[k, 0] = dot(y[dead_times[k] : half], y[dead_times[k] : half])
    # All valves abreast: one after another would wait for the sample before at every sample.
    abreast = -(-len(S) // _LANES) * _LANES
    sizes = np.zeros((2, abreast))
    sizes[0, : len(S)], sizes[1, : len(S)] = S, J
    v, total, simulated = np.empty((n, abreast)), np.empty((n + 1, abreast)), np.empty((abreast, n))
    he_stems_by_sample(op, sizes[0], sizes[1], np.full(abreast, op[0]), v)
    for i in range(len(lags)):
        _cumulate_abreast(v, lags[i], total)
        _without_drift_abreast(total, drift, simulated)
        for m in range(len(S)):
            _fill_delayed(y, simulated[m], dead_times, xy[m, i], xx[m, i])
    return yy, xy, xx


@njit(cache=True, nogil=True, fastmath={"contract"})
def _cumulate_abreast(v: FloatArray, lag: float, total: FloatArray) -> None:
    """total (n + 1, M): sums of the first 0, 1, .. n samples of v (n, M) `through_process`, but for a straight line."""
    n, abreast = v.shape
    level, keep, added = v[0].copy(), 0.0, 1.0
    if lag < 0.0:
        level[:], keep = 0.0, 1.0
    elif lag > 0.0:
        keep = np.exp(-1.0 / lag)
        added = 1.0 - keep
    running = np.zeros(abreast)
    total[0] = 0.0
    for t in range(n):
        row, following = v[t], total[t + 1]
        for m in range(abreast):
            level[m] = keep * level[m] + added * row[m]
            running[m] += level[m]
            following[m] = running[m]


@njit(cache=True, nogil=True)
def _slopes_abreast(total: FloatArray) -> FloatArray:
    """(M,) slopes of the least-squares straight lines through n samples, of whose sums (n + 1, M) `total` are."""
    n, abreast = total.shape[0] - 1, total.shape[1]
    before_last = np.zeros(abreast)
    for t in range(n):
        row = total[t]
        for m in range(abreast):
            before_last[m] += row[m]
    return ((n - 1) / 2.0 * total[n] - before_last) / (n * (n * n - 1.0) / 12.0)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _without_drift_abreast(total: FloatArray, half: int, out: FloatArray) -> None:
    """`without_drift` of signals of whose sums (n + 1, M) `total` are, into the rows of out (M, n)."""
    n, abreast = total.shape[0] - 1, total.shape[1]
    if n < 2.5 * half:
        half = n  # the mean over all, for want of a moving average
    slopes, part = _slopes_abreast(total), np.empty((SAMPLES_ABREAST, abreast))
    for begin in range(0, n, SAMPLES_ABREAST):
        end = min(begin + SAMPLES_ABREAST, n)
        for t in range(begin, end):
            low, high = max(t - half, 0), min(t + half + 1, n)
            share, beside = 1.0 / (high - low), t - (low + high - 1) / 2.0
            here, following, before, upto, left = total[t], total[t + 1], total[low], total[high], part[t - begin]
            for m in range(abreast):
                left[m] = (following[m] - here[m]) - (upto[m] - before[m]) * share
            if beside != 0.0:  # elsewhere the moving average takes the line off with it
                for m in range(abreast):
                    left[m] -= slopes[m] * beside
        write_transposed(part[: end - begin], begin, out)
