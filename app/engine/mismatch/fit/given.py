"""The simulation that was given: the linear model behind a trace, found without noise; or our own, where none was
given.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from app.engine.mismatch.fit.fitting import Fit, best_of_noise
from app.engine.mismatch.fit.levels import rounded_off
from app.engine.mismatch.fit.task import OWN_DEVIATION, Given, make_task, start_at
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.recording import BoolArray, FloatArray

_ALIKE = 1e-3
_TIMES, _DEAD_TIMES = (1.0, 3.0, 7.0, 15.0, 35.0, 80.0, 200.0), (0.2, 1.0, 3.0, 6.0, 12.0, 25.0, 50.0)
_PERIODS = (1.0, 1.7, 3.0, 5.0, 8.0, 13.0, 20.0, 35.0, 60.0, 100.0, 200.0)
LEAST_DAMPING, _FIRST_DAMPING = 0.02, 0.35
_DESCENTS, _APART = 2, 0.9
_LEAST_LAG = 0.5  # of the interval: a shorter one is how two simulations step within it


@dataclass(frozen=True, eq=False)
class TraceModel:
    """The linear model behind a simulated trace, and how much of the trace it leaves (left): as a share of its
    deviation or of PV's, whichever is less, for the open trace of an integrator may wander far beyond PV; share: of the
    trace's own. rest: (N,) what it leaves, unit of PV; zero where the trace is linear. plant: as it runs along the
    trace, from its mean `level`.
    """

    given: Given
    left: float
    share: float
    rest: FloatArray
    plant: Plant
    level: float


@dataclass(frozen=True)
class Structure:
    """A linear structure to try."""

    second_order: bool
    integrating: bool
    swinging: bool = False

    @property
    def has_two_lags(self) -> bool:
        return self.second_order and not self.swinging


_STRUCTURES = (
    Structure(False, False),
    Structure(False, True),
    Structure(True, True),
    Structure(True, False),
)
_OF_TRACES = (*_STRUCTURES, Structure(True, False, swinging=True))


@dataclass(frozen=True, eq=False)
class Target:
    """A signal (N,) that a linear model is to make from OP, and the samples `seen` (N,) at which it is known."""

    signal: FloatArray
    seen: BoolArray

    @cached_property
    def level(self) -> float:
        return float(np.mean(self.signal[self.seen]))

    @cached_property
    def moves(self) -> FloatArray:
        """(M,) from the level, where it is known."""
        return self.signal[self.seen] - self.level


def behind_trace(record: Experiment, trace: FloatArray) -> TraceModel:
    """The simplest linear model that makes the simulated trace (N,) from OP, complex poles where two real lags leave
    twice as much; the rest of the trace is kept beside it.
    """
    best, target = None, Target(trace, np.ones(record.samples, dtype=np.bool_))
    for structure in _OF_TRACES:
        found = fit_structure(record, target, structure)
        told = not structure.has_two_lags or found.given.plant.tau2 > _LEAST_LAG * record.sampling_interval_s
        if best is None or (told and found.left < 0.5 * best.left):
            best = found
        if best.left < _ALIKE:
            break
    assert best is not None  # noqa: S101 - _STRUCTURES is not empty
    return best


def fit_structure(record: Experiment, target: Target, structure: Structure) -> TraceModel:
    trace, y = target.signal, target.moves
    ts = record.sampling_interval_s
    best: Plant | None = None
    least = np.inf
    for start in _starts(record, target, structure):
        plant = _descend_trace(record, target, structure, start)
        error = float(np.sqrt(np.mean((run_process(record.op_deviation, plant, ts)[target.seen] - y) ** 2)))
        if error < 0.98 * least:
            best, least = plant, error
        if least < 3e-4 * np.std(y):
            break
    assert best is not None  # noqa: S101 - there are starts
    rest = trace - target.level - run_process(record.op_deviation, best, ts)
    beside = float(np.std(rest[target.seen]))
    left = float(beside / max(min(float(np.std(y)), float(np.std(record.pv))), 1e-300))
    given = Given(
        best.changed(b=0.0, x0=0.0, speed0=0.0), second_order=structure.second_order, integrating=structure.integrating
    )
    linear = left <= _ALIKE or rounded_off(trace, rest)
    return TraceModel(
        given,
        left,
        beside / max(float(np.std(y)), 1e-300),
        np.zeros(record.samples) if linear else rest,
        best,
        target.level,
    )


def _starts(record: Experiment, target: Target, structure: Structure) -> list[FloatArray]:
    """The best points of a grid of time constants and dead times, none beside another: dead time in intervals, logs of
    the time constants, or of time and damping.
    """
    ts = record.sampling_interval_s
    points = [
        np.array([theta, np.log(tau * ts), np.log(_FIRST_DAMPING if structure.swinging else 0.3 * tau * ts)])
        for tau in _times_of(structure)
        for theta in _DEAD_TIMES
    ]
    errors = [float(np.sum(_project(record, target, structure, z)[0] ** 2)) for z in points]
    kept: list[FloatArray] = []
    for k in np.argsort(errors, kind="stable"):
        z = points[int(k)]
        if all(abs(z[1] - o[1]) > _APART or abs(z[0] - o[0]) > _APART * (1.0 + o[0]) for o in kept):
            kept.append(z)
        if len(kept) == _DESCENTS:
            break
    return kept


def _times_of(structure: Structure) -> tuple[float, ...]:
    """The time constants to begin with, intervals; those of what swings lie closer, for it must swing as often."""
    if structure.swinging:
        return _PERIODS
    return _TIMES if not structure.integrating or structure.second_order else _TIMES[:1]


def _plant_of(
    record: Experiment, structure: Structure, z: FloatArray, K: float, b: float, x0: float, speed0: float = 0.0
) -> Plant:
    theta_s = float(abs(z[0])) * record.sampling_interval_s
    first = 1.0 if structure.integrating else float(np.exp(z[1]))
    if structure.swinging:
        return Plant(K, first, theta_s, b, x0, damping=float(np.exp(z[2])), speed0=speed0)
    second = float(np.exp(z[2])) if structure.second_order else 0.0
    leak = 0.0 if structure.integrating else 1.0
    return Plant(K, first, theta_s, b, x0, second, leak)


def _project(record: Experiment, target: Target, structure: Structure, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Residual (M,) and the linear numbers (gain, offset, start, its speed where it swings) of the best plant with dead
    time and lags, or time and damping, z.
    """
    ts, u = record.sampling_interval_s, record.op_deviation
    zero = np.zeros_like(u)
    units = np.eye(4 if structure.swinging else 3).tolist()
    plants = [_plant_of(record, structure, z, *unit) for unit in units]
    columns = [run_process(u if k == 0 else zero, plant, ts) for k, plant in enumerate(plants)]
    basis = np.stack(columns, axis=1)[target.seen]
    numbers: FloatArray = np.linalg.lstsq(basis, target.moves, rcond=None)[0].astype(np.float64, copy=False)
    return target.moves - basis @ numbers, numbers


