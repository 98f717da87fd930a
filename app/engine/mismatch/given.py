"""The simulation that was given: the linear model behind a trace, found without noise; or our own, where none was
given.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from app.engine.mismatch.experiment import Experiment
from app.engine.mismatch.fitting import OWN_DEVIATION, Fit, Given, best_of_noise, make_task, start_at
from app.engine.mismatch.plant import Plant, run_process
from app.engine.recording import FloatArray

ALIKE = 3e-3


@dataclass(frozen=True, eq=False)
class TraceModel:
    """The linear model behind a simulated trace, and how much of the trace it leaves (share of its deviation)."""

    given: Given
    left: float
    rest: FloatArray


@dataclass(frozen=True)
class Structure:
    """A linear structure to try."""

    second_order: bool
    integrating: bool


STRUCTURES = (
    Structure(False, False),
    Structure(False, True),
    Structure(True, True),
    Structure(True, False),
)


def behind_trace(record: Experiment, trace: FloatArray) -> TraceModel:
    """The simplest linear model that makes the simulated trace (N,) from OP; the rest of the trace is kept beside
    it.
    """
    best = None
    for structure in STRUCTURES:
        found = fit_structure(record, trace, structure)
        if best is None or found.left < 0.5 * best.left:
            best = found
        if best.left < ALIKE:
            break
    assert best is not None  # noqa: S101 - STRUCTURES is not empty
    return best


def fit_structure(record: Experiment, trace: FloatArray, structure: Structure) -> TraceModel:
    y = trace - np.mean(trace)
    ts = record.sampling_interval_s
    starts = [(tau, theta) for tau in (3.0, 12.0, 50.0) for theta in (1.0, 4.0, 12.0)]
    best: Plant | None = None
    least = np.inf
    for tau, theta in starts:
        plant = descend_trace(record, y, structure, tau * ts, theta * ts)
        error = float(np.sqrt(np.mean((run_process(record.op_deviation, plant, ts) - y) ** 2)))
        if error < 0.98 * least:
            best, least = plant, error
        if least < 3e-4 * np.std(y):
            break
    assert best is not None  # noqa: S101 - starts is not empty
    rest = y - run_process(record.op_deviation, best, ts)
    left = float(np.std(rest) / max(np.std(y), 1e-300))
    given = Given(best.changed(b=0.0, x0=0.0), second_order=structure.second_order, integrating=structure.integrating)
    return TraceModel(given, left, rest if left > ALIKE else np.zeros(record.samples))


def descend_trace(record: Experiment, y: FloatArray, structure: Structure, tau: float, theta: float) -> Plant:
    """Variable projection: gain, offset and start are linear; time constants and dead time are searched."""
    ts, u = record.sampling_interval_s, record.op_deviation

    def plant_of(z: FloatArray, K: float = 1.0, b: float = 0.0, x0: float = 0.0) -> Plant:
        first = 1.0 if structure.integrating else float(np.exp(z[1]))
        second = float(np.exp(z[2])) if structure.second_order else 0.0
        leak = 0.0 if structure.integrating else 1.0
        return Plant(K, first, float(abs(z[0])) * ts, b, x0, second, leak)

    def columns(z: FloatArray) -> FloatArray:
        zero = np.zeros_like(u)
        parts = (plant_of(z), plant_of(z, 0.0, 1.0), plant_of(z, 0.0, 0.0, 1.0))
        return np.stack([run_process(u if k == 0 else zero, plant, ts) for k, plant in enumerate(parts)], axis=1)

    def error(z: FloatArray) -> FloatArray:
        basis = columns(z)
        return y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0]

    start = np.array([theta / ts, np.log(tau), np.log(0.3 * tau)])
    low = [0.0, np.log(0.05 * ts), np.log(0.05 * ts)]
    high = [0.2 * record.samples, np.log(record.duration_s), np.log(record.duration_s)]
    z = least_squares(error, start, bounds=(low, high), max_nfev=40, diff_step=1e-4, x_scale=[1.0, 0.3, 0.3]).x
    K, b, x0 = np.linalg.lstsq(columns(z), y, rcond=None)[0].tolist()
    return plant_of(z, K, b, x0)


def identify(record: Experiment, integrating: bool | None = None) -> Fit:
    """Our own linear loop where no simulation was given: the structure that explains PV best under coloured noise."""
    best, best_score = None, -np.inf
    for structure in STRUCTURES:
        if integrating is not None and structure.integrating != integrating:
            continue
        found = identify_structure(record, structure)
        score = found.likelihood - 4.0 * structure.second_order - 4.0 * structure.integrating
        if score > best_score:
            best, best_score = found, score
    assert best is not None  # noqa: S101 - one structure at least was tried
    return best


def identify_structure(record: Experiment, structure: Structure) -> Fit:
    """From the least-squares model of PV itself, then under coloured noise."""
    plant = fit_structure(record, record.pv, structure).given.plant
    given = Given(plant, OWN_DEVIATION, structure.second_order, structure.integrating)
    task = make_task(record, given, ())
    return best_of_noise(task, start_at(task, plant, np.zeros(0)))
