"""A quick look at a block over its grid: how much of the whitened residual it takes, the linear model free to move
along.
"""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.mismatch.fit.fitting import Fit, orthonormal, prior_rows, residual_rows, slopes
from app.engine.mismatch.fit.noise import NoiseModel, compared_count, scaled_innovations, whiten
from app.engine.mismatch.fit.task import Task, make_task
from app.engine.mismatch.loop.block import Block, Context, Parameter, Part, Sum
from app.engine.mismatch.loop.chain import BEHIND, ForwardPath, passes_sums, simulate
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
    innovations = whiten(fit.residual, fit.record.usable, fit.noise)
    count = compared_count(fit.record.usable)
    return Ground(fit, rows, basis, innovations, prior_rows(task, fit.x), at.rows, float(rows @ rows), count)


class Beside:
    """A block more beside what was fitted; what is added to PV needs no new run of the process."""

    def __init__(self, block: Block, fit: Fit) -> None:
        self.block, self.fit, self.context = block, fit, Context(fit.record, fit.plant)
        self.row, self.known = fit.plant.row(), [part.values for part in fit.parts]
        self.path = ForwardPath(fit.record, [*(part.block for part in fit.parts), block], fit.plant)
        sensors = any(part.block.stage == "sensor" for part in fit.parts)
        self.last = block.stage in BEHIND and not sensors

    def simulated(self, values: FloatArray) -> FloatArray:
        """PV (N,) with the block at these values."""
        if self.last and self.block.apply is not None:
            return self.block.apply(self.fit.simulated, values, self.context)
        return self.path.run(self.row, [*self.known, values])


@dataclass(frozen=True, eq=False)
class _Moved:
    """What the simulations of each point of a grid (M) move the whitened residual by, the linear model following, as
    inner products with each other (M, L, L) and with that residual (M, L).
    """

    under: Ground
    gram: FloatArray
    slope: FloatArray


def scan(block: Block, grounds: tuple[Ground, ...]) -> tuple[tuple[Start, ...], ...]:
    """The grid of a block's `starts` under each ground (of one fit, under several noise models), the best first."""
    fit = grounds[0].fit
    context = Context(fit.record, fit.plant)
    parameters = block.parameters(context)
    linear = [k for k, p in enumerate(parameters) if p.linear]
    grids = [{values.tobytes(): values for values in block.starts(context, under.innovations)} for under in grounds]
    points = [np.array(list(grid.values())) for grid in grids]
    sums = sums_of(block, fit, points)
    every = _moved_by_points(block, grounds, grids) if sums is None else _moved_by_sums(grounds, sums)
    found = (_solved(grid, linear, parameters, moved) for grid, moved in zip(points, every, strict=True))
    return tuple(tuple(sorted(starts, key=lambda start: -start.gain)) for starts in found)


def sums_of(block: Block, fit: Fit, grids: list[FloatArray]) -> list[Sum] | None:
    """Grids (M, P) as sums of fewer pieces than points; None where there are none such, where what comes behind the
    block passes no sum, and where what is linear is not at zero.
    """
    context = Context(fit.record, fit.plant)
    if block.sum_of is None or not all(map(len, grids)) or not passes_sums(context, fit.parts, block.stage):
        return None
    linear = [p.linear for p in block.parameters(context)]
    if any(np.any(points[:, linear]) for points in grids):
        return None
    sums = [block.sum_of(points, context) for points in grids]
    fewer = all(len(told.pieces) < len(points) for told, points in zip(sums, grids, strict=True))
    return sums if fewer else None


def _moved_by_sums(grounds: tuple[Ground, ...], sums: list[Sum]) -> list[_Moved]:
    """What points that are sums move, by the inner products of their pieces alone."""
    fit = grounds[0].fit
    context = Context(fit.record, fit.plant)
    pieces = {(piece.block, piece.values.tobytes()): piece for told in sums for piece in told.pieces}
    blocks = dict.fromkeys(block for block, _ in pieces)
    beside = {block: (Beside(block, fit), _steps_of(block.parameters(context))) for block in blocks}
    simulated = {}
    for key, piece in pieces.items():
        path, steps = beside[piece.block]
        simulated[key] = _simulations(path, piece.values + steps)
    found = []
    for under, told in zip(grounds, sums, strict=True):
        each = [simulated[piece.block, piece.values.tobytes()] for piece in told.pieces]
        gram, slope = _products(under, moves(under, np.concatenate(each)))
        count, size = len(each), len(each[0])
        between = np.tensordot(told.weights, gram.reshape(count, size, count, size), 1)
        of_points = np.einsum("makb,mk->mab", between, told.weights)
        found.append(_Moved(under, of_points, told.weights @ slope.reshape(count, size)))
    return found


