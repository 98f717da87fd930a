"""Fits a free-run simulation to PV under coloured noise: whitened Levenberg-Marquardt and the noise model in turn."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from app.engine.mismatch.fit.noise import NoiseModel, compared_count, fit_noise, scaled_innovations, settling_samples
from app.engine.mismatch.fit.task import Free, Given, Task, clipped, make_task, start_at
from app.engine.mismatch.loop.block import Part
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.recording import FloatArray

_SLOW_TIMES, _SLOW_COST = 5.0, 7.0
LEAST_FURTHER, _FURTHER_OF_ROOT, _FURTHER_ROUNDS, _FURTHER_STEPS = 32, 2.0, 4, 6
STILL = 1e-12  # of PV's span: the deviation of noise where PV stands


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted simulation: plant, parts, noise, and the penalised log-likelihood (nat) of the compared samples.

    likelihood holds the priors, not the penalties of the parts. simulated: (N,) PV as deviation.
    free, x: the numbers that were fitted.
    """

    record: Experiment
    given: Given
    plant: Plant
    parts: tuple[Part, ...]
    noise: NoiseModel
    likelihood: float
    simulated: FloatArray
    free: tuple[Free, ...]
    x: FloatArray

    @property
    def residual(self) -> FloatArray:
        return self.record.pv_deviation - self.simulated

    @property
    def score(self) -> float:
        return self.likelihood - sum(part.block.penalty for part in self.parts)

    @cached_property
    def beside_richer_noise(self) -> "Fit":
        """The same with an autoregression beside the poles and zeros of its noise, all its numbers fitted again.

        As long as the record is short beside what the noise model lacks, it is enough; a longer one shows the rest,
        and under feedback OP holds it.
        """
        given = replace(self.given, further=further_lags(compared_count(self.record.usable)))
        return fit(task_of(replace(self, given=given)), self.x, None, _FURTHER_ROUNDS, _FURTHER_STEPS)


def further_lags(count: int) -> int:
    """How many lags an autoregression has beside the noise model where so many samples are compared: by the cube root
    of their number, because the longer a record, the more lags of the noise it shows. Source: Berk 1974,
    doi 10.1214/aos/1176342709 (an autoregression is consistent where the cube of its order is small beside the
    samples).
    """
    return max(LEAST_FURTHER, round(_FURTHER_OF_ROOT * count ** (1.0 / 3.0)))


def task_of(found: Fit) -> Task:
    """The task that a fit has solved."""
    return make_task(found.record, found.given, tuple(part.block for part in found.parts))


@dataclass(frozen=True, eq=False)
class _Whitened:
    """Residuals of a task at one point: whitened samples over the noise's deviation, then the prior's rows."""

    rows: FloatArray
    simulated: FloatArray

    @property
    def cost(self) -> float:
        return float(self.rows.dot(self.rows))


def prior_rows(task: Task, x: FloatArray) -> FloatArray:
    return (x - task.centre) * task.certainty


def residual_rows(task: Task, x: FloatArray, noise: NoiseModel) -> _Whitened:
    record, simulated = task.record, task.simulated(x)
    count = record.samples - settling_samples(record.samples)
    rows = np.zeros((1, count + len(x)))
    scaled_innovations(record.pv_deviation, simulated[None, :], record.usable, noise, rows[0], rows)
    rows[0, count:] = prior_rows(task, x)
    return _Whitened(rows[0], simulated)


def slopes(
    task: Task, x: FloatArray, noise: NoiseModel, at: _Whitened, along: Sequence[int] | None = None
) -> FloatArray:
    """(rows, P) numerical derivatives of the whitened residuals by all coordinates, or by those `along` which, in
    their order.
    """
    moving = np.arange(len(x)) if along is None else np.asarray(along, dtype=np.int64)
    steps = np.where(x + task.step <= task.high, task.step, -task.step)[moving]
    moved = np.repeat(x[None, :], len(moving), axis=0)
    moved[np.arange(len(moving)), moving] += steps
    alike = int(np.argmin(np.append(moving < task.linear_count, False)))  # the first ones, of the plant alone
    count, columns = len(at.rows) - len(x), np.empty((len(moving), len(at.rows)))
    record, simulated = task.record, task.simulated_each(moved, alike)
    scaled_innovations(record.pv_deviation, simulated, record.usable, noise, at.rows, columns)
    columns[:, count:] = prior_rows(task, moved) - at.rows[count:]
    columns /= steps[:, None]
    return columns.T


