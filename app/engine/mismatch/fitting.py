"""Fits a free-run simulation to PV under coloured noise: Levenberg-Marquardt in the whitened domain, noise model in
turn.
"""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.mismatch.block import Block, Context, Parameter, Part
from app.engine.mismatch.chain import simulate
from app.engine.mismatch.experiment import Experiment
from app.engine.mismatch.noise import NoiseModel, fit_noise, settling_samples, whiten
from app.engine.mismatch.plant import Plant
from app.engine.recording import FloatArray

GIVEN_DEVIATION = 0.05
OWN_DEVIATION = 1.0
FREED_DEVIATION = 0.4
START_DEVIATION, FIRST_SAMPLES = 0.05, 3
BEFORE_SHARE = 0.25  # of OP's span: how far OP usually moves within a dead time
SLOW_TIMES, SLOW_COST = 5.0, 7.0
SLOW_POLE, SETTLED = 0.9, 0.85


@dataclass(frozen=True)
class Given:
    """The linear model to start from, and how far to trust it.

    plant: gain, time constants, dead time. deviation: relative standard deviation of its gain and time constants.
    second_order, integrating: its structure, which the refit keeps.
    """

    plant: Plant
    deviation: float = GIVEN_DEVIATION
    second_order: bool = False
    integrating: bool = False


@dataclass(frozen=True)
class Free:
    """One free number of a fit: x = (log) value / scale, normal prior (centre, deviation) and bounds, all of x."""

    name: str
    scale: float
    centre: float
    deviation: float
    low: float
    high: float
    log: bool = False
    step: float = 1e-3
    linear: bool = False

    def value(self, x: float) -> float:
        return float(self.scale * (np.exp(x) if self.log else x))

    def coordinate(self, value: float) -> float:
        return float(np.log(max(value, 1e-300) / self.scale) if self.log else value / self.scale)


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted simulation: plant, parts, noise, and the penalised log-likelihood (nat) of the compared samples.

    likelihood holds the priors, not the penalties of the parts. simulated: (N,) PV as deviation. free, x: the numbers
    fitted.
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


def linear_free(record: Experiment, given: Given, gain_deviation: float) -> tuple[Free, ...]:
    """The free numbers of the linear plant, with what is known of them from the given simulation."""
    g, ts, span = given.plant, record.sampling_interval_s, record.pv_span
    wide = max(5.0 * given.deviation, 0.3)
    free = [Free("K", g.K, 1.0, max(given.deviation, gain_deviation), 0.05, 20.0)]
    if not given.integrating:
        free.append(Free("tau", g.tau, 0.0, given.deviation, -wide, wide, log=True))
    if g.tau2 > 0.0:
        free.append(Free("tau2", g.tau2, 0.0, given.deviation, -wide, wide, log=True))
    late = np.hypot(given.deviation * g.theta, 0.15 * ts) / ts
    free.append(Free("theta", ts, g.theta / ts, late, 0.0, max(3.0 * g.theta / ts, 3.0 + g.theta / ts), step=0.05))
    drift = max(abs(g.K) * record.op_span, 1e-300) if given.integrating else span
    free.append(Free("b", drift, 0.0, 10.0, -50.0, 50.0))
    first = float(np.mean(record.pv_deviation[:FIRST_SAMPLES])) / span
    free.append(Free("x0", span, first, start_deviation(record, g), first - 2.0, first + 2.0))
    return tuple(free)


def start_deviation(record: Experiment, plant: Plant) -> float:
    """How far the mean of the first samples may be from where PV started (share of the span): by their noise at least,
    judged by the differences of PV, and by what OP did before the record and is still on its way to PV.
    """
    noise = float(np.std(np.diff(record.pv))) / np.sqrt(2.0 * FIRST_SAMPLES)
    late = plant.theta + plant.tau2
    answered = 1.0 - np.exp(-late / plant.tau) if plant.leak > 0.0 else late
    coming = BEFORE_SHARE * abs(plant.K) * record.op_span * answered
    return max(START_DEVIATION, float(np.hypot(noise, coming)) / record.pv_span)