def _moved_by_points(block: Block, grounds: tuple[Ground, ...], grids: list[dict[bytes, FloatArray]]) -> list[_Moved]:
    """What points move, each simulated: the grids have values (P,) by their bytes."""
    fit = grounds[0].fit
    beside, steps = Beside(block, fit), _steps_of(block.parameters(Context(fit.record, fit.plant)))
    places = [{key: k for k, key in enumerate(points)} for points in grids]
    size = len(steps)
    every = [
        _Moved(under, np.empty((len(points), size, size)), np.empty((len(points), size)))
        for under, points in zip(grounds, grids, strict=True)
    ]
    rows = np.zeros((size, len(grounds[0].rows)))
    for key, values in {key: values for points in grids for key, values in points.items()}.items():
        simulated = _simulations(beside, values + steps)
        for at, moved in zip(places, every, strict=True):
            if key in at:
                _move(moved.under, simulated, rows)
                moved.gram[at[key]], moved.slope[at[key]] = _products(moved.under, rows)
    return every


def _products(under: Ground, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Inner products of what moves the whitened residual, rows (L, rows), with each other (L, L) and with that residual
    (L,), the linear model following.
    """
    along = rows.dot(under.basis)  # `@` takes longer over so few rows, for the same products
    return rows.dot(rows.T) - along.dot(along.T), rows.dot(under.rows)


def _steps_of(parameters: tuple[Parameter, ...]) -> FloatArray:
    """(L, P) from a point of the grid to what is simulated there: each linear parameter moved by its scale, nothing
    where none is linear.
    """
    linear = [k for k, p in enumerate(parameters) if p.linear]
    steps = np.zeros((max(len(linear), 1), len(parameters)))
    for step, k in zip(steps, linear, strict=False):
        step[k] = parameters[k].scale
    return steps


def at_given(block: Block, fit: Fit) -> tuple[Start, ...]:
    """The grid of a block at the given simulation's own parameters, the nearest free run first (gain: its deviation
    from PV, negative).

    Beside what makes a loop far from linear the linear refit has gone astray, and so have scans along its slopes.
    """
    given = fit.given.plant
    plant = given.changed(b=fit.plant.b, x0=fit.plant.x0, speed0=fit.plant.speed0)
    found = []
    for values in block.starts(Context(fit.record, plant), fit.residual):
        error = fit.record.pv_deviation - simulate(fit.record, plant, (*fit.parts, Part(block, values)))
        found.append(Start(values, -float(np.std(error[fit.record.usable])), plant))
    return tuple(sorted(found, key=lambda start: -start.gain))


def _simulations(beside: Beside, points: FloatArray) -> FloatArray:
    """The simulations (L, N) with the block at some values (L, P)."""
    if len(points) == 1:
        return beside.simulated(points[0])[None, :]
    return np.stack([beside.simulated(values) for values in points])


def _solved(points: FloatArray, linear: list[int], parameters: tuple[Parameter, ...], moved: _Moved) -> list[Start]:
    """The points (M, P) of a grid, their linear parameters by least squares; the linear model follows by inner products
    with its directions alone.
    """
    if len(points) == 0:
        return []
    # Where all linear parameters are zero the block does nothing: what it moves is the difference.
    gram, slope, under = moved.gram, moved.slope, moved.under
    if not linear:
        gains = gained(under, under.energy + 2.0 * slope[:, 0] + gram[:, 0, 0]).tolist()
        return [Start(values, gain) for values, gain in zip(points, gains, strict=True)]
    ridge = (1e-10 * np.trace(gram, axis1=1, axis2=2)[:, None, None] + 1e-300) * np.eye(len(linear))
    change = -np.linalg.solve(gram + ridge, slope[:, :, None])[:, :, 0]
    curve = np.einsum("mi,mij,mj->m", change, gram, change)
    gains = gained(under, under.energy + 2.0 * np.sum(change * slope, axis=1) + curve).tolist()
    scales = np.array([parameters[k].scale for k in linear])
    low, high = (np.array([getattr(parameters[k], side) for k in linear]) for side in ("low", "high"))
    best = points.copy()
    best[:, linear] = np.clip(points[:, linear] + change * scales, low, high)
    return [Start(values, gain) for values, gain in zip(best, gains, strict=True)]


def gained(ground_: Ground, energies: FloatArray) -> FloatArray:
    """The gains in log-likelihood (nat) where these energies (M,) are left of the whitened residual."""
    whole = max(ground_.energy, 1e-100)
    left = np.maximum(energies, 1e-200 * whole)  # none is left where a simulation ran away
    return 0.5 * ground_.count * np.asarray(np.log(whole / left))


def moves(ground_: Ground, simulated: FloatArray) -> FloatArray:
    """By how much the simulations (L, N) move the whitened residual (L, rows)."""
    rows = np.zeros((len(simulated), len(ground_.rows)))
    _move(ground_, simulated, rows)
    return rows


def _move(ground_: Ground, simulated: FloatArray, rows: FloatArray) -> None:
    """Writes by how much the simulations (L, N) move the whitened residual into rows (L, rows) of zeros."""
    record, noise = ground_.fit.record, ground_.fit.noise
    scaled_innovations(record.pv_deviation, simulated, record.usable, noise, ground_.whitened, rows)


def task_with(fit: Fit, block: Block) -> Task:
    """The task of fitting all parts of a fit together with one more block."""
    return make_task(fit.record, fit.given, (*(part.block for part in fit.parts), block))
