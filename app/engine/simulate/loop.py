"""One control loop, described and simulated: plant, controller, valve, disturbances, instrument, sampling."""

import math
from dataclasses import dataclass, field

import numpy as np

from app.engine.recording import FloatArray, Recording, UniformRecord, known_span
from app.engine.simulate import actuator, controller, kernel, plant
from app.engine.simulate.actuator import LinearValve, Valve
from app.engine.simulate.controller import Controller, Manual
from app.engine.simulate.digits import in_eleven_digits
from app.engine.simulate.plant import Plant
from app.engine.simulate.signals import Signal
from app.errors import DataError

UNLIMITED = (-math.inf, math.inf)


@dataclass(frozen=True)
class LoopSpec:
    """A loop around an operating point, at rest there before the simulation begins.

    A sticky loop at rest stays at rest until something moves it: load=Signal(value=...) pushes it at the start, and
    settle_s lets the limit cycle grow before the record.

    plant: from valve position to PV, in deviations from (op_start, pv_start). controller, valve: see their modules.
    pv_start, op_start: where the loop rests, in the units of PV and OP.
    sp: set point as deviation from pv_start, unit of PV. load: acts where the valve does, unit of OP, and goes through
    the dead time. upset: adds to PV, unit of PV, and is seen by the controller. noise: of the measurement, unit of PV.
    op_limits, pv_limits: (low, high); OP saturates, the transmitter too. op_resolution, pv_resolution: quantisation of
    OP and of the transmitter; 0 for none.
    step_s: the scan: controller, valve and plant move every step_s; None: every sample. A dead time need not be a
    multiple of it.
    settle_s: time simulated before the record, so that it begins on the limit cycle. Times of signals count from the
    record's first sample.
    transmitter_frozen_from_s: time from which PV holds its last value (a dead transmitter), or None.
    """

    plant: Plant
    controller: Controller
    valve: Valve = field(default_factory=LinearValve)
    sp: Signal = field(default_factory=Signal)
    load: Signal = field(default_factory=Signal)
    upset: Signal = field(default_factory=Signal)
    noise: Signal = field(default_factory=Signal)
    pv_start: float = 0.0
    op_start: float = 0.0
    pv_limits: tuple[float, float] = UNLIMITED
    op_limits: tuple[float, float] = UNLIMITED
    pv_resolution: float = 0.0
    op_resolution: float = 0.0
    step_s: float | None = None
    settle_s: float = 0.0
    transmitter_frozen_from_s: float | None = None


@dataclass(frozen=True, eq=False)
class SimulatedLoop:
    """What a simulated loop did: what would be recorded, and the truth beside it.

    time_s: (N,) s from zero. sp, pv: (N,) unit of PV, as recorded. op: (N,) unit of OP. v: (N,) valve position, unit of
    OP. true_pv: (N,) PV without noise, quantisation and transmitter. spec, seed: what it was made from.
    """

    time_s: FloatArray
    sp: FloatArray
    pv: FloatArray
    op: FloatArray
    v: FloatArray
    true_pv: FloatArray
    sampling_interval_s: float
    spec: LoopSpec
    seed: int

    def recording(self, name: str) -> Recording:
        """The loop as a recording of that name; of OP and PV that are not limited on both sides no span is known."""
        return Recording(
            name=name,
            time_s=self.time_s,
            pv=self.pv,
            op=self.op,
            sp=self.sp,
            automatic=np.full(len(self.time_s), not isinstance(self.spec.controller, Manual)),
            op_range=known_span(self.spec.op_limits),
            pv_range=known_span(self.spec.pv_limits),
            integrating=self.spec.plant.integrating,
        )

    def uniform(self) -> UniformRecord:
        """The loop as a record for identification: no gaps, nothing filled."""
        filled = np.zeros(len(self.pv), dtype=np.bool_)
        return UniformRecord(self.sampling_interval_s, self.pv, self.op, self.sp, filled)


def simulate_loop(spec: LoopSpec, duration_s: float, sampling_interval_s: float, seed: int = 0) -> SimulatedLoop:
    """The record of `duration_s` (s) that a loop gives at `sampling_interval_s` (s): N = duration / interval samples.

    seed: of the noises; the same spec, times and seed give the same record.
    Plant and dead time are exact for a valve position held over each step (zero-order hold); a physical valve moves
    within the step and is held at where it ends.
    Raises DataError("simulation_step") where the sampling interval is not a multiple of the step,
    DataError("simulation_too_short") below two samples, DataError("simulation_unstable") where the loop runs away, and
    what plant, controller and valve raise.
    """
    step_s = spec.step_s or sampling_interval_s
    every = _multiple(sampling_interval_s, step_s)
    samples = round(duration_s / sampling_interval_s)
    if samples < 2:
        raise DataError("simulation_too_short", f"{duration_s} s at {sampling_interval_s} s gives {samples} samples")
    first = math.ceil(spec.settle_s / sampling_interval_s) * every
    step_times = (np.arange(first + (samples - 1) * every + 1, dtype=np.float64) - first) * step_s
    driven = _driven(spec, step_times, np.random.default_rng(seed))
    rows = _run(spec, driven, step_s, every, first)
    if not np.all(np.isfinite(rows)):
        raise DataError("simulation_unstable", "PV or OP grew beyond all bounds; limit OP or tune the controller down")
    return SimulatedLoop(
        time_s=np.arange(samples, dtype=np.float64) * sampling_interval_s,
        sp=driven[0, first::every].copy(),
        pv=rows[0],
        op=rows[1],
        v=rows[2],
        true_pv=rows[3],
        sampling_interval_s=sampling_interval_s,
        spec=spec,
        seed=seed,
    )


def _multiple(sampling_interval_s: float, step_s: float) -> int:
    every = round(sampling_interval_s / step_s)
    if every < 1 or abs(every * step_s - sampling_interval_s) > 1e-9 * sampling_interval_s:
        text = f"the sampling interval {sampling_interval_s} s must be a multiple of the step {step_s} s"
        raise DataError("simulation_step", text)
    return every


def _driven(spec: LoopSpec, time_s: FloatArray, rng: np.random.Generator) -> FloatArray:
    # A stream for each signal: the noise of one stays what it is when another one's, or the length, is changed.
    signals = (spec.sp, spec.load, spec.upset, spec.noise)
    rows = [signal.sample(time_s, stream) for signal, stream in zip(signals, rng.spawn(4), strict=True)]
    rows[0] += spec.pv_start
    return np.array(rows)


def _instrument(limits: tuple[float, float], resolution: float, rest: float) -> kernel.Instrument:
    return kernel.Instrument(float(limits[0]), float(limits[1]), float(resolution), float(rest))


def _run(spec: LoopSpec, driven: FloatArray, step_s: float, every: int, first: int) -> FloatArray:
    frozen_s = spec.transmitter_frozen_from_s
    return kernel.run(
        driven,
        every,
        first,
        in_eleven_digits(plant.discretise(spec.plant, step_s)),
        in_eleven_digits(controller.discretise(spec.controller, step_s)),
        actuator.compiled(spec.valve, spec.op_start, step_s),
        _instrument(spec.pv_limits, spec.pv_resolution, spec.pv_start),
        _instrument(spec.op_limits, spec.op_resolution, spec.op_start),
        driven.shape[1] if frozen_s is None else first + math.ceil(frozen_s / step_s - 1e-9),
    )