def part_free(parameter: Parameter, rough: bool) -> Free:
    """The free number of a block's parameter, with its prior within its bounds."""
    step, known = 0.02 if rough else 2e-3, parameter.deviation
    if parameter.log:
        low, high = np.log(parameter.low / parameter.scale), np.log(parameter.high / parameter.scale)
        return Free(parameter.name, parameter.scale, 0.0, known, float(low), float(high), log=True, step=step)
    low, high = parameter.low / parameter.scale, parameter.high / parameter.scale
    centre = 1.0 if np.isfinite(known) else 0.0
    return Free(parameter.name, parameter.scale, centre, known, low, high, step=step, linear=parameter.linear)


@dataclass(frozen=True, eq=False)
class Task:
    """A simulation to fit: which numbers are free and what they mean."""

    record: Experiment
    given: Given
    blocks: tuple[Block, ...]
    free: tuple[Free, ...]
    counts: tuple[int, ...]
    centre: FloatArray
    certainty: FloatArray
    low: FloatArray
    high: FloatArray

    def plant_at(self, x: FloatArray) -> Plant:
        count = self.linear_count
        return replace(
            self.given.plant, **{f.name: f.value(v) for f, v in zip(self.free[:count], x[:count], strict=True)}
        )

    def parts_at(self, x: FloatArray) -> tuple[Part, ...]:
        parts, at = [], len(self.free) - sum(self.counts)
        for block, count in zip(self.blocks, self.counts, strict=True):
            values = [f.value(v) for f, v in zip(self.free[at : at + count], x[at : at + count], strict=True)]
            parts.append(Part(block, np.array(values)))
            at += count
        return tuple(parts)

    @property
    def linear_count(self) -> int:
        return len(self.free) - sum(self.counts)

    def simulated(self, x: FloatArray) -> FloatArray:
        return simulate(self.record, self.plant_at(x), self.parts_at(x))


def make_task(record: Experiment, given: Given, blocks: tuple[Block, ...]) -> Task:
    """The task of fitting the given linear model together with `blocks`."""
    loose = FREED_DEVIATION if any(block.frees_gain for block in blocks) else 0.0
    free = list(linear_free(record, given, loose))
    context = Context(record, given.plant)
    counts = []
    for k, block in enumerate(blocks):
        offered = [part_free(parameter, block.rough) for parameter in block.parameters(context)]
        free += [replace(f, name=f"{k}.{f.name}") for f in offered]
        counts.append(len(offered))
    numbers = np.array([(f.centre, 1.0 / f.deviation, f.low, f.high) for f in free]).T
    return Task(record, given, blocks, tuple(free), tuple(counts), *numbers)


def task_of(found: Fit) -> Task:
    """The task that a fit has solved."""
    return make_task(found.record, found.given, tuple(part.block for part in found.parts))


def start_at(task: Task, plant: Plant, values: FloatArray) -> FloatArray:
    """Coordinates of a linear plant and the blocks' values in a row."""
    linear = [f.coordinate(getattr(plant, f.name)) for f in task.free if "." not in f.name]
    rest = [f.coordinate(v) for f, v in zip(task.free[len(linear) :], values, strict=True)]
    return clipped(task, np.array(linear + rest))


def clipped(task: Task, x: FloatArray) -> FloatArray:
    return np.minimum(np.maximum(x, task.low), task.high)


@dataclass(frozen=True, eq=False)
class Whitened:
    """Residuals of a task at one point: whitened samples over the noise's deviation, then the prior's rows."""

    rows: FloatArray
    simulated: FloatArray

    @property
    def cost(self) -> float:
        return float(self.rows @ self.rows)


def prior_rows(task: Task, x: FloatArray) -> FloatArray:
    return (x - task.centre) * task.certainty


