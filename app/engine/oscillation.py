"""Whether a loop oscillates, with which period, and how regularly: the autocorrelation method."""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy import fft

from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.sampled import ROUNDING, block_means, moving_average, unlike

REGULAR_ABOVE = 1.0
FEW_INTERVALS = 0.3
"""Regularity where two intervals between crossings are all there is: not regular, and yet an oscillation."""

_TREND_SHARES = (0.0, 0.25, 0.08, 0.025)
# Of a regular oscillation, and of one that is not: three to five samples a turn are what noise makes, not a shape.
_LEAST_PERIOD, _LEAST_IRREGULAR = 3.0, 5.0
_HYSTERESIS = 0.05
_CROSSINGS = 11
_LONGEST_SEARCHED = 16384
# Of the steps, and of one: a ramp that is rounded to steps leaves 0.29 of one, and more where some were filled in.
_ONE_WAY, _OF_ROUNDING = 0.9, 0.5


@dataclass(frozen=True)
class Oscillation:
    """The strongest oscillation of a record.

    period_s: its period in seconds; None where no signal's autocorrelation swings back.
    regularity: Thornhill's r = (1/3) mean / standard deviation of the intervals between zero crossings of the
        autocorrelation; above 1 the oscillation is regular. FEW_INTERVALS where there are two of them only, as in a
        record of less than about 3.4 cycles, which no spread can be told from; 0 where no oscillation is found.
    strength: height of the autocorrelation's first peak after its first trough, 0..1.
    samples_per_cycle: period over sampling interval.
    cycles: periods in the record.
    signal: which signal showed it ("pv", "op" or "error", that is PV - SP).
    trend_share: length of the moving average that was taken off first, as a share of the record (0: a straight line).
    """

    period_s: float | None
    regularity: float
    strength: float
    samples_per_cycle: float | None
    cycles: float
    signal: str
    trend_share: float

    @property
    def regular(self) -> bool:
        return self.period_s is not None and self.regularity > REGULAR_ABOVE

    @property
    def clarity(self) -> float:
        """How strong and how regular it is, in one number, 0..0.75."""
        return clarity(self.strength, self.regularity)

    def swings(self, regular_from: float, irregular_from: float, least_cycles: float) -> bool:
        """Whether it is strong enough, by what is asked of a regular and of an irregular one, for so many cycles."""
        return self.strength >= (regular_from if self.regular else irregular_from) and self.cycles >= least_cycles


def clarity(strength: float, regularity: float) -> float:
    # Regularity beyond about 3 says nothing more, while a weak but even ripple must not beat a strong swing.
    return strength * min(regularity, 3.0) / (min(regularity, 3.0) + 1.0)


@dataclass(frozen=True)
class _Swing:
    """Period in samples, regularity and strength of one autocorrelation function."""

    period: float
    regularity: float
    strength: float

    @property
    def score(self) -> float:
        return clarity(self.strength, self.regularity)


_NO_OSCILLATION = Oscillation(None, 0.0, 0.0, None, 0.0, "pv", 0.0)


