"""A second recording, which no fit has seen, simulated with the model of the first; and an exported model simulated
again.
"""

from dataclasses import replace

import numpy as np
import scipy

from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.windows import windows_along
from app.engine.mismatch.judge.holdout import judge
from app.engine.mismatch.judge.result import ExplainedModel, Improvement, PartModel
from app.engine.mismatch.loop.block import Block, Context, Part
from app.engine.mismatch.loop.chain import simulate
from app.engine.mismatch.loop.experiment import FIRST_SAMPLES, LARGEST, Experiment, alike, experiment, may_be_gain
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics import fixed, gain_drift, named, terms
from app.engine.recording import BoolArray, FloatArray
from app.errors import DataError

_START_SHARE, _LEAST_START = 0.1, 5
_LONGEST_DEAD_TIME = 1.0  # of the record: beyond, nothing of OP is seen in it
# What set in amid the first record, or grew along it, is there from the start on of a later one, as large as it became:
# the block that is there all along, and which of the values are its own. Where a stem stands is found from the start.
_THERE_SINCE: dict[str, tuple[str, tuple[int, ...]]] = {
    "valve.stiction/sets_in": ("valve.stiction/he", (0, 1)),
    "valve.stiction/choudhury_sets_in": ("valve.stiction/choudhury", (0, 1)),
    "valve.deadband/grows": ("valve.deadband", (0,)),
    "process.dead_time/sets_in": ("process.dead_time", (1,)),
    "process.dead_time/grows": ("process.dead_time", (0,)),
}
OF_ONE_RECORD = (
    "disturbance.step",
    "disturbance.ramp",
    "disturbance.oscillation",
    "sensor.step",
    "sensor.drift",
    "sensor.stuck",
    "sensor.dropout",
    "process.gain_drift",
)
_LASTS = (gain_drift.LASTED.name,)


def validate(
    base: Fit, final: Fit, sensors: tuple[Part, ...], second: Experiment, given: Plant | FloatArray | None
) -> Improvement:
    """Free runs over the second record, only their initial state estimated, from the first tenth of what is compared of
    it; judged over all that is compared, as benchmarks are, the first tenth too.

    sensors: the parts that PV showed by itself. given: the given simulation as a model at the level of the first
    record, or its trace (N,) over the second one, or None. What belongs to moments of the first record (a step, a stuck
    stretch) is left out; what set in then is there all along, a gain that drifted with its last.
    Raises DataError("nothing_known") where nothing is compared beyond the start, DataError("signal_missing").
    """
    record = alike(base.record, second)
    begun = beginning(record.usable)
    if not (record.usable & ~begun).any():
        raise DataError("nothing_known", "no sample of the second recording's PV is known beyond its start")
    refitted = started(record, begun, base.plant, _transferred(record, base.parts))
    told = Context(base.record, base.plant)
    parts = lasting((*(gain_drift.as_it_ended(part, told) for part in final.parts), *sensors))
    explained = started(record, begun, final.plant, _transferred(record, parts))
    if isinstance(given, Plant):
        given = started(record, begun, given, ()) + record.pv_mid
    return Improvement(
        None if given is None else judge(record.pv, given, record.usable),
        judge(record.pv, refitted + record.pv_mid, record.usable),
        judge(record.pv, explained + record.pv_mid, record.usable),
        windows_along(record, record.usable),
    )


def _transferred(record: Experiment, parts: tuple[Part, ...]) -> tuple[Part, ...]:
    """The parts with the blocks of another record, whose measured signals are its own."""
    known = named(record, (part.block.name for part in parts))
    missing = [part.block.name for part in parts if part.block.name not in known]
    if missing:
        raise DataError("signal_missing", f"the second recording lacks the signals of {', '.join(missing)}")
    return tuple(Part(known[part.block.name], part.values) for part in parts)


def lasting(parts: tuple[Part, ...]) -> tuple[Part, ...]:
    """The parts that a second record has as well, as they are there."""
    kept = (terms.untimed(part) for part in parts if part.block.name in _LASTS or part.block.code not in OF_ONE_RECORD)
    return tuple(_there_since(part) for part in kept if part is not None)


def _there_since(part: Part) -> Part:
    """A part as it is in a record after the one in which it set in."""
    if part.block.name not in _THERE_SINCE:
        return part
    name, own = _THERE_SINCE[part.block.name]
    block = next(block for block in fixed() if block.name == name)
    at_rest = (0.0,) if name.startswith("valve.") else ()
    return Part(block, np.array([*(part.values[k] for k in own), *at_rest]))


def beginning(usable: BoolArray) -> BoolArray:
    """(N,) True at the first tenth of the samples that are compared (N,)."""
    at = np.flatnonzero(usable)
    begun = np.zeros(len(usable), dtype=np.bool_)
    begun[at[: max(int(_START_SHARE * len(at)), _LEAST_START)]] = True
    return begun


def started(record: Experiment, begun: BoolArray, plant: Plant, parts: tuple[Part, ...]) -> FloatArray:
    """The free run (N,), as deviation, whose initial states fit the samples `begun` (N,) best: looked for as shares of
    their scales, what they leave as one of PV's span, because steps and tolerances of the search have no unit.
    """
    context, span, states = Context(record, plant), record.pv_span, plant.states
    offered = [(k, j, p) for k, part in enumerate(parts) for j, p in enumerate(part.block.parameters(context))]
    begins = [(k, j, parameter.scale) for k, j, parameter in offered if parameter.begins]

    def run(shares: FloatArray) -> FloatArray:
        moved = [part.values.copy() for part in parts]
        for (k, j, scale), share in zip(begins, shares[len(states) :], strict=True):
            moved[k][j] = share * scale
        told = tuple(Part(part.block, values) for part, values in zip(parts, moved, strict=True))
        stands = dict(zip(states, (span * shares[: len(states)]).tolist(), strict=True))
        return simulate(record, plant.changed(**stands), told)

    start = np.zeros(len(states) + len(begins))
    start[0] = np.mean(record.pv_deviation[begun][:FIRST_SAMPLES]) / span
    found = scipy.optimize.least_squares(lambda shares: (run(shares) - record.pv_deviation)[begun] / span, start)
    return run(found.x)


