"""A quick look at a block over its grid: how much of the whitened residual it takes, the linear model free to move
along.
"""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.mismatch.block import Block, Context, Part
from app.engine.mismatch.chain import simulate
from app.engine.mismatch.fitting import Fit, Task, make_task, orthonormal, prior_rows, residual_rows, slopes
from app.engine.mismatch.noise import NoiseModel, settling_samples, whiten
from app.engine.recording import FloatArray


@dataclass(frozen=True, eq=False)
class Ground:
    """The fit so far, ready for scans: its whitened residual and the directions in which its own parameters can
    move.
    """

    fit: Fit
    rows: FloatArray
    basis: FloatArray
    innovations: FloatArray
    prior: FloatArray
    sensor_parts: bool


@dataclass(frozen=True, eq=False)
class Start:
    """A point of a block's grid: its values with linear ones solved, and its gain in log-likelihood (nat), noise
    colour held.
    """

    values: FloatArray
    gain: float


def ground(fit: Fit, noise: NoiseModel) -> Ground:
    """Prepares a fit for scans of further blocks under a noise model, its own or another."""
    fit = replace(fit, noise=noise)
    blocks = tuple(part.block for part in fit.parts)
    task = make_task(fit.record, fit.given, blocks)
    at = residual_rows(task, fit.x, fit.noise)
    basis = orthonormal(slopes(task, fit.x, fit.noise, at))
    rows = at.rows - basis @ (basis.T @ at.rows)
    sensor = any(part.block.stage == "sensor" for part in fit.parts)
    innovations = whiten(fit.residual, fit.record.usable, fit.noise)
    return Ground(fit, rows, basis, innovations, prior_rows(task, fit.x), sensor)


def scan(block: Block, ground_: Ground) -> tuple[Start, ...]:
    """The grid of a block's `starts`, the best first."""
    context = Context(ground_.fit.record, ground_.fit.plant)
    linear = [k for k, p in enumerate(block.parameters(context)) if p.linear]
    rows = block.starts(context, ground_.innovations)
    found = [solved(block, values, linear, ground_, context) for values in rows]
    return tuple(sorted(found, key=lambda start: -start.gain))


def solved(block: Block, values: FloatArray, linear: list[int], ground_: Ground, context: Context) -> Start:
    """One point of the grid, its linear parameters by least squares."""
    if not linear:
        return Start(values, gained(ground_, whitened(ground_, with_block(ground_, block, values, context))))
    parameters = block.parameters(context)
    # Where all linear parameters are zero the block does nothing.
    at = ground_.rows
    columns = []
    for k in linear:
        moved = values.copy()
        moved[k] += parameters[k].scale
        columns.append(whitened(ground_, with_block(ground_, block, moved, context)) - at)
    basis = np.stack(columns, axis=1)
    gram = basis.T @ basis
    change = -np.linalg.solve(gram + 1e-10 * np.trace(gram) * np.eye(len(gram)) + 1e-300, basis.T @ at)
    best = values.copy()
    for k, step in zip(linear, change, strict=True):
        best[k] = np.clip(values[k] + step * parameters[k].scale, parameters[k].low, parameters[k].high)
    return Start(best, gained(ground_, at + basis @ change))


def with_block(ground_: Ground, block: Block, values: FloatArray, context: Context) -> FloatArray:
    """The simulation with one block more; what is added to PV needs no new run of the process."""
    fit = ground_.fit
    if block.stage in ("output", "sensor") and block.apply is not None and not ground_.sensor_parts:
        return block.apply(fit.simulated, values, context)
    return simulate(fit.record, fit.plant, (*fit.parts, Part(block, values)))


def gained(ground_: Ground, rows: FloatArray) -> float:
    return 0.5 * len(rows) * float(np.log((ground_.rows @ ground_.rows) / max(rows @ rows, 1e-300)))


def whitened(ground_: Ground, simulated: FloatArray) -> FloatArray:
    """Whitened residual of a simulation, what the linear model can follow taken out."""
    fit = ground_.fit
    e = whiten(fit.record.pv_deviation - simulated, fit.record.usable, fit.noise)[
        settling_samples(fit.record.samples) :
    ]
    rows = np.concatenate((e / fit.noise.deviation, ground_.prior))
    return rows - ground_.basis @ (ground_.basis.T @ rows)


def task_with(fit: Fit, block: Block) -> Task:
    """The task of fitting all parts of a fit together with one more block."""
    return make_task(fit.record, fit.given, (*(part.block for part in fit.parts), block))