@np.errstate(over="ignore", invalid="ignore")  # of exact data, whose noise is nearly none: no cost is less than it
def descend(task: Task, x: FloatArray, noise: NoiseModel, steps: int, along: Sequence[int] | None = None) -> FloatArray:
    """Levenberg-Marquardt within the bounds, the noise model held. along: which coordinates move; None: all."""
    at = residual_rows(task, x, noise)
    moving = np.arange(len(x)) if along is None else np.asarray(along)
    damping = 1e-2
    for _ in range(steps):
        jacobian = slopes(task, x, noise, at, along)
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ at.rows
        gained = 0.0
        for _ in range(5):
            lifted = normal + damping * np.diag(np.diag(normal) + 1e-9)
            trial = x.copy()
            trial[moving] -= np.linalg.solve(lifted, gradient)
            trial = clipped(task, trial)
            there = residual_rows(task, trial, noise)
            if there.cost < at.cost:
                gained = at.cost - there.cost
                x, at, damping = trial, there, max(0.1 * damping, 1e-6)
                break
            damping *= 10.0
        if gained < 0.05:
            break
    return x


_POLISHING_STEPS = (0.12, 0.04, 0.012, 0.004, 0.0012)


def _following(task: Task) -> list[int]:
    """The coordinates along whose slopes the simulation moves evenly: the plant's, and what a block has linear or
    smooth.
    """
    return [k for k, f in enumerate(task.free) if "." not in f.name or f.linear or f.smooth]


def polish(task: Task, x: FloatArray, noise: NoiseModel) -> FloatArray:
    """A pattern search over the blocks' non-linear parameters, all others following along their slopes.

    The noise model is held. Where the simulation jumps with a parameter (a threshold, a moment) its slope misleads, and
    descents end where they began.
    """
    others = _following(task)
    searched = [k for k in range(len(x)) if k not in others]
    if not searched:
        return x
    at = residual_rows(task, x, noise)
    basis = orthonormal(slopes(task, x, noise, at, others))
    cost = projected_cost(at.rows, basis)
    asked = {x.tobytes()}  # the cost only falls, so that no place is ever better when it is asked again
    for share in _POLISHING_STEPS:
        for k in searched * 2:
            for sign in (1.0, -1.0):
                moved = x.copy()
                moved[k] += sign * share * (task.high[k] - task.low[k])
                moved = clipped(task, moved)
                if moved.tobytes() in asked:
                    continue
                asked.add(moved.tobytes())
                there = projected_cost(residual_rows(task, moved, noise).rows, basis)
                if there < cost - 1e-6:
                    x, cost = moved, there
                    break
    return x


def orthonormal(columns: FloatArray) -> FloatArray:
    """An orthonormal basis (N, P) of the columns (N, P) through their Gram matrix: quick for long thin matrices."""
    columns = columns[:, np.isfinite(columns).all(axis=0)]  # a simulation may run away
    if not columns.shape[1]:
        return columns
    columns = columns / (np.sqrt(np.sum(columns * columns, axis=0)) + 1e-300)
    weights, directions = np.linalg.eigh(columns.T @ columns)
    kept = weights > 1e-9 * weights[-1]
    return columns @ (directions[:, kept] / np.sqrt(weights[kept]))


def projected_cost(rows: FloatArray, basis: FloatArray) -> float:
    """The sum of squares of `rows` (N,) that is left when the directions of `basis` (N, P), orthonormal, are taken
    out.
    """
    along = basis.T.dot(rows)  # `@` takes longer over one row, for the same products
    with np.errstate(over="ignore", invalid="ignore"):  # of a simulation that ran away: no cost is less than it
        return float(rows.dot(rows) - along.dot(along))