def _descend_trace(record: Experiment, target: Target, structure: Structure, start: FloatArray) -> Plant:
    """Variable projection: gain, offset and start are linear; time constants and dead time are searched.

    What is left counts in the size of the moves: the least gradient that ends a search has no unit.
    """
    ts, size = record.sampling_interval_s, max(float(np.std(target.moves)), 1e-300)
    low = [0.0, np.log(0.05 * ts), np.log(0.05 * ts)]
    high = [0.2 * record.samples, np.log(record.duration_s), np.log(record.duration_s)]
    if structure.swinging:
        low[2], high[2] = np.log(LEAST_DAMPING), 0.0
    z = scipy.optimize.least_squares(
        lambda z: _project(record, target, structure, z)[0] / size,
        np.clip(start, low, high),
        bounds=(low, high),
        max_nfev=40,
        diff_step=1e-4,
        x_scale=[1.0, 0.3, 0.3],
    ).x
    return _plant_of(record, structure, z, *_project(record, target, structure, z)[1].tolist())


def identify(record: Experiment, integrating: bool | None = None) -> Fit:
    """Our own linear loop where no simulation was given: the structure that explains PV best under coloured noise."""
    best, best_score = None, -np.inf
    for structure in _STRUCTURES:
        if integrating is not None and structure.integrating != integrating:
            continue
        found = _identify_structure(record, structure)
        score = found.likelihood - 4.0 * structure.second_order - 4.0 * structure.integrating
        if score > best_score:
            best, best_score = found, score
    assert best is not None  # noqa: S101 - one structure at least was tried
    return best


def _identify_structure(record: Experiment, structure: Structure) -> Fit:
    """From the least-squares model of PV itself, where that is compared, then under coloured noise."""
    plant = fit_structure(record, Target(record.pv, record.usable), structure).given.plant
    given = Given(plant, OWN_DEVIATION, structure.second_order, structure.integrating)
    task = make_task(record, given, ())
    return best_of_noise(task, start_at(task, plant, np.zeros(0)))


def own_again(record: Experiment, given: Given) -> Given:
    """Our own linear loop, made anew from the samples of a record (N,) that are compared: other samples had their share
    in it. A given one as it is, and so one behind a stem: it is found with the stem, which all samples show.

    Its structure, its dead time and which way PV goes stay: they say in which valley it lies, which no fit leaves, for
    lags stand for a dead time in another.
    """
    if not given.own or given.behind_stem:
        return given
    structure, was = Structure(given.second_order, given.integrating), given.plant
    further = was.tau2 if was.tau2 > 0.0 else was.tau
    start = np.array([was.theta / record.sampling_interval_s, np.log(was.tau), np.log(further)])
    plant = _descend_trace(record, Target(record.pv, record.usable), structure, start)
    return replace(given, plant=plant.changed(b=0.0, x0=0.0, theta=was.theta)) if plant.K * was.K > 0.0 else given
