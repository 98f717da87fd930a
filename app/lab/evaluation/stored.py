"""The labelled recordings as other historians would have stored them: what that costs the verdict."""

import zlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from app.engine.recording import FloatArray, Recording
from app.engine.simulate.compression import Compression, keep, rebuild

Storing = Callable[[Recording], Recording]

_WITHIN = (1.0, 99.0)  # per cent of the values: the range without single spikes


def late(samples: int) -> Storing:
    """PV is stamped so many samples after OP, or before it where negative: scanned by another card, at another time."""

    def stored(recording: Recording) -> Recording:
        n = recording.samples
        first, last = max(samples, 0), n + min(samples, 0)
        common = recording.part(slice(first, last))
        return replace(common, pv=recording.pv[first - samples : last - samples])

    return stored


def every(step: int) -> Storing:
    """One sample of so many."""
    return lambda recording: recording.part(slice(None, None, step))


def lacking(share: float) -> Storing:
    """Without that share of the samples, wherever chance has it."""

    def stored(recording: Recording) -> Recording:
        return recording.part(_dice(recording).random(recording.samples) >= share)

    return stored


def rounded(share: float) -> Storing:
    """PV and OP to steps of that share of their ranges."""

    def stored(recording: Recording) -> Recording:
        pv, op = (share * _range(signal) for signal in (recording.pv, recording.op))
        return replace(recording, pv=_to_steps(recording.pv, pv), op=_to_steps(recording.op, op))

    return stored


def compressed(kind: Compression, share: float) -> Storing:
    """PV and OP compressed with a deviation of that share of their ranges, and exported at the times of the record."""

    def stored(recording: Recording) -> Recording:
        pv, op = (_compressed(recording.time_s, signal, kind, share) for signal in (recording.pv, recording.op))
        return replace(recording, pv=pv, op=op)

    return stored


def noisy(share: float) -> Storing:
    """White noise on PV, its standard deviation that share of PV's range."""

    def stored(recording: Recording) -> Recording:
        noise = _dice(recording).normal(size=recording.samples)
        return replace(recording, pv=recording.pv + share * _range(recording.pv) * noise)

    return stored


def half(which: int) -> Storing:
    """The first half of the samples (0) or the second (1)."""

    def stored(recording: Recording) -> Recording:
        middle = recording.samples // 2
        return recording.part(slice(which * middle, (which + 1) * middle))

    return stored


WAYS: dict[str, Storing] = {
    "as recorded": lambda recording: recording,
    "PV a sample late": late(1),
    "PV a sample early": late(-1),
    "PV two samples late": late(2),
    "PV two samples early": late(-2),
    "PV four samples late": late(4),
    "PV four samples early": late(-4),
    "every second sample": every(2),
    "every fourth sample": every(4),
    "a tenth of the samples lacking": lacking(0.1),
    "steps of 2 % of the range": rounded(0.02),
    "steps of 5 % of the range": rounded(0.05),
    "exception reporting, 1 % of the range": compressed("exception", 0.01),
    "exception reporting, 3 % of the range": compressed("exception", 0.03),
    "swinging door, 1 % of the range": compressed("swinging_door", 0.01),
    "swinging door, 3 % of the range": compressed("swinging_door", 0.03),
    "noise of 2 % of the range on PV": noisy(0.02),
    "noise of 5 % of the range on PV": noisy(0.05),
    "first half": half(0),
    "second half": half(1),
}


def _dice(recording: Recording) -> np.random.Generator:
    return np.random.default_rng(zlib.crc32(recording.name.encode()))


def _range(signal: FloatArray) -> float:
    low, high = np.nanpercentile(signal, _WITHIN)
    return float(high - low)


def _to_steps(signal: FloatArray, step: float) -> FloatArray:
    return np.round(signal / step) * step if step > 0.0 else signal


def _compressed(time_s: FloatArray, signal: FloatArray, kind: Compression, share: float) -> FloatArray:
    known = np.isfinite(signal)
    deviation = share * _range(signal)
    if deviation <= 0.0:
        return signal
    values = np.interp(time_s, time_s[known], signal[known])
    return np.where(known, rebuild(time_s, values, keep(time_s, values, deviation, kind), kind), np.nan)
