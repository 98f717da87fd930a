"""Small compiled operations on sampled signals that the features share."""

from functools import lru_cache
from typing import TypeVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.engine.recording import BoolArray, FloatArray, IntArray

Number = TypeVar("Number", np.float64, np.int64, np.bool_)

# A change of unit moves a signal at unit deviation by less than this; what is smaller is no movement.
ROUNDING = 1e-6


REORDERED_SUMS = {"reassoc", "contract"}
"""What a compiled loop that adds up a signal may relax: only a sum whose order is free runs in vector registers."""


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def sum_of_squares(errors: FloatArray, first: int) -> float:
    """Of errors (N,) from the sample `first` on."""
    total = 0.0
    for t in range(first, len(errors)):
        total += errors[t] * errors[t]
    return total


@njit(cache=True, nogil=True)
def cumulated(x: FloatArray) -> FloatArray:
    """(N + 1,) sums of the first 0, 1, .. N samples of x (N,)."""
    total = np.empty(len(x) + 1)
    total[0] = 0.0
    for i in range(len(x)):
        total[i + 1] = total[i] + x[i]
    return total


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def dot(x: FloatArray, y: FloatArray) -> float:
    """The sum of the products of x and y (N,)."""
    total = 0.0
    for i in range(len(y)):
        total += x[i] * y[i]
    return total


@njit(cache=True, nogil=True)
def moving_average(x: FloatArray, half: int) -> FloatArray:
    """Mean over 2 half + 1 samples around each sample of x (N,), over fewer at the ends."""
    n, total = len(x), cumulated(x)
    out = np.empty(n)
    whole = max(n - 2 * half, 0)  # samples with a full window
    middle, after, before = out[half : half + whole], total[n + 1 - whole :], total[:whole]
    for i in range(whole):
        middle[i] = (after[i] - before[i]) / (2 * half + 1)
    for k in range(n - whole):
        i = k if k < half else k + whole
        low, high = max(i - half, 0), min(i + half + 1, n)
        out[i] = (total[high] - total[low]) / (high - low)
    return out


@njit(cache=True, nogil=True)
def forgetting(x: FloatArray, memory: float) -> FloatArray:
    """(N,) averages of x up to each sample, in which a sample counts 1/e of one that is `memory` samples newer."""
    kept = np.exp(-1.0 / memory)
    out = np.empty(len(x))
    average = x[0]
    for i in range(len(x)):
        average = kept * average + (1.0 - kept) * x[i]
        out[i] = average
    return out


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def mean(x: FloatArray) -> float:
    """Mean of x (N,)."""
    total = 0.0
    for i in range(len(x)):
        total += x[i]
    return total / len(x)


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def deviation(x: FloatArray) -> float:
    """Standard deviation of x (N,)."""
    middle, total = mean(x), 0.0
    for i in range(len(x)):
        total += (x[i] - middle) ** 2
    return np.sqrt(total / len(x))


@njit(cache=True, nogil=True)
def peak_to_peak(x: FloatArray) -> float:
    """From the least to the greatest of x (N,): of a few values NumPy's takes ten times as long."""
    low = high = x[0]
    for i in range(1, len(x)):
        low, high = min(low, x[i]), max(high, x[i])
    return high - low


@njit(cache=True, nogil=True)
def median(x: FloatArray) -> float:
    """Median of x (N,), N at least 1: of a few values NumPy's takes twenty times as long."""
    return np.median(x)


@njit(cache=True, nogil=True)
def medians_of_five(x: FloatArray) -> FloatArray:
    """(N,) the median of each sample of x (N,) and the two on either side; the last one repeated beyond the ends."""
    n, out = len(x), np.empty(len(x))
    for i in range(n):
        a, b, c, d = x[max(i - 2, 0)], x[max(i - 1, 0)], x[min(i + 1, n - 1)], x[min(i + 2, n - 1)]
        # Of the four beside it the middle two: the sample is the median where it lies between them.
        lower, upper = max(min(a, b), min(c, d)), min(max(a, b), max(c, d))
        out[i] = max(min(lower, upper), min(x[i], max(lower, upper)))
    return out


