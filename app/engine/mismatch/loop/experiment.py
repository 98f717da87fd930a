"""What was recorded, as deviations from its means, and which samples may be compared with a simulation."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.engine.mismatch.loop.law import fed_back, follows
from app.engine.recording import BoolArray, FloatArray

FIRST_SAMPLES = 3
_LEAST_SHARE = 1e-3  # of a signal's range: narrower, and what lies within the outermost 1 % does not show how it moves
LARGEST = 1e100
"""Of what is compared: its square is a number too."""


def may_be_gain(gain: float) -> bool:
    """Whether a process can be simulated with it: a finite number other than 0."""
    return 1.0 / LARGEST <= abs(gain) <= LARGEST


@dataclass(frozen=True, eq=False)
class Finer:
    """What a record was taken from: the record as it was sampled, and at which of its samples (M,)."""

    record: "Experiment"
    taken: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Experiment:
    """A record on a uniform time base, ready to be simulated.

    sampling_interval_s: Ts in s. op, pv: (N,) in their units, op_mid and pv_mid their means. sp: (N,) or None.
    op_deviation, pv_deviation: (N,) from those means. op_span, pv_span: their ranges as `span` has them.
    measured: further signals (N,) by name. usable: (N,) True where PV is compared.
    rest: (N,) what a given simulation holds beside its linear model, unit of PV; zero where it is linear.
    finer: where PV was taken at some instants only, the record that is simulated between them; None: this one.
    first_s: its first sample, s from the start of the recording: instants at which PV was taken have their own start.
    recorded_s: where the recording ends, s from its start: a PV that is held may be held on beyond that; None: with the
    interval of its last sample.
    feedback: whether OP is fed back from PV, where another record of the same loop tells; None: this one tells.
    reference_s: seconds of the record that sizes over its duration are of, as those of a drift; None: this one's.
    stored_evenly: whether all samples are as they were stored; False: some lie between two, as beside a gap.
    told_share: of its samples, how many a historian stored, where the others were filled in between them: what a fit
    gains counts so much.
    reference_middles: of measured signals by name, where another record's count; None: this one's means.
    """

    sampling_interval_s: float
    op: FloatArray
    pv: FloatArray
    usable: BoolArray
    op_mid: float
    pv_mid: float
    op_deviation: FloatArray
    pv_deviation: FloatArray
    op_span: float
    pv_span: float
    sp: FloatArray | None = None
    measured: tuple[tuple[str, FloatArray], ...] = ()
    rest: FloatArray = field(default_factory=lambda: np.zeros(0))
    finer: Finer | None = None
    first_s: float = 0.0
    recorded_s: float | None = None
    feedback: bool | None = None
    reference_s: float | None = None
    reference_middles: tuple[tuple[str, float], ...] | None = None
    stored_evenly: bool = True
    told_share: float = 1.0

    @property
    def samples(self) -> int:
        return len(self.pv)

    @cached_property
    def op_range(self) -> float:
        """From the lowest to the highest OP, its unit; never zero."""
        return float(max(np.ptp(self.op), self.op_span))

    @cached_property
    def pv_first(self) -> float:
        """Where PV started, as deviation: the mean of its FIRST_SAMPLES."""
        return float(np.mean(self.pv_deviation[:FIRST_SAMPLES]))

    @cached_property
    def time_s(self) -> FloatArray:
        """(N,) seconds from the start of the recording; made once, because every simulation asks for it."""
        return self.first_s + np.arange(self.samples, dtype=np.float64) * self.sampling_interval_s

    @cached_property
    def op_follows_pv(self) -> bool:
        """Whether a controller's law explains most of OP's moves by PV: then OP carries the noise of PV."""
        return follows(self.sp, self.pv, self.op, self.usable)

    @cached_property
    def fed_back(self) -> bool:
        """Whether OP carries the noise that PV has in the same sample, by a PID law or any other."""
        if self.feedback is not None:
            return self.feedback
        return self.op_follows_pv or fed_back(self.sp, self.pv, self.op, self.usable)

    @property
    def duration_s(self) -> float:
        return self.samples * self.sampling_interval_s

    @property
    def end_s(self) -> float:
        """Where the recording ends, s from its start."""
        last = self.first_s + self.duration_s
        return last if self.recorded_s is None else min(last, self.recorded_s)

    @property
    def reference_duration_s(self) -> float:
        """Over how many seconds the sizes of what grows along the record are told."""
        return self.duration_s if self.reference_s is None else self.reference_s

    @cached_property
    def middles(self) -> tuple[tuple[str, float], ...]:
        """Where each measured signal's deviations are taken from, its unit."""
        if self.reference_middles is not None:
            return self.reference_middles
        return tuple((name, float(np.mean(signal))) for name, signal in self.measured)

    def with_op(self, op: FloatArray) -> "Experiment":
        """The same record under another OP (N,), its deviations from the same mean; PV is as late behind it."""
        return replace(self, op=op, op_deviation=op - self.op_mid, finer=None, feedback=self.fed_back)

    def with_op_changed(self, change: Callable[[FloatArray], FloatArray]) -> "Experiment":
        """The same record under what `change` makes of its OP (N,): of the samples between PV's as well, where it is
        simulated along them.
        """
        changed = self.with_op(change(self.op))
        if self.finer is None:
            return changed
        return replace(changed, finer=replace(self.finer, record=self.finer.record.with_op_changed(change)))

    def referring(self, first: "Experiment") -> "Experiment":
        """The record with all that a model of the first one refers to, so that the model means the same here."""
        return replace(
            self,
            feedback=first.fed_back,
            reference_s=first.reference_duration_s,
            reference_middles=first.middles,
        )

    def stretch(self, begin: int, end: int) -> "Experiment":
        """The samples from `begin` to before `end`, as deviations from the means of the whole."""
        part = slice(begin, end)
        return replace(
            self.referring(self),
            op=self.op[part],
            pv=self.pv[part],
            usable=self.usable[part],
            op_deviation=self.op_deviation[part],
            pv_deviation=self.pv_deviation[part],
            sp=None if self.sp is None else self.sp[part],
            measured=tuple((name, signal[part]) for name, signal in self.measured),
            rest=self.rest[part],
            finer=None,
        )

    def comparing(self, usable: BoolArray) -> "Experiment":
        """The same record with other samples compared."""
        return replace(self, usable=usable)

    @property
    def as_sampled(self) -> "Experiment":
        """The record that is simulated."""
        return self if self.finer is None else self.finer.record

    def resting(self, rest: FloatArray) -> "Experiment":
        """The same record with what a given simulation holds beside its linear model, at the samples simulated."""
        if self.finer is None:
            return replace(self, rest=rest)
        finer = replace(self.finer, record=replace(self.finer.record, rest=rest))
        return replace(self, rest=rest[finer.taken], finer=finer)