def _rest_of(model: ExplainedModel, samples: int) -> FloatArray:
    """(N,) what the given simulation held beside its linear model, which only the record it was made for has."""
    if not model.rest:
        return np.zeros(samples)
    if len(model.rest) != samples:
        raise DataError(
            "signal_length", f"the model belongs to a record of {len(model.rest):,} samples, OP has {samples:,}"
        )
    return np.array(model.rest)


def _middles_of(model: ExplainedModel, record: Experiment) -> tuple[tuple[str, float], ...]:
    """Where the model's measured signals stood in its own record; in this one, where it does not say."""
    told = dict(zip(model.measured, model.measured_mids, strict=False))
    return tuple((name, told.get(name, middle)) for name, middle in record.middles)


def _values_of(part: PartModel, block: Block, context: Context) -> FloatArray:
    """The values of an exported part. Raises DataError("model_invalid") where they are not what its block takes beside
    its plant: an overflow has a balance too where that integrates. What is fitted by its logarithm is above 0.
    """
    parameters = block.parameters(context)
    values = np.array(part.values, dtype=np.float64)
    if len(values) != len(parameters) or not np.all(np.isfinite(values)):
        names = ", ".join(parameter.name for parameter in parameters) or "nothing"
        raise DataError("model_invalid", f"{part.name} needs finite values of {names}")
    if any(parameter.log and value <= 0.0 for parameter, value in zip(parameters, values, strict=True)):
        names = ", ".join(parameter.name for parameter in parameters if parameter.log)
        raise DataError("model_invalid", f"{part.name} needs {names} above 0")
    return values


def _plant_of(model: ExplainedModel, duration_s: float) -> Plant:
    """The plant of an exported model. Raises DataError("model_invalid") where it cannot be simulated along a record of
    this length (s): JSON is easily changed by hand.
    """
    numbers = dict(model.plant)
    strange = [name for name in numbers if name not in Plant.__dataclass_fields__]
    lacking = [name for name in ("K", "tau", "theta") if name not in numbers]
    others = {name: getattr(model, name) for name in ("sampling_interval_s", "op_mid", "pv_mid", "op_span", "pv_span")}
    others |= {} if model.duration_s is None else {"duration_s": model.duration_s}
    others |= {f"the middle of {name}": mid for name, mid in zip(model.measured, model.measured_mids, strict=False)}
    loose = [name for name, value in (*numbers.items(), *others.items()) if not np.isfinite(value)]
    faults = [f"its plant has {', '.join(strange)}"] if strange else []
    faults += [f"its plant lacks {', '.join(lacking)}"] if lacking else []
    faults += [f"{', '.join(loose)} are no finite numbers"] if loose else []
    if not faults:
        faults = _out_of_bounds(numbers, others, duration_s)
    if faults:
        raise DataError("model_invalid", f"the model cannot be simulated: {'; '.join(faults)}")
    return Plant(**numbers)


def _out_of_bounds(plant: dict[str, float], others: dict[str, float], duration_s: float) -> list[str]:
    """Gain, times and spans of a model that no process has."""
    positive = ("sampling_interval_s", "op_span", "pv_span", "duration_s")
    above = [name for name in positive if others.get(name, 1.0) <= 0.0]
    above += [name for name in ("tau", "exponent") if plant.get(name, 1.0) <= 0.0]
    below = [name for name in ("theta", "tau2", "tau3", "leak", "damping") if plant.get(name, 0.0) < 0.0]
    late = plant["theta"] > _LONGEST_DEAD_TIME * duration_s
    return [
        *([f"K must be other than 0, and at most {LARGEST:g}"] if not may_be_gain(plant["K"]) else []),
        *([f"{', '.join(above)} must be more than 0"] if above else []),
        *([f"{', '.join(below)} must not be less than 0"] if below else []),
        *([f"its dead time of {plant['theta']:g} s is as long as the record, {duration_s:g} s"] if late else []),
    ]


def simulate_again(
    model: ExplainedModel, op: FloatArray, measured: tuple[tuple[str, FloatArray], ...] = ()
) -> FloatArray:
    """PV (N,) in its unit, simulated from OP (N,) with an exported model, started as in the record it was fitted to.

    measured: the signals that the model names. Raises DataError("signal_missing") where one of them is not given,
    DataError("signal_length") where the model needs a part of the given simulation and OP is of another length,
    DataError("model_invalid") where a part has other values than it takes.
    """
    record = experiment(model.sampling_interval_s, op, op, None, measured)
    record = replace(
        record,
        op_mid=model.op_mid,
        pv_mid=model.pv_mid,
        op_deviation=op - model.op_mid,
        op_span=model.op_span,
        pv_span=model.pv_span,
        feedback=model.op_follows_pv,
        reference_s=model.duration_s,
        reference_middles=_middles_of(model, record),
        rest=_rest_of(model, len(op)),
    )
    plant = _plant_of(model, len(op) * model.sampling_interval_s)
    known = named(record, (part.name for part in model.parts))
    missing = [part.name for part in model.parts if part.name not in known]
    if missing:
        raise DataError("signal_missing", f"the model needs signals for {', '.join(missing)}")
    context = Context(record, plant)
    parts = tuple(Part(known[part.name], _values_of(part, known[part.name], context)) for part in model.parts)
    return simulate(record, plant, parts) + model.pv_mid
