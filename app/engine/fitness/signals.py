"""What can be said of one signal without knowing its unit: constant runs, quantisation, straight lines."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.ndimage import median_filter

from app.engine.fitness.config import LIMIT_BAND, FitnessConfig
from app.engine.fitness.resample import lasting
from app.engine.recording import BoolArray, FloatArray, IntArray, Span, known_span
from app.engine.signals.runs import runs_of
from app.engine.signals.sampled import at_ends

# Beyond this a number is a bad-value marker of some system or an overflow on its way: its square is not finite.
LARGEST_PLAUSIBLE = 1e100
# Two values that differ by less than this share of the signal's span are the same value after a change of unit.
SAME_SHARE_OF_SPAN = 1e-9
_EPSILON = float(np.finfo(np.float64).eps)
OUTERMOST, LEVEL_BAND = 0.02, 0.01
# Of a signal's values, on either side, but never fewer than so many: its range is asked between them.
OUTER_SHARE, FEWEST_OUTER = 0.01, 4
# Samples whose median is what a sample stands among.
_AROUND = 5


def usable_values(signal: FloatArray) -> BoolArray:
    """(N,) True where the value is a number that can be squared; NaN, infinities and 1e300 are missing values."""
    with np.errstate(invalid="ignore"):
        return np.abs(signal) <= LARGEST_PLAUSIBLE


def resolution(signal: FloatArray) -> float:
    """The difference below which two values of `signal` (N,), finite, are one value; in the signal's unit.

    It covers the rounding of a change of unit or offset, which a comparison for equality would not survive.
    """
    return float(_resolution(signal))


@njit(cache=True, nogil=True)
def _resolution(signal: FloatArray) -> float:
    if len(signal) == 0:
        return 0.0
    low = high = signal[0]
    for value in signal:
        low, high = min(low, value), max(high, value)
    return max(SAME_SHARE_OF_SPAN * (high - low), 8.0 * _EPSILON * max(abs(low), abs(high)))


def wild(signal: FloatArray, time_s: FloatArray, config: FitnessConfig) -> BoolArray:
    """(N,) True where `signal` (N,), finite, at times `time_s` (N,) in s, lies alone and far off, for at most
    `config.most_wild` samples in a row that could be filled if they were missing: more than `config.wild_ranges` times
    its range without its outermost values outside of that, or less far, more than `config.aside_ranges`, where it jumps
    there and back at once, by `config.jump_ranges` from what is around (the median of five samples).

    Nowhere where that range is nothing: of a signal that mostly stands it is not known how far it goes; of one that
    goes by few steps of its quantisation hardly more. Nowhere either where that happens again and again: a valve that
    opens rarely does so.
    """
    n = len(signal)
    outer = max(int(OUTER_SHARE * n), FEWEST_OUTER)
    if n <= 2 * outer:
        return np.zeros(n, dtype=bool)
    low, high = np.partition(signal, (outer, n - 1 - outer))[[outer, n - 1 - outer]]
    if high - low <= resolution(np.array([low, high])):
        return np.zeros(n, dtype=bool)
    aside = _beyond(signal, low, high, config.aside_ranges * (high - low))
    if not aside.any():
        return aside
    step = quantisation_step(signal[(signal >= low) & (signal <= high)]) or 0.0
    reach = max(high - low, config.min_levels * step)
    jumps = np.abs(signal - median_filter(signal, _AROUND, mode="mirror")) > config.jump_ranges * reach
    far = _beyond(signal, low, high, config.wild_ranges * reach)
    return _brief(far | (jumps & _beyond(signal, low, high, config.aside_ranges * reach)), time_s, config)


def _beyond(signal: FloatArray, low: float, high: float, reach: float) -> BoolArray:
    return (signal < low - reach) | (signal > high + reach)


def _brief(far: BoolArray, time_s: FloatArray, config: FitnessConfig) -> BoolArray:
    """The runs of `far` (N,) that are short enough to be filled; none of them where they are too many."""
    n, longest_s = len(far), lasting(config.max_gap_intervals, time_s)
    found = np.zeros(n, dtype=bool)
    for first, behind in zip(*runs_of(far), strict=True):
        around_s = time_s[min(behind, n - 1)] - time_s[max(first - 1, 0)]
        found[first:behind] = behind - first <= config.most_wild and around_s <= longest_s
    again = len(runs_of(found)[0]) > config.most_wild_spells
    return np.zeros(n, dtype=bool) if again else found


def at_extremes(signal: FloatArray) -> tuple[BoolArray, BoolArray]:
    """(N,) each: where `signal` (N,), N at least 1, is at the least of its values and where at the greatest."""
    return at_ends(signal, signal.min(), signal.max(), resolution(signal))


def at_limits(op: FloatArray, op_range: Span | None, band: float = LIMIT_BAND) -> tuple[BoolArray, BoolArray] | None:
    """(N,) each: where `op` (N,) is within `band`, a share of its span, of either end of that; None: not known."""
    span = known_span(op_range)
    return None if span is None else at_ends(op, *span, band * (span[1] - span[0]))


@dataclass(frozen=True)
class TwoLevels:
    """A signal at two levels: the share of its samples near the one where it is longer, and near the other one, 0 to 1;
    switches: how often it goes from one side to the other; on_the_way: samples between the two when it does (median).
    """

    more: float
    less: float
    switches: int
    on_the_way: float


def two_levels(signal: FloatArray) -> TwoLevels:
    """How far `signal` (N,), N at least 1, is at two levels.

    Its levels are what it is at after OUTERMOST of its samples from either end are left out, as those are that were
    taken while it switched; near is what lies within LEVEL_BAND of their distance, noise of a read-back among it.
    """
    low, high = np.quantile(signal, (OUTERMOST, 1.0 - OUTERMOST))
    if high - low <= resolution(signal):
        return TwoLevels(1.0, 0.0, 0, 0.0)
    at_low, at_high = (np.abs(signal - level) <= LEVEL_BAND * (high - low) for level in (low, high))
    there = np.flatnonzero(at_low | at_high)
    on_the_way = np.diff(there)[np.diff(at_high[there].astype(np.int8)) != 0] - 1
    near = float(np.mean(at_low)), float(np.mean(at_high))
    switches = int(np.count_nonzero(np.diff(signal > 0.5 * (low + high))))
    return TwoLevels(max(near), min(near), switches, float(np.median(on_the_way)) if len(on_the_way) else 0.0)


STANDING = 300
"""Samples in a row of one value that show nothing of a loop at work: where a unit is shut down PV and OP fall together.
"""


def standing(pv: FloatArray, op: FloatArray) -> IntArray:
    """(N,) for how many samples in a row PV or OP (N,), whichever does longer, holds the value that it has there."""
    return np.maximum(run_lengths(pv), run_lengths(op))


def still_at_its_end(pv: FloatArray, op: FloatArray) -> tuple[int, int]:
    """For how many samples PV (N,) holds one value up to its end while OP (N,) moves, 0 where OP does not, and for how
    many it has ever done so before.
    """
    runs = run_lengths(pv)
    still = int(runs[-1])
    before = int(np.max(runs[:-still], initial=0))
    return (still if float(np.ptp(op[-still:])) > resolution(op) else 0), before


def set_point_activity(sp: FloatArray | None, pv: FloatArray) -> float | None:
    """Standard deviation of the set point over that of PV, (N,) each; None where either is not known or PV stands."""
    spread = float(np.std(pv)) if len(pv) else 0.0
    if sp is None or spread <= resolution(pv):
        return None
    return float(np.std(sp)) / spread


def newest_long_run(mask: BoolArray, share: float, least: int, counted: BoolArray | None = None) -> slice:
    """The newest run of True in `mask` (N,) that `newest_long` takes; an empty slice where there is none.

    counted: (N,) which samples count for how long a run is; None: all.
    """
    starts, ends = runs_of(mask)
    if not len(starts):
        return slice(0, 0)
    before = np.concatenate(([0], np.cumsum(mask if counted is None else counted)))
    return newest_long(starts, ends, share, least, before[ends] - before[starts])


def newest_long(starts: IntArray, ends: IntArray, share: float, least: int, lengths: IntArray | None = None) -> slice:
    """The newest of some stretches, given by their first samples (K,) and those behind their last (K,), that has at
    least a share of the longest one's samples, and not fewer than `least` where the longest has as many.

    lengths: (K,) how many samples of each count; None: all.
    """
    lengths = ends - starts if lengths is None else lengths
    longest = int(np.max(lengths))
    k = int(np.flatnonzero(lengths >= max(share * longest, min(least, longest)))[-1])
    return slice(int(starts[k]), int(ends[k]))


def run_lengths(signal: FloatArray) -> IntArray:
    """(N,) for each sample the length of the constant run that it stands in, in samples."""
    lengths: IntArray = _run_lengths(signal)
    return lengths


@njit(cache=True, nogil=True)
def _run_lengths(signal: FloatArray) -> IntArray:
    lengths, first, same = np.empty(len(signal), dtype=np.int64), 0, _resolution(signal)
    for k in range(1, len(signal) + 1):
        if k == len(signal) or abs(signal[k] - signal[k - 1]) > same:
            lengths[first:k] = k - first
            first = k
    return lengths


def quantisation_step(signal: FloatArray) -> float | None:
    """The least difference between two distinct values of `signal` (N,), in its unit; None where it is constant.

    For a quantised signal it is the quantum; for a continuous one it tends to zero as the record grows.
    """
    differences = np.diff(np.sort(signal))
    differences = differences[differences > resolution(signal)]
    return float(differences.min()) if len(differences) else None


def on_line_share(signal: FloatArray) -> float:
    """The share of inner samples exactly on the straight line between their neighbours, while the signal moves.

    Measured signals hardly do that; a historian that interpolates between the points it kept does it all the time.
    """
    return float(_on_line_share(signal))


@njit(cache=True, nogil=True)
def _on_line_share(signal: FloatArray) -> float:
    tolerance, inner, found = 4.0 * _resolution(signal), max(len(signal) - 2, 0), 0
    for k in range(inner):
        before, here, after = signal[k], signal[k + 1], signal[k + 2]
        found += abs(after - before) > tolerance and abs(after - 2.0 * here + before) <= tolerance
    return found / inner if inner > 0 else 0.0


def stored_points(signal: FloatArray) -> int:
    """How many samples of `signal` (N,) a historian must have stored to give it back, held or on straight lines."""
    return int(_stored_points(signal))


@njit(cache=True, nogil=True)
def _stored_points(signal: FloatArray) -> int:
    same, changes, corners = _resolution(signal), 0, 0
    for k in range(1, len(signal)):
        step = signal[k] - signal[k - 1]
        changes += abs(step) > same
        if k > 1:
            corners += abs(step - (signal[k - 1] - signal[k - 2])) > 4.0 * same
    return min(changes, corners) + 1