def experiment(
    sampling_interval_s: float,
    op: FloatArray,
    pv: FloatArray,
    sp: FloatArray | None = None,
    measured: tuple[tuple[str, FloatArray], ...] = (),
) -> Experiment:
    """An Experiment with every sample compared. op, pv, sp: (N,) finite; sampling_interval_s: s."""
    op = np.ascontiguousarray(op, dtype=np.float64)
    pv = np.ascontiguousarray(pv, dtype=np.float64)
    op_mid, pv_mid = float(np.mean(op)), float(np.mean(pv))
    return Experiment(
        sampling_interval_s=sampling_interval_s,
        op=op,
        pv=pv,
        usable=np.ones(len(pv), dtype=np.bool_),
        op_mid=op_mid,
        pv_mid=pv_mid,
        op_deviation=op - op_mid,
        pv_deviation=pv - pv_mid,
        op_span=span(op),
        pv_span=span(pv),
        sp=sp,
        measured=measured,
        rest=np.zeros(len(pv)),
    )


def span(signal: FloatArray) -> float:
    """The range of a signal (N,) without its outermost 1 % at either end, all of it where hardly any is left of it, as
    of one that moves in a short pulse; never zero.
    """
    low, high = np.quantile(signal, (0.01, 0.99))
    inner, whole = float(high - low), float(np.ptp(signal))
    return max(inner if inner > _LEAST_SHARE * whole else whole, 1.0 / LARGEST)


def alike(first: Experiment, second: Experiment) -> Experiment:
    """The second record as deviations from the first one's means and in its spans, so that a model of the first fits
    it.
    """
    return replace(
        second.referring(first),
        op_mid=first.op_mid,
        pv_mid=first.pv_mid,
        op_deviation=second.op - first.op_mid,
        pv_deviation=second.pv - first.pv_mid,
        op_span=first.op_span,
        pv_span=first.pv_span,
    )
