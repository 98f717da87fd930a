"""A quick look at a block over its grid: how much of the whitened residual it takes, the linear model free to move
along.
"""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.mismatch.fit.fitting import Fit, orthonormal, prior_rows, residual_rows, slopes
from app.engine.mismatch.fit.noise import NoiseModel, compared_count, scaled_innovations, whiten
from app.engine.mismatch.fit.task import Task, make_task
from app.engine.mismatch.loop.block import Block, Context, Parameter, Part
from app.engine.mismatch.loop.chain import Recent, simulate
from app.engine.mismatch.loop.plant import Plant
from app.engine.recording import FloatArray


@dataclass(frozen=True, eq=False)
class Ground:
    """The fit so far, ready for scans: its whitened residual and the directions in which its own parameters can move.

    rows: the innovations of all samples, zero where PV is not compared, then the priors' rows. count: how many of them
    are compared, n of a log-likelihood.
    """

    fit: Fit
    rows: FloatArray
    basis: FloatArray
    innovations: FloatArray
    prior: FloatArray
    sensor_parts: bool
    whitened: FloatArray
    energy: float
    count: int


@dataclass(frozen=True, eq=False)
class Start:
    """A point of a block's grid: its values with linear ones solved, and its gain in log-likelihood (nat), noise
    colour held. plant: where the linear model begins; None: as it was found.
    """

    values: FloatArray
    gain: float
    plant: Plant | None = None


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
    count = compared_count(fit.record.usable)
    return Ground(fit, rows, basis, innovations, prior_rows(task, fit.x), sensor, at.rows, float(rows @ rows), count)


@dataclass(frozen=True, eq=False)
class Moved:
    """What the simulations of one point of a grid move the whitened residual by, the linear model following, as inner
    products with each other (L, L) and with that residual (L,).
    """

    gram: FloatArray
    slope: FloatArray


def scan(block: Block, grounds: tuple[Ground, ...]) -> tuple[tuple[Start, ...], ...]:
    """The grid of a block's `starts` under each ground (of one fit, under several noise models), the best first."""
    fit = grounds[0].fit
    context = Context(fit.record, fit.plant)
    parameters = block.parameters(context)
    linear = [k for k, p in enumerate(parameters) if p.linear]
    grids = [{values.tobytes(): values for values in block.starts(context, ground_.innovations)} for ground_ in grounds]
    known: list[dict[bytes, Moved]] = [{} for _ in grounds]
    rows, recent = np.zeros((max(len(linear), 1), len(grounds[0].rows))), Recent()
    for key, values in {key: values for points in grids for key, values in points.items()}.items():
        simulated = simulations(block, values, linear, parameters, grounds[0], recent)
        for ground_, points, moved in zip(grounds, grids, known, strict=True):
            if key in points:
                move(ground_, simulated, rows)
                moved[key] = inner_products(ground_, rows)
    found = []
    for ground_, points, moved in zip(grounds, grids, known, strict=True):
        starts = solved(np.array(list(points.values())), linear, parameters, ground_, [moved[key] for key in points])
        found.append(tuple(sorted(starts, key=lambda start: -start.gain)))
    return tuple(found)


def inner_products(ground_: Ground, rows: FloatArray) -> Moved:
    """Of what moves the whitened residual by some rows (L, rows)."""
    along = rows @ ground_.basis
    return Moved(rows @ rows.T - along @ along.T, rows @ ground_.rows)


def at_given(block: Block, fit: Fit) -> tuple[Start, ...]:
    """The grid of a block at the given simulation's own parameters, the nearest free run first (gain: its deviation
    from PV, negative).

    Beside what makes a loop far from linear the linear refit has gone astray, and so have scans along its slopes.
    """
    given = fit.given.plant
    plant = fit.plant.changed(K=given.K, tau=given.tau, tau2=given.tau2, tau3=given.tau3, theta=given.theta)
    found = []
    for values in block.starts(Context(fit.record, plant), fit.residual):
        error = fit.record.pv_deviation - simulate(fit.record, plant, (*fit.parts, Part(block, values)))
        found.append(Start(values, -float(np.std(error[fit.record.usable])), plant))
    return tuple(sorted(found, key=lambda start: -start.gain))