def autocorrelation(x: FloatArray) -> FloatArray:
    """Autocorrelation (..., N//2) of x (..., N), finite, about its mean, divided by N - lag, so that it does not fade
    with the lag.

    Returns zeros where x does not vary.
    """
    x = x - x.mean(axis=-1, keepdims=True)
    n = x.shape[-1]
    size = fft.next_fast_len(n + n // 2, real=True)  # no lag that is asked for hears the other end of x
    spectrum = fft.rfft(x, size)
    raw = fft.irfft(spectrum.real**2 + spectrum.imag**2, size)[..., : n // 2]
    power = raw[..., :1]
    varies = power > 0.0
    return np.where(varies, raw / np.where(varies, power, 1.0) * (n / (n - np.arange(n // 2))), 0.0)


def detect(record: UniformRecord) -> Oscillation:
    """The strongest regular oscillation in PV, OP and PV - SP, raw and with slow trends taken off.

    Zero crossings of the autocorrelation function give period and regularity (Thornhill, Huang, Zhang 2003,
    J. Process Control 13, 91-100, doi 10.1016/S0959-1524(02)00007-0). Crossings count only where the function leaves a
    band of +-0.05, so that noise around zero is not counted. Misleads where two oscillations of similar strength
    overlap, and where a load wanders: what is left of it once its trend is off swings somehow, and the best of up to
    twelve functions is kept. Of pairs of first-order noises (0.8 to 0.99 a sample, 600 and 2,000 samples) 51 to 87 %
    are regular, 3 to 15 % by PV's own function alone; their strength is below 0.54 in 95 % of cases, so that only both
    together say that a loop oscillates. It sees nothing of periods longer than about 0.42 of the record: three
    crossings within its first half need some 2.4 cycles. Records above 16,384 samples are thinned first: periods below
    about six of the remaining samples are then not seen.
    """
    stride = max(1, -(-record.samples // _LONGEST_SEARCHED))
    signals, candidates = _signals(record, stride), []
    for name, x in signals.items():
        # Side by side they share the registers of the transform.
        functions = autocorrelation(np.array([_without_trend(x, share) for share in _TREND_SHARES]))
        for share, function in zip(_TREND_SHARES, functions, strict=True):
            swing = _swing(function)
            if swing is not None:
                candidates.append((swing.score, -share, name, swing))
    strongest = sorted(candidates, key=lambda c: c[:2], reverse=True)
    found = next((c for c in strongest if not _is_rounding(signals[c[2]], -c[1])), None)
    if found is None:
        return _NO_OSCILLATION
    _, minus_share, name, swing = found
    per_cycle = swing.period * stride
    return Oscillation(
        period_s=per_cycle * record.sampling_interval_s,
        regularity=swing.regularity,
        strength=swing.strength,
        samples_per_cycle=per_cycle,
        cycles=record.samples / per_cycle,
        signal=name,
        trend_share=-minus_share,
    )


def _is_rounding(x: FloatArray, share: float) -> bool:
    """Whether x (n,) goes one way in steps, and what swings in it, less its trend, is no more than these add to a ramp:
    in a swing each step is followed by its opposite.
    """
    steps = np.diff(x)
    steps = steps[np.abs(steps) > ROUNDING * float(np.ptp(x))]
    if len(steps) == 0 or abs(float(np.mean(np.sign(steps)))) < _ONE_WAY:
        return False
    return float(np.std(_without_trend(x, share))) < _OF_ROUNDING * float(np.median(np.abs(steps)))


def _signals(record: UniformRecord, stride: int) -> dict[str, FloatArray]:
    signals = [("pv", record.pv), ("op", record.op)]
    if record.sp is not None and np.ptp(record.sp) > 0.0:
        signals.append(("error", unlike(record.pv, record.sp)))
    return {name: block_means(x, stride) for name, x in signals if _varies(x)}


def _varies(x: FloatArray) -> bool:
    return len(x) >= 16 and float(np.ptp(x)) > 1e-9 * float(np.max(np.abs(x)))


def _without_trend(x: FloatArray, share: float) -> FloatArray:
    """x less a straight line, or less its moving average over `share` of its length (shorter at the ends)."""
    n, x = len(x), x - x.mean()
    if share == 0.0:
        t = np.arange(n) - (n - 1) / 2
        return x - t * (t @ x) / (t @ t)
    return x - moving_average(x, max(2, int(share * n / 2)))


def _swing(acf: FloatArray) -> _Swing | None:
    """Period, regularity and strength from the zero crossings of an autocorrelation function, or None."""
    crossings = _crossings(acf)
    if len(crossings) < 3:
        return None
    intervals = np.diff(crossings).tolist()
    mean = sum(intervals) / len(intervals)
    period = 2.0 * mean
    if period < _LEAST_PERIOD:
        return None
    # The first swing: it starts at the second crossing (from below to above) and ends at the third.
    # An estimate over fewer pairs at each lag may pass 1 by a little.
    strength = min(float(np.max(acf[int(crossings[1]) : int(crossings[2]) + 2])), 1.0)
    regularity = _regularity(intervals, mean)
    return _Swing(period, regularity, strength) if period >= _LEAST_IRREGULAR or regularity > REGULAR_ABOVE else None


def _regularity(intervals: list[float], mean: float) -> float:
    if len(intervals) < 3:
        return FEW_INTERVALS
    spread = math.sqrt(sum((interval - mean) ** 2 for interval in intervals) / (len(intervals) - 1))
    return min(mean / (3.0 * spread + 1e-12), 100.0)


@njit(cache=True, nogil=True)
def _crossings(acf: FloatArray) -> FloatArray:
    """Lags (interpolated) of the first zero crossings between excursions beyond +-0.05."""
    crossings = np.empty(_CROSSINGS)
    count, before = 0, -1
    for lag in range(len(acf)):
        if not abs(acf[lag]) > _HYSTERESIS:
            continue
        if before >= 0 and (acf[lag] > 0.0) != (acf[before] > 0.0):
            crossings[count] = before + (lag - before) * acf[before] / (acf[before] - acf[lag])
            count += 1
            if count == _CROSSINGS:
                break
        before = lag
    return crossings[:count]
