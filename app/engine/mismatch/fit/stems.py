"""Stems that a record shows before its linear loop is known: each of a grid of sticking stems is tried as what a simple
loop follows, for a loop found from OP has the stem's work in it and hides the stem.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.engine.mismatch.fit.noise import POLE_MAX, Four, NoiseModel, compared_samples, settling_samples, whiten
from app.engine.mismatch.fit.unlike import unlike_better_ones
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics.valve_stiction import reach
from app.engine.recording import BoolArray, FloatArray
from app.engine.signals.sampled import REORDERED_SUMS
from app.engine.valve import two_parameter_he

_SHARES = (0.0, 0.08, 0.16, 0.25, 0.5, 0.75, 1.0)  # J / S
# Of OP's span: closely where the swing of a limit cycle is S or little more, and a slip more or less hangs on it.
_SIZES = np.concatenate((np.geomspace(0.06, 0.58, 150, endpoint=False), np.geomspace(0.58, 1.1, 900)))
LAGS = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, np.inf])  # samples; infinite: an integrator
DELAYS = np.array([0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0])  # samples
_NEAR_LAG, _NEAR_DELAY = np.array([0.6, 0.8, 1.0, 1.25, 1.6]), np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
_KEPT = 40  # of the stems that are tried with a few loops, how many are tried with all
_NEARBY_S, _NEARBY_SHARE = np.exp(np.linspace(-0.01, 0.01, 21)), np.linspace(-0.12, 0.12, 9)
_ALIKE_S, _ALIKE_SHARE = 0.02, 0.1
_TELLING = 20.0  # nat over what follows OP itself, from which a stem is looked at again
# Where a stem stood at the beginning decides at which sample it first slips, and with that what size of slip fits.
_LOOKED_AT_AGAIN = 3
_CLOSE_S, _STARTS = np.exp(np.linspace(-0.006, 0.006, 7)), np.linspace(-0.8, 0.8, 9)
_SLIPS = np.linspace(0.1, 1.0, 13)
_WALKS = tuple(NoiseModel((POLE_MAX, POLE_MAX), (zero, zero)) for zero in (0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.96))
_MOST = 6
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class ShownStem:
    """A stem of He's model and the simple loop that follows it best.

    S: unit of OP; share: J / S; start: where it stood at first, share of its band to either side of OP.
    gain: log-likelihood (nat) over what a simple loop leaves that follows OP itself.
    plant: its lag, dead time and gain, offset and start left open.
    """

    S: float
    share: float
    start: float
    gain: float
    plant: Plant


@dataclass(frozen=True, eq=False)
class _Followed:
    """What simple loops leave that follow the stems of a grid (M,): the least energy, of which lag and delay."""

    left: FloatArray
    lag: FloatArray
    delay: FloatArray
    slope: FloatArray


@dataclass(frozen=True, eq=False)
class _Loops:
    """The simple loops that are tried: each of the lags with each of the delays, samples; `few` of both, by index."""

    lags: FloatArray
    delays: FloatArray
    few: tuple[list[int], list[int]]


_EVERY = _Loops(LAGS, DELAYS, ([1, 3, 5, 7], [0, 3, 5]))


def loops_near(plant: Plant, sampling_interval_s: float) -> _Loops:
    """Loops with about the lag and the dead time of a plant, a second lag taken for dead time."""
    lag = plant.tau / sampling_interval_s if plant.leak > 0.0 else np.inf
    lags = np.unique(lag * _NEAR_LAG)
    delays = np.maximum((plant.theta + plant.tau2) / sampling_interval_s + _NEAR_DELAY, 0.0)
    return _Loops(lags, delays, ([len(lags) // 2], [1, 2, 3]))


@dataclass(frozen=True, eq=False)
class _Seen:
    """PV as innovations (N,) under a noise model, where it is compared, and for each lag of some loops an orthonormal
    basis (L, 2, N) of what its offset and its start make of them.
    """

    record: Experiment
    noise: NoiseModel
    loops: _Loops
    pv: FloatArray
    compared: BoolArray
    basis: FloatArray

    @property
    def samples(self) -> int:
        return int(np.sum(self.compared))


def shown_stems(record: Experiment, noise: NoiseModel, near: Plant | None = None) -> tuple[ShownStem, ...]:
    """The stems behind which a simple loop, one `near` a plant where it is given, explains PV better than behind OP by
    _TELLING: the best of those that begin where OP does, and the best of those that begin elsewhere; of either no two
    alike.
    """
    seen = seen_under(record, noise, _EVERY if near is None else loops_near(near, record.sampling_interval_s))
    alone = float(followed(seen, record.op_deviation[None, :]).left[0])
    found = []
    for share in _SHARES:
        best = _best_of(seen, _sizes_of(record.op_span * _SIZES, [share], [0.0]), alone)
        nearby = np.clip(share + _NEARBY_SHARE, 0.0, 1.0) if share > 0.0 else [0.0]
        found.append(_best_of(seen, _sizes_of(best.S * _NEARBY_S, nearby, [0.0]), alone))
    first = [stem for stem in _distinct(found) if stem.gain > _TELLING]
    again = []
    for stem in first[:_LOOKED_AT_AGAIN]:
        slips = _SLIPS if stem.share > 0.0 else [0.0]
        again += [_best_of(seen, _sizes_of(stem.S * _CLOSE_S, [share], _STARTS), alone) for share in slips]
    return (*first[:_MOST], *_distinct(again)[:_MOST])


def walking(record: Experiment) -> NoiseModel:
    """What an integrating process makes of a load that steps or walks: of some such noises the one under which OP
    explains PV best. A controller answers such a load, so that PV hardly walks, and a noise fitted to it does not.
    """
    op = record.op_deviation[None, :]
    return min(_WALKS, key=lambda noise: float(followed(seen_under(record, noise), op).left[0]))


def _sizes_of(S: FloatArray, shares: FloatArray | list[float], starts: FloatArray | list[float]) -> FloatArray:
    """(M, 3) all combinations of S, J / S and where the stem stood at first."""
    return np.stack([axis.ravel() for axis in np.meshgrid(S, shares, starts, indexing="ij")], axis=1)


def _distinct(found: list[ShownStem]) -> list[ShownStem]:
    """The stems in the order of their gain without those that are nearly a better one."""
    return unlike_better_ones(sorted(found, key=lambda stem: -stem.gain), _nearly_one)


def _nearly_one(one: ShownStem, other: ShownStem) -> bool:
    return abs(np.log(one.S / other.S)) < _ALIKE_S and abs(one.share - other.share) < _ALIKE_SHARE


def _best_of(seen: _Seen, sizes: FloatArray, alone: float) -> ShownStem:
    """The best of some stems (M, 3); alone: the energy that a loop leaves which follows OP."""
    record = seen.record
    S, share, start = sizes.T
    J = S * share
    stems = two_parameter_he(record.op, S, J, record.op[0] + start * reach(S, J)) - record.op_mid
    if len(stems) > _KEPT:
        foremost = np.argsort(followed(seen, stems, few=True).left, kind="stable")[:_KEPT]
        stems, S, share, start = stems[foremost], S[foremost], share[foremost], start[foremost]
    found = followed(seen, stems)
    k = int(np.argmin(found.left))
    left = float(found.left[k])
    told = np.isfinite(left) and np.isfinite(alone) and left > 0.0
    gain = 0.5 * seen.samples * float(np.log(max(alone, 1e-300) / left)) if told else -np.inf
    return ShownStem(float(S[k]), float(share[k]), float(start[k]), gain, _plant_of(record, found, k))


def _plant_of(record: Experiment, found: _Followed, k: int) -> Plant:
    ts, lag, slope = record.sampling_interval_s, float(found.lag[k]), float(found.slope[k])
    theta, start = float(found.delay[k]) * ts, record.pv_first
    if np.isinf(lag):
        return Plant(slope / ts, 1.0, theta, x0=start, leak=0.0)
    return Plant(slope, lag * ts, theta, x0=start)


def seen_under(record: Experiment, noise: NoiseModel, loops: _Loops = _EVERY) -> _Seen:
    compared = compared_samples(record.usable)
    compared[: settling_samples(record.samples)] = False
    every = np.ones(record.samples, dtype=np.bool_)
    pv = whiten(record.pv_deviation, record.usable, noise)
    at = np.arange(record.samples, dtype=np.float64)
    basis = []
    for lag in loops.lags:
        offset, start = (at, np.ones_like(at)) if np.isinf(lag) else (np.ones_like(at), np.exp(-at / lag))
        columns = np.stack([whiten(column, every, noise) * compared for column in (offset, start)], axis=1)
        basis.append(np.linalg.qr(columns)[0].T)
    return _Seen(record, noise, loops, pv * compared, compared, np.ascontiguousarray(np.stack(basis)))


def followed(seen: _Seen, stems: FloatArray, *, few: bool = False) -> _Followed:
    """What simple loops leave of PV that follow the stems (M, N), deviations in the unit of OP; `few`: of a few lags
    and delays only.
    """
    lags, delays, basis = seen.loops.lags, seen.loops.delays, seen.basis
    if few:
        some, times = seen.loops.few
        lags, delays, basis = lags[some], delays[times], basis[some]
    left, lag, delay, slope = _follow_all(
        seen.pv, np.ascontiguousarray(stems), basis, seen.compared, lags, delays, seen.noise.shape
    )
    return _Followed(left, lags[lag], delays[delay], slope)


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def _along(pv: FloatArray, moved: FloatArray, offset: FloatArray, start: FloatArray) -> Four:
    """Inner products of a row (N,) with PV, with itself and with the two directions that are taken out."""
    with_pv = own = first = second = 0.0
    for t in range(len(pv)):
        e = moved[t]
        with_pv += e * pv[t]
        own += e * e
        first += e * offset[t]
        second += e * start[t]
    return with_pv, own, first, second


@njit(cache=True, nogil=True)
def _whitened_lag(v: FloatArray, lag: float, shape: FloatArray, e: FloatArray) -> None:
    """Innovations under a noise model's shape of v (N,) less its first value, held over each sample, behind a lag of so
    many samples that was settled at the start.
    """
    a1, a2 = -(shape[0] + shape[1]), shape[0] * shape[1]
    c1, c2 = -(shape[2] + shape[3]), shape[2] * shape[3]
    stay = np.exp(-1.0 / lag)
    gain = 1.0 if np.isinf(lag) else 1.0 - stay
    x = x1 = x2 = e1 = e2 = e[0] = 0.0
    for t in range(1, len(v)):
        x = stay * x1 + gain * (v[t - 1] - v[0])
        e[t] = (x + a1 * x1 + a2 * x2 - c2 * e2) - c1 * e1
        x2, x1, e2, e1 = x1, x, e1, e[t]


@njit(cache=True, nogil=True)
def _later(e: FloatArray, samples: float, compared: BoolArray, out: FloatArray) -> None:
    """e (N,) later by so many samples, zero where PV is not compared."""
    whole = int(np.floor(samples))
    share = samples - whole
    for t in range(len(e)):
        k = t - whole
        now = e[k] if k >= 0 else 0.0
        last = e[k - 1] if k >= 1 else 0.0
        out[t] = (1.0 - share) * now + share * last if compared[t] else 0.0


@njit(cache=True, nogil=True)
def _follow_all(
    pv: FloatArray,
    stems: FloatArray,
    basis: FloatArray,
    compared: BoolArray,
    lags: FloatArray,
    delays: FloatArray,
    shape: FloatArray,
) -> tuple[FloatArray, Indices, Indices, FloatArray]:
    """Of each stem (M, N) the least energy left of PV, the lag and the delay that leave it, and the gain."""
    count, n = stems.shape
    left, slope = np.full(count, np.inf), np.zeros(count)
    lag, delay = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    e, moved = np.empty(n), np.empty(n)
    energy, of_pv = np.empty(len(lags)), np.empty((len(lags), 2))
    for j in range(len(lags)):
        whole, _, first, second = _along(pv, pv, basis[j, 0], basis[j, 1])
        energy[j], of_pv[j, 0], of_pv[j, 1] = whole - first * first - second * second, first, second
    for k in range(count):
        for j in range(len(lags)):
            _whitened_lag(stems[k], lags[j], shape, e)
            for i in range(len(delays)):
                _later(e, delays[i], compared, moved)
                with_pv, own, first, second = _along(pv, moved, basis[j, 0], basis[j, 1])
                free = own - first * first - second * second
                if free <= 1e-9 * own or own <= 0.0:
                    continue
                both = with_pv - first * of_pv[j, 0] - second * of_pv[j, 1]
                there = energy[j] - both * both / free
                if there < left[k]:
                    left[k], slope[k], lag[k], delay[k] = there, both / free, j, i
    return left, lag, delay, slope