def simulations(
    block: Block,
    values: FloatArray,
    linear: list[int],
    parameters: tuple[Parameter, ...],
    ground_: Ground,
    recent: Recent,
) -> FloatArray:
    """The simulations (L, N) with the block at one point of the grid: one for each linear parameter moved by its scale,
    one in all where none is linear.
    """
    if not linear:
        return with_block(ground_, block, values, recent)[None, :]
    moved = np.repeat(values[None, :], len(linear), axis=0)
    for row, k in zip(moved, linear, strict=True):
        row[k] += parameters[k].scale
    return np.stack([with_block(ground_, block, row, recent) for row in moved])


def solved(
    points: FloatArray,
    linear: list[int],
    parameters: tuple[Parameter, ...],
    ground_: Ground,
    moved: list[Moved],
) -> list[Start]:
    """The points (M, P) of a grid, their linear parameters by least squares; the linear model follows by inner products
    with its directions alone. moved: by what the simulations of each point move the residual.
    """
    if len(points) == 0:
        return []
    # Where all linear parameters are zero the block does nothing: what it moves is the difference.
    gram, slope = np.stack([one.gram for one in moved]), np.stack([one.slope for one in moved])
    if not linear:
        energies = ground_.energy + 2.0 * slope[:, 0] + gram[:, 0, 0]
        return [Start(values, gained(ground_, float(e))) for values, e in zip(points, energies, strict=True)]
    ridge = (1e-10 * np.trace(gram, axis1=1, axis2=2)[:, None, None] + 1e-300) * np.eye(len(linear))
    change = -np.linalg.solve(gram + ridge, slope[:, :, None])[:, :, 0]
    curve = np.einsum("mi,mij,mj->m", change, gram, change)
    energies = ground_.energy + 2.0 * np.sum(change * slope, axis=1) + curve
    scales = np.array([parameters[k].scale for k in linear])
    low, high = (np.array([getattr(parameters[k], side) for k in linear]) for side in ("low", "high"))
    best = points.copy()
    best[:, linear] = np.clip(points[:, linear] + change * scales, low, high)
    return [Start(values, gained(ground_, float(e))) for values, e in zip(best, energies, strict=True)]


def with_block(ground_: Ground, block: Block, values: FloatArray, recent: Recent) -> FloatArray:
    """The simulation with one block more; what is added to PV needs no new run of the process. recent: of simulations
    with the same block.
    """
    fit = ground_.fit
    if block.stage in ("output", "sensor") and block.apply is not None and not ground_.sensor_parts:
        return block.apply(fit.simulated, values, Context(fit.record, fit.plant))
    return simulate(fit.record, fit.plant, (*fit.parts, Part(block, values)), recent)


def gained(ground_: Ground, energy: float) -> float:
    """The gain in log-likelihood (nat) where this energy is left of the whitened residual."""
    return 0.5 * ground_.count * float(np.log(max(ground_.energy, 1e-300) / max(energy, 1e-300)))


def moves(ground_: Ground, simulated: FloatArray) -> FloatArray:
    """By how much the simulations (L, N) move the whitened residual (L, rows)."""
    rows = np.zeros((len(simulated), len(ground_.rows)))
    move(ground_, simulated, rows)
    return rows


def move(ground_: Ground, simulated: FloatArray, rows: FloatArray) -> None:
    """Writes by how much the simulations (L, N) move the whitened residual into rows (L, rows) of zeros."""
    record, noise = ground_.fit.record, ground_.fit.noise
    scaled_innovations(record.pv_deviation, simulated, record.usable, noise, ground_.whitened, rows)


def task_with(fit: Fit, block: Block) -> Task:
    """The task of fitting all parts of a fit together with one more block."""
    return make_task(fit.record, fit.given, (*(part.block for part in fit.parts), block))
