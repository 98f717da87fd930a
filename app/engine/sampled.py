"""Small compiled operations on sampled signals that the features share."""

import numpy as np
from numba import njit

from app.engine.recording import FloatArray

# A change of unit moves a signal at unit deviation by less than this; what is smaller is no movement.
ROUNDING = 1e-6


@njit(cache=True, nogil=True)
def moving_average(x: FloatArray, half: int) -> FloatArray:
    """Mean over 2 half + 1 samples around each sample of x (N,), over fewer at the ends."""
    n = len(x)
    total = np.empty(n + 1)
    total[0] = 0.0
    for i in range(n):
        total[i + 1] = total[i] + x[i]
    out = np.empty(n)
    for i in range(n):
        low, high = max(i - half, 0), min(i + half + 1, n)
        out[i] = (total[high] - total[low]) / (high - low)
    return out


@njit(cache=True, nogil=True)
def without_line(x: FloatArray) -> FloatArray:
    """x (N,) less its least-squares straight line."""
    n = len(x)
    mean = x.mean()
    middle = (n - 1) / 2.0
    top = bottom = 0.0
    for i in range(n):
        top += (i - middle) * (x[i] - mean)
        bottom += (i - middle) ** 2
    slope = top / bottom if bottom > 0.0 else 0.0
    out = np.empty(n)
    for i in range(n):
        out[i] = x[i] - mean - slope * (i - middle)
    return out


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
    if samples_per_cycle <= wanted:
        return np.interp(np.linspace(0, n - 1, m), np.arange(n), x)
    edges = np.linspace(0, n, m + 1)
    total = np.interp(edges, np.arange(n + 1), np.concatenate(([0.0], np.cumsum(x))))
    return np.diff(total) / np.diff(edges)


def correlation(a: FloatArray, b: FloatArray) -> float:
    """Pearson's correlation of a and b (N,); 0 where one of them does not vary."""
    a, b = a - a.mean(), b - b.mean()
    scale = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / scale if scale > 0.0 else 0.0


def skewness(x: FloatArray) -> float:
    """Absolute skewness of x (N,): the sign of a signal is free here."""
    x = x - x.mean()
    spread = float(np.sqrt(np.mean(x * x)))
    return abs(float(np.mean(x**3))) / spread**3 if spread > 0.0 else 0.0


def log_kurtosis(x: FloatArray) -> float:
    """Natural logarithm of the kurtosis of x (N,): 0 for a square wave, 0.4 a sine, 0.59 a triangle, 1.1 noise."""
    x = x - x.mean()
    variance = float(np.mean(x * x))
    return float(np.log(np.mean(x**4) / variance**2)) if variance > 0.0 else 1.1


def burstiness(x: FloatArray, share: float = 0.2) -> float:
    """The part of the sum of abs(x) (N,) that its largest `share` of values hold, `share`..1."""
    size = np.sort(np.abs(x))[::-1]
    total = float(size.sum())
    return float(size[: max(1, int(share * len(size)))].sum()) / total if total > 0.0 else 1.0
