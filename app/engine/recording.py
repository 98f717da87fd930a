"""What a loop's record is: PV, OP, SP, mode, sampling times, and which samples were filled in."""

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from app.errors import DataError

FloatArray = NDArray[np.float64]
Array32 = NDArray[np.float32]
Steps = NDArray[np.uint16]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

_DECIDES = ("time_s", "pv", "op", "sp", "automatic", "op_range", "pv_range", "integrating")


Span = tuple[float, float]


def known_span(span: Span | None) -> Span | None:
    """(low, high) of an instrument's span, in whichever order its ends were given; None where it is not known.

    No span has ends that are not finite numbers, or two that are one.
    """
    if span is None:
        return None
    low, high = min(span), max(span)
    return (low, high) if math.isfinite(high - low) and low < high else None


def _floats(name: str, signal: ArrayLike) -> FloatArray:
    """Times of a calendar would become nanoseconds, and texts whatever they look like."""
    values = np.asarray(signal)
    if values.dtype.kind not in "biuf":
        raise DataError("signal_type", f"{name} must be numbers, got {values.dtype}")
    return values.astype(np.float64, copy=False)


def _flags(automatic: ArrayLike) -> BoolArray:
    """Anything but 0 would become True, a mode that is not known too."""
    values = np.asarray(automatic)
    if values.dtype == np.bool_:
        return values
    numbers = _floats("automatic", values)
    if not np.all((numbers == 0) | (numbers == 1)):
        raise DataError("signal_type", "automatic must be True or False, or 1 or 0, at each sample")
    return numbers == 1


@dataclass(frozen=True, eq=False)
class Recording:
    """One loop's record as it was sampled: possibly irregular, with gaps (NaN) and flat stretches.

    name: the recording's name (a file name without its suffix, or the loop's tag).
    time_s: (N,) seconds from the first sample, increasing.
    pv, op: (N,) process output and controller output in engineering units; NaN where missing.
    sp: (N,) set point in the unit of PV, or None where it was not recorded.
    automatic: (N,) True where the loop was in automatic (or cascade), or None where the mode was not recorded.
    op_range, pv_range: (low, high) of the instrument's span in its unit, or None where it is not known; as they were
    given, so read them by `known_span`.
    integrating: whether the process integrates (a level), or None where it is not known.
    others: further measured signals, (N,) each, by name.
    Signals of other types are made float64, the mode bool; those that are so already are not copied.
    Raises DataError("signal_type") where a signal is not of numbers or the mode not of 1 and 0, "signal_length" where
    the signals' lengths differ and "time_order" where time does not increase.
    """

    name: str
    time_s: FloatArray
    pv: FloatArray
    op: FloatArray
    sp: FloatArray | None = None
    automatic: BoolArray | None = None
    op_range: Span | None = None
    pv_range: Span | None = None
    integrating: bool | None = None
    others: Mapping[str, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._make_floats()
        n = len(self.time_s)
        signals = {"pv": self.pv, "op": self.op, "sp": self.sp, "automatic": self.automatic, **self.others}
        for name, signal in signals.items():
            if signal is not None and len(signal) != n:
                got = f"{name} has {len(signal):,} samples, time has {n:,}; they must be the same"
                raise DataError("signal_length", got)
        if n > 1 and not np.all(np.diff(self.time_s) > 0):
            raise DataError("time_order", "sampling times must increase; sort the samples and drop repeated times")

    def _make_floats(self) -> None:
        """Integers without a sign, as some systems export them, would wrap where SP - PV is below zero."""
        for name in ("time_s", "pv", "op", "sp"):
            signal = getattr(self, name)
            if signal is not None:
                object.__setattr__(self, name, _floats(name, signal))
        if self.automatic is not None:
            object.__setattr__(self, "automatic", _flags(self.automatic))
        others = {name: _floats(name, signal) for name, signal in self.others.items()}
        if any(others[name] is not signal for name, signal in self.others.items()):
            object.__setattr__(self, "others", others)

    @property
    def samples(self) -> int:
        return len(self.time_s)

    def part(self, which: slice | BoolArray | IntArray) -> "Recording":
        """Those samples alone, at their times."""
        return replace(
            self,
            time_s=self.time_s[which],
            pv=self.pv[which],
            op=self.op[which],
            sp=None if self.sp is None else self.sp[which],
            automatic=None if self.automatic is None else self.automatic[which],
            others={name: signal[which] for name, signal in self.others.items()},
        )

    def fingerprint(self) -> str:
        """SHA-256 over all that decides the verdict: times, signals, spans and whether the process integrates, each
        under its name and length. The same on any machine; the recording's name and `others` are not part of it.
        """
        digest = hashlib.sha256()
        for name in _DECIDES:
            given = getattr(self, name)
            if given is not None:
                values = np.ascontiguousarray(given, dtype="<f8")
                digest.update(f"{name}|{values.size}|".encode())
                digest.update(values.data)
        return digest.hexdigest()


@dataclass(frozen=True, eq=False)
class UniformRecord:
    """A stretch of a recording on a uniform time base, without gaps: what identification works on.

    sampling_interval_s: Ts in seconds.
    pv, op: (N,) finite, in engineering units. sp: (N,) finite, or None.
    filled: (N,) True where the sample was interpolated by us.
    start_s: time of the first sample in seconds from the start of the recording.
    """

    sampling_interval_s: float
    pv: FloatArray
    op: FloatArray
    sp: FloatArray | None
    filled: BoolArray
    start_s: float = 0.0

    @property
    def samples(self) -> int:
        return len(self.pv)

    @property
    def length_s(self) -> float:
        """Each sample stands for an interval."""
        return self.samples * self.sampling_interval_s

    @property
    def end_s(self) -> float:
        """When the interval of the last sample ends, in seconds from the start of the recording."""
        return self.start_s + self.length_s

    def part(self, which: slice) -> "UniformRecord":
        """Those samples alone; the slice has a start."""
        return UniformRecord(
            self.sampling_interval_s,
            self.pv[which],
            self.op[which],
            None if self.sp is None else self.sp[which],
            self.filled[which],
            self.start_s + which.start * self.sampling_interval_s,
        )