@njit(cache=True, nogil=True)
def slope(x: FloatArray) -> FloatArray:
    """(N,) half of what x (N,), N at least 2, moves from the sample before to the one after; one step at the ends."""
    n = len(x)
    out = np.empty(n)
    out[0], out[n - 1] = x[1] - x[0], x[n - 1] - x[n - 2]
    for i in range(1, n - 1):
        out[i] = (x[i + 1] - x[i - 1]) / 2.0
    return out


@njit(cache=True, nogil=True)
def unit_deviation(x: FloatArray) -> FloatArray:
    """x (N,) about its mean, at unit standard deviation; zeros where it does not vary."""
    return (x - mean(x)) / (deviation(x) or 1.0)


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def without_line(x: FloatArray) -> FloatArray:
    """x (N,) less its least-squares straight line."""
    n = len(x)
    level = mean(x)
    middle = (n - 1) / 2.0
    top = bottom = 0.0
    for i in range(n):
        top += (i - middle) * (x[i] - level)
        bottom += (i - middle) ** 2
    slope = top / bottom if bottom > 0.0 else 0.0
    out = np.empty(n)
    for i in range(n):
        out[i] = x[i] - level - slope * (i - middle)
    return out


@njit(cache=True, nogil=True)
def gathered(x: FloatArray, places: IntArray) -> FloatArray:
    """(M, k, n) of x (M, k, N): what it has at these places (n,) of its last axis."""
    out = np.empty((x.shape[0], x.shape[1], len(places)))
    for m in range(x.shape[0]):
        for k in range(x.shape[1]):
            for i in range(len(places)):
                out[m, k, i] = x[m, k, places[i]]
    return out


def held(time: FloatArray, x: FloatArray, at: FloatArray) -> FloatArray:
    """The newest of x (N,), N at least 1, known at `time` (N,), at each of the times `at`, of any shape; the first one
    before that. So goes what steps and holds, a set point: a straight line would make values that nobody gave.
    """
    values: FloatArray = x[np.maximum(np.searchsorted(time, at, side="right") - 1, 0)]
    return values