def residual_rows(task: Task, x: FloatArray, noise: NoiseModel) -> Whitened:
    simulated = task.simulated(x)
    e = whiten(task.record.pv_deviation - simulated, task.record.usable, noise)[settling_samples(task.record.samples) :]
    return Whitened(np.concatenate((e / noise.deviation, prior_rows(task, x))), simulated)


def slopes(task: Task, x: FloatArray, noise: NoiseModel, at: Whitened) -> FloatArray:
    """(rows, P) numerical derivatives of the whitened residuals."""
    columns = np.empty((len(at.rows), len(x)))
    for k, f in enumerate(task.free):
        step = f.step if x[k] + f.step <= f.high else -f.step
        moved = x.copy()
        moved[k] += step
        columns[:, k] = (residual_rows(task, moved, noise).rows - at.rows) / step
    return columns


def descend(task: Task, x: FloatArray, noise: NoiseModel, steps: int) -> FloatArray:
    """Levenberg-Marquardt within the bounds, the noise model held."""
    at = residual_rows(task, x, noise)
    damping = 1e-2
    for _ in range(steps):
        jacobian = slopes(task, x, noise, at)
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ at.rows
        gained = 0.0
        for _ in range(5):
            lifted = normal + damping * np.diag(np.diag(normal) + 1e-9)
            trial = clipped(task, x - np.linalg.solve(lifted, gradient))
            there = residual_rows(task, trial, noise)
            if there.cost < at.cost:
                gained = at.cost - there.cost
                x, at, damping = trial, there, max(0.1 * damping, 1e-6)
                break
            damping *= 10.0
        if gained < 0.05:
            break
    return x


POLISHING_STEPS = (0.12, 0.04, 0.012, 0.004, 0.0012)


def polish(task: Task, x: FloatArray, noise: NoiseModel) -> FloatArray:
    """A pattern search over the blocks' non-linear parameters, all others following along their slopes, the noise
    model held.

    Where the simulation jumps with a parameter (a threshold, a moment) its slope misleads, and descents end where they
    began.
    """
    searched = [k for k, f in enumerate(task.free) if "." in f.name and not f.linear]
    if not searched:
        return x
    at = residual_rows(task, x, noise)
    basis = orthonormal(np.delete(slopes(task, x, noise, at), searched, axis=1))
    cost = projected_cost(at.rows, basis)
    for share in POLISHING_STEPS:
        for k in searched * 2:
            for sign in (1.0, -1.0):
                f = task.free[k]
                moved = x.copy()
                moved[k] = np.clip(x[k] + sign * share * (f.high - f.low), f.low, f.high)
                there = projected_cost(residual_rows(task, moved, noise).rows, basis)
                if there < cost - 1e-6:
                    x, cost = moved, there
                    break
    return x


def orthonormal(columns: FloatArray) -> FloatArray:
    """An orthonormal basis (N, P) of the columns (N, P) through their Gram matrix: quick for long thin matrices."""
    columns = columns / (np.sqrt(np.sum(columns * columns, axis=0)) + 1e-300)
    weights, directions = np.linalg.eigh(columns.T @ columns)
    kept = weights > 1e-9 * weights[-1]
    return columns @ (directions[:, kept] / np.sqrt(weights[kept]))


def projected_cost(rows: FloatArray, basis: FloatArray) -> float:
    """The sum of squares that is left when the directions of `basis` are taken out."""
    along = basis.T @ rows
    return float(rows @ rows - along @ along)


def finish(task: Task, x: FloatArray, noise: NoiseModel) -> Fit:
    """The fit at x under a noise model, with its likelihood."""
    simulated = task.simulated(x)
    count = int(np.sum(task.record.usable[settling_samples(task.record.samples) :]))
    prior = prior_rows(task, x)
    likelihood = -count * np.log(noise.deviation) - 0.5 * float(prior @ prior)
    likelihood -= slowness_penalty(noise, task.record, task.given)
    return Fit(
        task.record, task.given, task.plant_at(x), task.parts_at(x), noise, float(likelihood), simulated, task.free, x
    )


