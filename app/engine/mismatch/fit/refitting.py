"""The simulation's own parameters, further off than they were trusted: what another gain, other time constants or a
shorter dead time explain is no missing physics. They compete with the library like a block of it; where they are
believed the linear model begins there.
"""

from dataclasses import replace

import numpy as np

from app.engine.evidence import Reason
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.task import Given
from app.engine.mismatch.loop.block import Block, Context, Parameter, Part, grid
from app.engine.mismatch.loop.chain import altered_plant
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.recording import FloatArray

CODE = "simulation.parameters"
_GAINS = (0.01, 0.03, 0.1, 0.3, 0.5, 0.75, 1.0, 1.4, 2.0, 3.5, 10.0, 30.0, 100.0)
_TIMES, _SHARES, _DAMPINGS = (0.3, 0.55, 1.0, 1.8, 3.3), (0.3, 1.0), (0.4, 1.0, 2.5)
OFF_BY, _DEVIATION = 1.15, 0.5  # of the logarithm: half or twice is usual where a simulation is off, a tenth is not


def _parameters(context: Context) -> tuple[Parameter, ...]:
    """Factors of what was given. A longer dead time is an effect with a name (process.dead_time); a shorter is none."""
    always = (
        Parameter("gain", "of given", 0.005, 200.0, 1.0, log=True, deviation=_DEVIATION),
        Parameter("time", "of given", 0.1, 10.0, 1.0, log=True, deviation=_DEVIATION),
        Parameter("late", "of given", 0.0, 1.0, 1.0),
    )
    if context.plant.damping <= 0.0:
        return always
    return (*always, Parameter("damping", "of given", 0.1, 10.0, 1.0, log=True, deviation=_DEVIATION))


def _starts(context: Context, _: FloatArray) -> FloatArray:
    times = _TIMES if _has_time(context.plant) else (1.0,)
    shares = _SHARES if context.plant.theta > 0.0 else (1.0,)
    dampings = (np.array(_DAMPINGS),) if context.plant.damping > 0.0 else ()
    return grid(np.array(_GAINS), np.array(times), np.array(shares), *dampings)


def _has_time(plant: Plant) -> bool:
    return plant.leak > 0.0 or plant.tau2 > 0.0


def _alter(plant: Plant, values: FloatArray, _: Context) -> Plant:
    gain, time, late, *swing = values
    tau = plant.tau * time if plant.leak > 0.0 else plant.tau
    tau2, tau3 = plant.tau2 * time, plant.tau3 * time
    damping = plant.damping * float(np.prod(swing))
    return plant.changed(K=plant.K * gain, tau=tau, tau2=tau2, tau3=tau3, theta=plant.theta * late, damping=damping)


def further_off(values: FloatArray, context: Context) -> bool:
    """What the refit within its trust does is not asked again."""
    gain, time, late, *swing = values
    earlier_s = (1.0 - late) * context.plant.theta
    within = all(1.0 / OFF_BY < factor < OFF_BY for factor in (gain, time, *swing))
    return not within or earlier_s > max((OFF_BY - 1.0) * context.plant.theta, context.record.sampling_interval_s)


def _reverse(plant: Plant, values: FloatArray, context: Context) -> Plant:
    """As `_alter`, with the other sign of the gain."""
    altered = _alter(plant, values, context)
    return altered.changed(K=-altered.K)


PARAMETERS = Block(
    CODE,
    "process",
    "process",
    "always",
    _parameters,
    _starts,
    alter=_alter,
    penalty=9.0,
    finalists=1,
    distant=True,
    sensible=further_off,
)
_REVERSED = replace(PARAMETERS, alter=_reverse, form="reversed", sensible=None)


def offered_beside(base: Fit) -> tuple[Block, ...]:
    """The parameters as contenders, where a simulation was given: one of our own is fitted freely at once."""
    if base.given.own:
        return ()
    return (PARAMETERS, _REVERSED) if _runs_against(base) else (PARAMETERS,)


def _runs_against(base: Fit) -> bool:
    """Whether PV goes down where the given simulation goes up: by a wrong sign, or because a controller makes OP."""
    record, seen = base.record, base.record.usable
    simulated = run_process(record.op_deviation, base.given.plant, record.sampling_interval_s)[seen]
    return bool((simulated - np.mean(simulated)) @ record.pv_deviation[seen] < 0.0)


def parameters_of(found: Fit) -> Part | None:
    """The parameters among the parts of a fit."""
    return next((part for part in found.parts if part.block.code == CODE), None)


def freed(found: Fit, part: Part) -> Given:
    """The given model with the parameters that a fit found, trusted no more than their factors were: they come from the
    very samples that they are fitted to again. A dead time that is not shorter stays as given: a longer one has a name.
    """
    plant = altered_plant(Context(found.record, found.plant), (part,)).changed(b=0.0, x0=0.0, speed0=0.0)
    late = _DEVIATION if part.values[2] < 1.0 / OFF_BY else found.given.deviation
    return replace(found.given, plant=plant, deviation=_DEVIATION, late_deviation=late)


def off_in_words(given: Given, found: Given, asked: str = "") -> Reason:
    """Which of the given simulation's parameters the record shows otherwise, by how much, and what is asked of it."""
    before, after = given.plant, found.plant
    names = ("tau", "tau2", "tau3", "theta", "damping")
    others = tuple((name, getattr(before, name), getattr(after, name)) for name in names)
    changes = [("K", before.K, after.K), *(change for change in others if change[1] > 0.0)]
    if before.leak == 0.0:
        changes = [change for change in changes if change[0] != "tau"]
    said = ", ".join(f"{name} {was:.4g} -> {now:.4g}" for name, was, now in changes)
    text = f"the simulation's own parameters are further off than {100.0 * given.deviation:.0f} %: {said}{asked}"
    return Reason("parameters_off", text)
