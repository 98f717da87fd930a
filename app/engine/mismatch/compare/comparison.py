"""What is compared: a recording and a simulation of it, checked before anything is computed."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from app.counting import counted, counted_times
from app.engine.evidence import Reason
from app.engine.mismatch.compare.thinning import centred_all, centred_means, held_means
from app.engine.mismatch.fit.given import LEAST_DAMPING
from app.engine.mismatch.fit.task import Given
from app.engine.mismatch.loop.experiment import LARGEST, Experiment, experiment, may_be_gain
from app.engine.mismatch.loop.law import Controller
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.recording import BoolArray, FloatArray
from app.errors import DataError

LEAST_SAMPLES = 100
_LEAST_MOVES = 10
_STRONGEST = 1e12
_WILD, _WILD_SHARE, _OUTSIDE = 30.0, 0.01, 5.0
MOST_SAMPLES = 40_000
_STRETCHES_TRIED, _CLEARLY_FARTHER = 9, 1.2  # of a longer record; times as far as its beginning is
_QUICK_SAMPLES, _MOST_QUICK_SAMPLES, _MOST_QUICK_AS_SAMPLED = 1500, 3000, 20_000
_INTERVALS_A_MEMORY = 3.0
_LEAST_TIME_CONSTANT = 0.05
_NO_LAG = 1e-9  # s: so short a lag is none, as the plant runs it
_MOST_LAGS, _LONGEST_LAG = 2, 1000.0  # so many records long; a longer one is no other than an integrator
_MOST_DAMPING = 10.0  # more is two lags of which one is as good as none

Through = Callable[[FloatArray], FloatArray]
"""A signal (N,) as another (M,)."""


@dataclass(frozen=True)
class LinearSimulation:
    """An engineer's model: gain (PV per OP, per second where integrating), time constants and dead time in s; and the
    controller, where the simulation has one of its own.

    damping: of gain / (tau^2 s^2 + 2 damping tau s + 1), where tau, one over the natural angular frequency, is the
    first of the time constants; what follows is a lag behind that. None: all of them are lags.
    """

    gain: float
    time_constants_s: tuple[float, ...] = ()
    dead_time_s: float = 0.0
    integrating: bool = False
    controller: Controller | None = None
    damping: float | None = None


@dataclass(frozen=True, eq=False)
class Comparison:
    """What is compared: equally sampled signals (N,), and the simulation as a trace (N,), as a model, or None for our
    own.

    sampling_interval_s: s. op, pv, sp: engineering units; measured: further signals by name. known: (N,) False where
    PV was filled in. notes: what was mended of the signals before, to be said with the answer.
    """

    name: str
    sampling_interval_s: float
    op: FloatArray
    pv: FloatArray
    sp: FloatArray | None = None
    measured: tuple[tuple[str, FloatArray], ...] = ()
    known: BoolArray | None = None
    trace: FloatArray | None = None
    simulation: LinearSimulation | None = None
    notes: tuple[Reason, ...] = ()

    def part(self, which: slice) -> "Comparison":
        """Those samples alone, at second 0 again."""
        return self.through(lambda signal: signal[which], lambda pv: pv[which], lambda known: known[which])

    def through(
        self,
        drive: Through,
        response: Through,
        known: Callable[[BoolArray], BoolArray],
        sp: Through | None = None,
        trace: Through | None = None,
        times: float = 1,
    ) -> "Comparison":
        """Its signals, each (N,), as others (M,): OP and what is measured by `drive`, PV by `response`, SP and the
        trace as PV where nothing else is said. times: how much longer the interval is.
        """
        return replace(
            self,
            sampling_interval_s=self.sampling_interval_s * times,
            op=drive(self.op),
            pv=response(self.pv),
            sp=None if self.sp is None else (sp or response)(self.sp),
            measured=tuple((name, drive(signal)) for name, signal in self.measured),
            known=None if self.known is None else known(self.known),
            trace=None if self.trace is None else (trace or response)(self.trace),
        )


def record_of(comparison: Comparison) -> Experiment:
    """Compared where PV is known."""
    c = comparison
    record = experiment(c.sampling_interval_s, c.op, c.pv, c.sp, c.measured)
    return record if c.known is None else replace(record.comparing(c.known), stored_evenly=False)


def check(comparison: Comparison) -> None:
    """Raises DataError("too_short", "interval_invalid", "signal_length", "signal_not_finite", "simulation_length",
    "simulation_not_finite", "simulation_constant", "nothing_known", "signal_constant", "signal_too_large",
    "model_invalid").
    """
    n, ts = len(comparison.pv), comparison.sampling_interval_s
    if not (np.isfinite(ts) and ts > 0.0):
        raise DataError("interval_invalid", f"the sampling interval is {ts:g} s, it must be more than 0")
    if n < LEAST_SAMPLES:
        raise DataError(
            "too_short",
            f"{counted(n, 'sample is', 'samples are')} too few to explain a difference, at least {LEAST_SAMPLES} are "
            "needed",
        )
    if len(comparison.op) != n:
        raise DataError("signal_length", f"OP has {len(comparison.op):,} samples, PV has {n:,}; they must be the same")
    _check_beside(comparison)
    _check_trace(comparison)
    _check_moves(comparison)
    if comparison.simulation is not None:
        _check_model(comparison.simulation, n * ts)


def _check_beside(comparison: Comparison) -> None:
    """SP and further signals: as long as PV, a value in every sample."""
    n = len(comparison.pv)
    for name, signal in (("SP", comparison.sp), *comparison.measured):
        if signal is None:
            continue
        if len(signal) != n:
            raise DataError("signal_length", f"{name} has {len(signal):,} samples, PV has {n:,}; they must be the same")
        if not np.all(np.isfinite(signal)):
            raise DataError("signal_not_finite", f"{name} has samples without a value; fill them or leave it out")
        _check_size(name, signal)


def _check_size(name: str, signal: FloatArray) -> None:
    """Squares of values must still be numbers."""
    most = float(np.max(np.abs(signal)))
    if most > LARGEST:
        raise DataError("signal_too_large", f"{name} has a value of {most:.3g}, at most {LARGEST:g} can be compared")


def _check_moves(comparison: Comparison) -> None:
    """OP and PV move, and something of PV is known."""
    for name, signal in (("OP", comparison.op), ("PV", comparison.pv)):
        if not np.all(np.isfinite(signal)) or np.ptp(signal) <= 1.0 / LARGEST:
            raise DataError(
                "signal_constant", f"{name} is constant or not finite: there is nothing to compare a simulation with"
            )
        _check_size(name, signal)
    if comparison.known is not None and not np.any(comparison.known):
        raise DataError("nothing_known", "no sample of PV is known: there is nothing to compare a simulation with")
    # What a gap of a PV that is frozen was bridged with moves, too.
    pv = comparison.pv if comparison.known is None else comparison.pv[comparison.known]
    moves = int(np.count_nonzero(np.diff(pv)))
    if moves < _LEAST_MOVES:
        raise DataError(
            "signal_constant",
            f"PV changes {counted_times(moves)} in {counted(len(pv), 'sample')}, at least {_LEAST_MOVES} are needed: "
            "there is nothing to compare a simulation with",
        )


def _check_trace(comparison: Comparison) -> None:
    trace, n = comparison.trace, len(comparison.pv)
    if trace is None:
        return
    if len(trace) != n:
        raise DataError("simulation_length", f"the simulation has {len(trace):,} samples, the recording {n:,}")
    if not np.all(np.isfinite(trace)):
        raise DataError(
            "simulation_not_finite", "the simulation has samples without a value; it must cover the recording"
        )
    _check_size("the simulation", trace)
    if np.ptp(trace) <= 0.0:
        raise DataError(
            "simulation_constant", "the simulation is constant: it does not answer OP, so there is no model behind it"
        )


def _check_model(simulation: LinearSimulation, duration_s: float) -> None:
    """Raises DataError("model_invalid") where a model cannot be simulated along a record of this length (s)."""
    gain, taus, late = simulation.gain, simulation.time_constants_s, simulation.dead_time_s
    longest = _LONGEST_LAG * duration_s
    if not may_be_gain(gain):
        fault = f"its gain is {gain:g}; a finite number other than 0 is needed"
    elif len(taus) > _MOST_LAGS:
        fault = f"it has {len(taus)} time constants, at most {_MOST_LAGS} can be fitted"
    elif not all(0.0 <= tau <= longest for tau in taus):
        told = ", ".join(f"{tau:g}" for tau in taus)
        fault = (
            f"its time constants are {told} s; from 0 to {longest:g} s ({_LONGEST_LAG:g} times the recording) are "
            "needed: what is slower integrates"
        )
    elif not 0.0 <= late < duration_s:
        fault = f"its dead time is {late:g} s; from 0 to less than the recording's {duration_s:g} s are needed"
    else:
        fault = _damping_fault(simulation) or _controller_fault(simulation.controller)
    if fault:
        raise DataError("model_invalid", f"the model cannot be simulated: {fault}")


def _damping_fault(simulation: LinearSimulation) -> str:
    """Why a model cannot be simulated with its damping; empty where it can, or has none."""
    damping, taus = simulation.damping, simulation.time_constants_s
    if damping is None:
        return ""
    if not LEAST_DAMPING <= damping <= _MOST_DAMPING:
        return f"its damping is {damping:g}; from {LEAST_DAMPING:g} to {_MOST_DAMPING:g} are needed"
    if simulation.integrating:
        return "it integrates, and has a damping; the lag before what integrates is a time constant"
    if not taus or taus[0] <= _NO_LAG:
        return "it has a damping; the time constant that belongs to it, one over the natural frequency, is needed first"
    return ""


def _controller_fault(controller: Controller | None) -> str:
    """Why a controller cannot be simulated; empty where it can, or there is none."""
    if controller is None:
        return ""
    integral, derivative = controller.integral_time_s, controller.derivative_time_s
    if not 1.0 / _STRONGEST <= abs(controller.gain) <= _STRONGEST:
        return f"the gain of its controller is {controller.gain:g}; a finite number other than 0 is needed"
    if integral is not None and not 1.0 / _STRONGEST <= integral <= LARGEST:
        return f"the integral time of its controller is {integral:g} s; more than 0 s is needed, null for none"
    if not 0.0 <= derivative <= _STRONGEST:
        return f"the derivative time of its controller is {derivative:g} s; 0 s or more is needed"
    return ""


def mended(comparison: Comparison) -> Comparison:
    """Checked, its wild samples left out. Raises as `check` does."""
    check(comparison)
    return _without_wild(comparison)


def _without_wild(comparison: Comparison) -> Comparison:
    """A few samples of PV far outside of all others, as a code for a bad value leaves them, are not compared; they are
    filled in from their neighbours.
    """
    wild = wild_samples(comparison.pv)
    if not wild.any():
        return comparison
    at = np.arange(len(wild))
    pv = np.where(wild, np.interp(at, at[~wild], comparison.pv[~wild]), comparison.pv)
    known = ~wild if comparison.known is None else comparison.known & ~wild
    first = comparison.pv[wild][0]
    stand = counted(int(wild.sum()), "sample of PV lies", "samples of PV lie")
    text = f"{stand} far outside all others (first {first:.6g}) and {'is' if wild.sum() == 1 else 'are'} left out"
    return replace(comparison, pv=pv, known=known, notes=(*comparison.notes, Reason("wild_samples", text)))


def wild_samples(pv: FloatArray) -> BoolArray:
    """(N,) True where one of a few samples of PV (N,) is many times farther from its median than all others."""
    away = np.abs(pv - np.median(pv))
    low, high = np.quantile(pv, (_WILD_SHARE, 1.0 - _WILD_SHARE))
    wild = away > _WILD * (high - low)
    if not 0.0 < np.mean(wild) <= _WILD_SHARE or high <= low:
        return np.zeros(len(pv), dtype=np.bool_)
    return wild & (away > _OUTSIDE * float(np.ptp(pv[~wild])))


def shortened(comparison: Comparison) -> Comparison:
    """The comparison at a longer interval where it has more samples than can be fitted in reasonable time; beside
    a given simulation a part of it where OP follows PV, because means of such a loop are of another one
    (`thinning.factor_for`).
    """
    samples = len(comparison.pv)
    part = _part_as_sampled(comparison, MOST_SAMPLES) if samples > MOST_SAMPLES else None
    return at_interval(comparison, -(-samples // MOST_SAMPLES)) if part is None else part


def _answers_a_simulation(comparison: Comparison) -> bool:
    """Whether a simulation was given of a loop whose OP follows PV: means would make it wrong."""
    given = comparison.trace is not None or comparison.simulation is not None
    return given and record_of(comparison).fed_back


def _is_at_work(comparison: Comparison) -> bool:
    """Whether OP, PV and a given trace move."""
    signals = (comparison.op, comparison.pv, *(() if comparison.trace is None else (comparison.trace,)))
    known = (signal[np.isfinite(signal)] for signal in signals)
    return all(len(signal) and np.ptp(signal) > 0.0 for signal in known)


def _part_as_sampled(comparison: Comparison, most: int) -> Comparison | None:
    """Of a longer comparison whose OP answers a given simulation's PV the `most` samples over which PV leaves that
    simulation by most, with a note: an effect that begins late is nowhere else. The first of them, where no others are
    clearly farther off; None where nothing of that kind is there, or no part is at work.
    """
    if not _answers_a_simulation(comparison):
        return None
    samples = len(comparison.pv)
    begins = [int(begin) for begin in np.linspace(0, samples - most, _STRETCHES_TRIED).round()]
    parts = {begin: comparison.part(slice(begin, begin + most)) for begin in begins}
    begins = [begin for begin in begins if _is_at_work(parts[begin])]
    if not begins:
        return None
    seen = np.ones(samples, dtype=np.bool_) if comparison.known is None else comparison.known
    left = _left_of_a_simulation(comparison, seen)
    apart = {begin: _spread_over(left, seen, slice(begin, begin + most)) for begin in begins}
    farthest, first = max(begins, key=apart.__getitem__), begins[0]
    chosen = farthest if apart[farthest] > _CLEARLY_FARTHER * apart[first] else first
    note = Reason("part_explained", part_in_words(comparison, chosen, most))
    return replace(parts[chosen], notes=(*comparison.notes, note))


def part_in_words(comparison: Comparison, begin: int, most: int) -> str:
    """Which part of a comparison is explained, and why no more."""
    ts = comparison.sampling_interval_s
    which = f"the first {most:,}" if begin == 0 else f"those from {begin * ts:g} to {(begin + most - 1) * ts:g} s"
    text = (
        f"of {len(comparison.pv):,} samples, {which} are explained: OP follows PV, and averages over more would not "
        "separate the controller's response from that of the process"
    )
    if begin == 0:
        return text
    return f"{text}; PV departs from the simulation more there than before, and seconds count from their start"


def _left_of_a_simulation(comparison: Comparison, seen: BoolArray) -> FloatArray:
    """What the given simulation leaves of PV (N,), its level, its gain and how late it is by least squares over the
    samples `seen` (N,).
    """
    trace = comparison.trace
    if trace is None:
        record, simulation = record_of(comparison), comparison.simulation
        assert simulation is not None  # noqa: S101 - asked where there is one or the other
        trace = run_process(record.op_deviation, given_of(simulation, record).plant, record.sampling_interval_s)
    basis = np.stack([np.ones(len(trace)), trace - np.mean(trace), np.gradient(trace)], axis=1)
    left = comparison.pv - float(np.mean(comparison.pv[seen]))
    return np.asarray(left - basis @ np.linalg.lstsq(basis[seen], left[seen], rcond=None)[0], dtype=np.float64)


def _spread_over(left: FloatArray, seen: BoolArray, which: slice) -> float:
    """Standard deviation over the samples of a stretch that are seen; 0 where they are less than half of it."""
    within = seen[which]
    return float(np.std(left[which][within])) if 2 * within.sum() >= len(within) else 0.0


def glimpse(comparison: Comparison) -> Comparison:
    """The comparison as short as a first answer needs it, and PV's own memory allows it; as it was sampled
    beside a given simulation where OP follows PV.
    """
    n = len(comparison.pv)
    if n > _MOST_QUICK_AS_SAMPLED:
        part = _part_as_sampled(comparison, _MOST_QUICK_AS_SAMPLED)
        if part is not None:
            return part
    elif n > _MOST_QUICK_SAMPLES and _answers_a_simulation(comparison) and _is_at_work(comparison):
        return comparison
    allowed = max(int(_memory_samples(comparison.pv) / _INTERVALS_A_MEMORY), 1)
    return at_interval(comparison, max(min(-(-n // _QUICK_SAMPLES), allowed), -(-n // _MOST_QUICK_SAMPLES)))


def _memory_samples(pv: FloatArray) -> int:
    """After how many samples the autocorrelation of PV (N,) has fallen to a half."""
    moves = pv - np.mean(pv)
    power = np.abs(np.fft.rfft(moves, 2 * len(moves))) ** 2
    below = np.fft.irfft(power)[: len(moves)] < 0.5 * float(moves @ moves)
    return int(np.argmax(below)) if below.any() else len(moves)


def at_interval(comparison: Comparison, factor: int) -> Comparison:
    """The comparison at `factor` times its interval."""
    if factor <= 1:
        return comparison
    return comparison.through(
        lambda signal: held_means(signal, factor),
        lambda pv: centred_means(pv, factor),
        lambda known: centred_all(known, factor),
        times=factor,
    )


def given_of(simulation: LinearSimulation, record: Experiment) -> Given:
    """The given model, checked, as a plant."""
    gain, late = simulation.gain, simulation.dead_time_s
    if simulation.damping is not None and simulation.damping < 1.0:
        tau, behind = (*simulation.time_constants_s, 0.0)[:2]
        tau3 = behind if behind > _NO_LAG else 0.0
        return Given(Plant(gain, tau, late, tau3=tau3, damping=simulation.damping), second_order=True)
    taus = _lags_of(simulation)
    if simulation.integrating:
        tau2, tau3 = (*taus, 0.0, 0.0)[:2]
        return Given(Plant(gain, 1.0, late, tau2=tau2, leak=0.0, tau3=tau3), integrating=True, second_order=bool(taus))
    tau, tau2, tau3 = (*(taus or [_LEAST_TIME_CONSTANT * record.sampling_interval_s]), 0.0, 0.0)[:3]
    return Given(Plant(gain, tau, late, tau2=tau2, tau3=tau3), second_order=len(taus) > 1)


def _lags_of(simulation: LinearSimulation) -> list[float]:
    """Time constants (s) of the real lags of a model that does not swing, the longest first."""
    taus, damping = list(simulation.time_constants_s), simulation.damping
    if damping is not None:
        longer = damping + np.sqrt(damping**2 - 1.0)
        taus[:1] = [taus[0] * longer, taus[0] / longer]
    return sorted((float(t) for t in taus if t > _NO_LAG), reverse=True)