def finish(task: Task, x: FloatArray, noise: NoiseModel) -> Fit:
    """The fit at x (P,), the task's coordinates, under a noise model.

    Its log-likelihood, in nats: -n ln(deviation) - |prior rows|^2 / 2, less what a slow noise model costs; n by
    `compared_count`, deviation that of the whitened residual, in unit of PV. What is the same for every fit of a record
    is left out.
    """
    simulated = task.simulated(x)
    prior = prior_rows(task, x)
    likelihood = -compared_count(task.record.usable) * np.log(noise.deviation) - 0.5 * float(prior @ prior)
    likelihood -= _slowness_penalty(noise, task.record, task.given)
    return Fit(
        task.record, task.given, task.plant_at(x), task.parts_at(x), noise, float(likelihood), simulated, task.free, x
    )


def noise_left(task: Task, x: FloatArray, start: NoiseModel | None = None) -> NoiseModel:
    """The noise of what the simulation at coordinates x (P,) leaves, refined from a start where there is one."""
    record = task.record
    return fit_noise(record.pv_deviation - task.simulated(x), record.usable, start, task.given.further)


def fit(task: Task, x: FloatArray, noise: NoiseModel | None = None, rounds: int = 2, steps: int = 8) -> Fit:
    """Simulation and noise model in turn, `rounds` times, from coordinates x (P,), in `steps` descents at most each
    time; ends early where a round gains hardly anything.

    Without `noise` it is first found from the residual at x. Source: the iterated generalised least squares of
    Soderstrom 1974, doi 10.1016/0005-1098(74)90063-1; output error with a noise model is the prediction error method of
    Ljung.
    """
    if noise is None:
        noise = noise_left(task, x)
    best = finish(task, x, noise_left(task, x, noise))
    for _ in range(rounds):
        x = descend(task, polish(task, best.x, best.noise), best.noise, steps)
        if any(f.smooth for f in task.free):
            x = descend(task, x, best.noise, steps, _following(task))
        fitted = finish(task, x, noise_left(task, x, best.noise))
        gained = fitted.likelihood - best.likelihood
        if gained > 0.0:
            best = fitted
        if gained < 0.1:
            break
    return best


def fit_linear(record: Experiment, given: Given, rounds: int = 4) -> Fit:
    """The given simulation with its own parameters fitted and nothing added: what it can explain is not missing
    physics.
    """
    task = make_task(record, given, ())
    x = start_at(task, replace(given.plant, b=0.0, x0=record.pv_first), np.zeros(0))
    return best_of_noise(task, x, rounds)


def best_of_noise(task: Task, x: FloatArray, rounds: int = 3) -> Fit:
    """The better of two fits: noise taken from the start, and noise taken for nearly white, where the optimum is
    another.
    """
    quiet = quiet_noise(task.record, task.given)
    found = fit(task, x, None, rounds)
    other = fit(task, descend(task, x, quiet, 8), None, rounds)
    return found if found.likelihood >= other.likelihood else other


def _slowness_penalty(noise: NoiseModel, record: Experiment, given: Given) -> float:
    """What a noise slower than loads behind this process usually are costs (nat): nearly a random walk, it fits every
    difference.

    Nothing where the process integrates, because then it makes a random walk of any load.
    """
    if given.integrating:
        return 0.0
    slowest = _SLOW_TIMES * (given.plant.tau + given.plant.tau2 + given.plant.theta)
    usual = min(record.sampling_interval_s / slowest, 0.5)
    return float(sum(_SLOW_COST * max(np.log(usual / max(1.0 - pole, 1e-6)), 0.0) for pole in noise.poles))


def quiet_noise(record: Experiment, given: Given) -> NoiseModel:
    """Noise of a load behind the process lag under some white noise: what is likely before anything was fitted.

    The noise found beside a poor simulation is nearly a random walk and hides every slow difference.
    """
    ts, plant = record.sampling_interval_s, given.plant
    slowest = max(plant.tau if plant.leak > 0.0 else 30.0 * ts, plant.tau2, 3.0 * ts)
    deviation = float(np.std(np.diff(record.pv))) + STILL * record.pv_span
    return NoiseModel((float(np.exp(-ts / slowest)), 0.0), (0.3, 0.0), deviation)