def block_means(x: FloatArray, stride: int) -> FloatArray:
    """(N // stride,) means of `stride` samples of x (N,) each; what is left over at the end is dropped."""
    return x if stride == 1 else x[: len(x) // stride * stride].reshape(-1, stride).mean(axis=1)


def blocks(x: NDArray[Number], length: int) -> NDArray[Number]:
    """(..., N) as (..., N // length, length)."""
    count = x.shape[-1] // length
    return x[..., : count * length].reshape(*x.shape[:-1], count, length)


def at_ends(x: FloatArray, low: float, high: float, band: float) -> tuple[BoolArray, BoolArray]:
    """(N,) each: where x (N,) is at `low` or below and where it is at `high` or above, by `band` in its unit."""
    return x <= low + band, x >= high - band


@njit(cache=True, nogil=True)
def piece_ranges(x: FloatArray, size: int) -> FloatArray:
    """(N // size,) what x (N,) goes over in each piece of `size` samples, a cycle or a part of one."""
    ranges = np.empty(len(x) // size)
    for k in range(len(ranges)):
        ranges[k] = peak_to_peak(x[k * size : (k + 1) * size])
    return ranges


def slow_share(blocks: FloatArray) -> float:
    """blocks: (B, L). The share of their variance that is between them, 0 to 1; 0 where nothing moves."""
    between, within = float(np.var(np.mean(blocks, axis=1))), float(np.mean(np.var(blocks, axis=1)))
    return between / (between + within) if between + within > 0.0 else 0.0


def unlike(x: FloatArray, given: FloatArray) -> FloatArray:
    """x (N,) less what a straight line over `given` (N,) says of it, whatever the units; 0 where nothing is left.

    For PV and SP this is the control error, also where the two are recorded in different units.
    """
    x, given = x - x.mean(), given - given.mean()
    power = float(given @ given)
    left = x - (float(x @ given) / power) * given if power > 0.0 else x
    return left if float(left @ left) > ROUNDING**2 * float(x @ x) else np.zeros_like(x)


@njit(cache=True, nogil=True)
def without_drift(x: FloatArray, half: int) -> FloatArray:
    """x (N,) less its straight line and, where N allows it, less its moving average over 2 half + 1 samples."""
    x = without_line(x)
    if len(x) < 2.5 * half:
        return x
    return x - moving_average(x, half)


def resample(x: FloatArray, samples_per_cycle: float, wanted: int) -> FloatArray:
    """x (N,) at `wanted` samples a cycle: averaged where that is coarser, on straight lines where it is finer."""
    n = len(x)
    m = max(round(n * wanted / samples_per_cycle), 16)
    return _on_lines(x, m) if samples_per_cycle <= wanted else _averaged(x, m)


@njit(cache=True, nogil=True)
def _on_lines(x: FloatArray, m: int) -> FloatArray:
    """(m,) values of straight lines between the samples of x (N,), evenly from the first to the last."""
    n = len(x)
    out = np.empty(m)
    for k in range(m):
        place = k * ((n - 1) / (m - 1))
        before = min(int(place), n - 2)
        out[k] = x[before] + (x[before + 1] - x[before]) * (place - before)
    return out


@njit(cache=True, nogil=True)
def _averaged(x: FloatArray, m: int) -> FloatArray:
    """(m,) means of x (N,), a straight line between its cumulated samples, over equal pieces."""
    n, total = len(x), cumulated(x)
    out = np.empty(m)
    edge, below = 0.0, 0.0
    for k in range(m):
        next_edge = float(n) if k == m - 1 else (k + 1) * (n / m)
        whole = min(int(next_edge), n - 1)
        upto = total[whole] + (total[whole + 1] - total[whole]) * (next_edge - whole)
        out[k] = (upto - below) / (next_edge - edge)
        edge, below = next_edge, upto
    return out


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def correlation(a: FloatArray, b: FloatArray) -> float:
    """Pearson's correlation of a and b (N,); 0 where one of them does not vary."""
    mean_a, mean_b = mean(a), mean(b)
    aa = ab = bb = 0.0
    for i in range(len(a)):
        p, q = a[i] - mean_a, b[i] - mean_b
        aa += p * p
        ab += p * q
        bb += q * q
    scale = np.sqrt(aa * bb)
    return ab / scale if scale > 0.0 else 0.0


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def skewness(x: FloatArray) -> float:
    """Absolute skewness of x (N,): the sign of a signal is free here."""
    middle = mean(x)
    second = third = 0.0
    for i in range(len(x)):
        p = x[i] - middle
        second += p * p
        third += p * p * p
    spread = np.sqrt(second / len(x))
    return abs(third / len(x)) / spread**3 if spread > 0.0 else 0.0


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def log_kurtosis(x: FloatArray) -> float:
    """Natural logarithm of the kurtosis of x (N,): 0 for a square wave, 0.4 a sine, 0.59 a triangle, 1.1 noise."""
    middle = mean(x)
    second = fourth = 0.0
    for i in range(len(x)):
        p = x[i] - middle
        second += p * p
        fourth += p * p * (p * p)
    variance = second / len(x)
    return np.log(fourth / len(x) / variance**2) if variance > 0.0 else 1.1


def quantiles(x: FloatArray, shares: tuple[float, ...]) -> FloatArray:
    """Quantiles of x (N,) at shares in 0..1, on straight lines between the sorted values."""
    last = len(x) - 1
    below = [min(int(share * last), max(last - 1, 0)) for share in shares]
    # Each lies between two values: no others need their order.
    ordered = np.partition(x, sorted({*below, *(min(k + 1, last) for k in below)}))
    return np.array([quantile(ordered, share) for share in shares])


@njit(cache=True, nogil=True)
def quantile(ordered: FloatArray, share: float) -> float:
    """Of sorted values (N,) at a share in 0..1, on a straight line between two of them."""
    place = share * (len(ordered) - 1)
    below = min(int(place), max(len(ordered) - 2, 0))
    low, high = ordered[below], ordered[min(below + 1, len(ordered) - 1)]
    return low + (high - low) * (place - below)


@lru_cache(maxsize=64)
def hann(n: int) -> FloatArray:
    """Hann's window (n,), read only."""
    window = np.hanning(n)
    window.flags.writeable = False
    return window


@njit(cache=True, nogil=True)
def burstiness(x: FloatArray, share: float = 0.2) -> float:
    """The part of the sum of abs(x) (N,) that its largest `share` of values hold, `share`..1."""
    size = np.abs(x)
    total, quieter = size.sum(), len(x) - max(1, int(share * len(x)))
    return np.partition(size, quieter)[quieter:].sum() / total if total > 0.0 else 1.0