def fit(task: Task, x: FloatArray, noise: NoiseModel | None = None, rounds: int = 2, steps: int = 8) -> Fit:
    """Simulation and noise model in turn, `rounds` times, from coordinates x.

    Without `noise` it is first found from the residual at x. Source: the iterated generalised least squares of
    Soderstrom 1974,
    doi 10.1016/0005-1098(74)90063-1; output error with a noise model is the prediction error method of Ljung.
    """
    record = task.record
    if noise is None:
        noise = fit_noise(record.pv_deviation - task.simulated(x), record.usable)
    best = finish(task, x, fit_noise(record.pv_deviation - task.simulated(x), record.usable, noise))
    for _ in range(rounds):
        x = descend(task, polish(task, best.x, best.noise), best.noise, steps)
        residual = record.pv_deviation - task.simulated(x)
        fitted = finish(task, x, fit_noise(residual, record.usable, best.noise))
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
    x = start_at(task, replace(given.plant, b=0.0, x0=float(np.mean(record.pv_deviation[:3]))), np.zeros(0))
    return best_of_noise(task, x, rounds)


def best_of_noise(task: Task, x: FloatArray, rounds: int = 3) -> Fit:
    """The better of two fits: noise taken from the start, and noise taken for nearly white, where the optimum is
    another.
    """
    quiet = quiet_noise(task.record, task.given)
    found = fit(task, x, None, rounds)
    other = fit(task, descend(task, x, quiet, 8), None, rounds)
    return found if found.likelihood >= other.likelihood else other


def slowness_penalty(noise: NoiseModel, record: Experiment, given: Given) -> float:
    """What a noise slower than loads behind this process usually are costs (nat): nearly a random walk, it fits every
    difference.

    None where the process integrates, because then it makes a random walk of any load.
    """
    if given.integrating:
        return 0.0
    slowest = SLOW_TIMES * (given.plant.tau + given.plant.tau2 + given.plant.theta)
    usual = min(record.sampling_interval_s / slowest, 0.5)
    return float(sum(SLOW_COST * max(np.log(usual / max(1.0 - pole, 1e-6)), 0.0) for pole in noise.poles))


def settle(found: Fit) -> Fit:
    """The same model fitted by its free run alone, where the likelihood had taken what is left for slow noise.

    A process that the library describes only nearly leaves slow errors; a noise model that is nearly a random walk
    then hides
    the free run's error from the fit. Kept only where the free run is better by more than SETTLED.
    """
    if max(found.noise.poles) < SLOW_POLE or not found.parts:
        return found
    other = finish_as(found, white_fit(found))
    before, after = (float(np.std(fit.residual[found.record.usable])) for fit in (found, other))
    return other if after < SETTLED * before else found


def white_fit(found: Fit) -> FloatArray:
    """Coordinates of the same model where its free run is nearest to PV."""
    task = task_of(found)
    white = NoiseModel(deviation=float(np.std(found.residual[found.record.usable])))
    return descend(task, polish(task, found.x, white), white, 30)


def finish_as(found: Fit, x: FloatArray) -> Fit:
    """The same model at other coordinates, its noise model kept."""
    return finish(task_of(found), x, found.noise)


def by_free_run(found: Fit) -> Fit:
    """The same model fitted by its free run alone, with the noise that it then leaves."""
    task = task_of(found)
    x = white_fit(found)
    return finish(task, x, fit_noise(found.record.pv_deviation - task.simulated(x), found.record.usable))


def quiet_noise(record: Experiment, given: Given) -> NoiseModel:
    """Noise of a load behind the process lag under some white noise: what is likely before anything was fitted.

    The noise found beside a poor simulation is nearly a random walk and hides every slow difference.
    """
    ts, plant = record.sampling_interval_s, given.plant
    slowest = max(plant.tau if plant.leak > 0.0 else 30.0 * ts, plant.tau2, 3.0 * ts)
    return NoiseModel((float(np.exp(-ts / slowest)), 0.0), (0.3, 0.0), float(np.std(np.diff(record.pv))) + 1e-12)
