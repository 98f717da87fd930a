"""Turns fits and patterns into effects: parameters with intervals in units, windows, conditions, evidence."""

from dataclasses import replace

import numpy as np

from app.engine.evidence import Reason
from app.engine.mismatch.compare.patterns import Pattern
from app.engine.mismatch.compete.naming import Believed
from app.engine.mismatch.compete.worth import hidden_gain
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.levels import decimals_of
from app.engine.mismatch.fit.windows import active_mask, whole, windows_along
from app.engine.mismatch.judge.between_samples import between_samples_too
from app.engine.mismatch.judge.intervals import BETWEEN_SAMPLES, deviations, interval, interval_tried
from app.engine.mismatch.judge.result import NOWHERE, Effect, Estimate, ExplainedModel, Location, PartModel
from app.engine.mismatch.judge.stem_sizes import size_of_stiction
from app.engine.mismatch.loop.block import Context, Parameter, Part
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics.stem import NAME as STEM_START
from app.engine.mismatch.physics.valve_deadband import DEADBAND
from app.engine.mismatch.physics.valve_stiction import CHOUDHURY, HE
from app.engine.mismatch.physics.valve_stiction import CODE as STICTION
from app.engine.recording import FloatArray

CERTAIN = 0.995
# Without a given simulation about two of three names of a competition were what the plant said (docs/EXPLAINED.md).
OWN_CERTAIN = 0.7
_UNUSED_PLANT = Plant(K=1.0, tau=1.0, theta=0.0)  # what PV shows by itself asks nothing of the plant
_OF_ONE_STEM = (HE.name, CHOUDHURY.name, DEADBAND.name)  # the same all along the record
_MOMENTS = ("start", "end", "lasting")
_LIMIT = "limit"
_PLANT_UNITS = {"K": "PV/OP", "tau": "s", "tau2": "s", "tau3": "s", "theta": "s", "damping": "ratio"}


def _effect_of(effect: Believed, final: Fit) -> Effect:
    """A believed effect as it stands in the final fit."""
    part = next(p for p in final.parts if p.block.name == effect.contender.block.name)
    mask = active_mask(final, part)
    windows = windows_along(final.record, mask) if part.block.active is not None else whole(final.record)
    return Effect(
        code=effect.code,
        alternatives=effect.alternatives,
        probability=probability_of(effect),
        place=part.block.place,
        parameters=estimates(final, part),
        windows=windows,
        condition=part.block.condition,
        evidence=_evidence_of(effect, final),
        gain=effect.gain,
    )


def effects_of(effect: Believed, final: Fit) -> tuple[Effect, ...]:
    """The effect, and those that its block stands for as well."""
    first = _effect_of(effect, final)
    return (first, *(replace(first, code=code, alternatives=()) for code in effect.contender.block.brings))


def probability_of(effect: Believed) -> float:
    """That the name, or one of its alternatives, is right: from the margin over the next name and over nothing at all,
    and no more than what it leaves unexplained allows.
    """
    beyond = effect.gain - effect.contender.block.penalty  # beside its partner: alone it may have gained nothing
    if effect.contender.over.parts:
        beyond += hidden_gain(effect.contender)  # it was believed for that as well
    presence = 1.0 / (1.0 + np.exp(-np.clip(beyond, -30.0, 30.0)))
    name = 1.0 / (1.0 + np.exp(-np.clip(effect.margin, -30.0, 30.0)))
    own = effect.contender.fit.given.own
    return float(min(presence * name, OWN_CERTAIN if own else CERTAIN, effect.most))


def _evidence_of(effect: Believed, final: Fit) -> tuple[Reason, ...]:
    said = [
        Reason(
            "likelihood",
            f"adds {effect.gain:.1f} points of log-likelihood; {effect.contender.block.penalty:.1f} are required",
        )
    ]
    if np.isfinite(effect.margin):
        said.append(Reason("margin", f"the next candidate is {effect.margin:.1f} points behind"))
    rmse = float(np.sqrt(np.mean(final.residual[final.record.usable] ** 2)))
    said.append(
        Reason(
            "residual",
            f"the free run leaves a residual of {rmse:.4g} (root mean square, unit of PV) over the whole record",
        )
    )
    return (*said, *effect.left)


def pattern_effect(pattern: Pattern, record: Experiment) -> Effect:
    block = pattern.part.block
    context = Context(record, _UNUSED_PLANT)
    known = block.parameters(context)
    values = _absolute(known, pattern.part.values, record)
    parameters = tuple(_pattern_estimate(p, value, record, pattern) for p, value in zip(known, values, strict=True))
    windows = windows_along(record, pattern.shows)
    return Effect(
        block.code,
        pattern.alternatives,
        min(CERTAIN, pattern.most),
        block.place,
        parameters,
        windows,
        block.condition,
        (pattern.reason,),
        float(pattern.shows.sum()),
    )


def _pattern_estimate(parameter: Parameter, value: float, record: Experiment, pattern: Pattern) -> Estimate:
    """A size of what PV shows by itself, as closely as PV was kept: a limit to half of its last decimal, a moment to
    the sample before; the width of a historian as far as PV tells it.
    """
    if pattern.width is not None:
        return Estimate(parameter.name, value, pattern.width.low, pattern.width.high, _plain_unit(parameter))
    sooner = record.sampling_interval_s if parameter.name in BETWEEN_SAMPLES else 0.0
    rounded = 0.5 * decimals_of(record.pv[record.usable]) if parameter.name == _LIMIT else 0.0
    return Estimate(parameter.name, value, value - sooner - rounded, value + rounded, _plain_unit(parameter))


def _plain_unit(parameter: Parameter) -> str:
    return parameter.unit.removesuffix(" level")


def _absolute(parameters: tuple[Parameter, ...], values: FloatArray, record: Experiment) -> list[float]:
    """Levels with the record's means added; all else as it is."""
    mids = {"OP level": record.op_mid, "PV level": record.pv_mid}
    return [float(v + mids.get(p.unit, 0.0)) for p, v in zip(parameters, values, strict=True)]


def estimates(found: Fit, part: Part) -> tuple[Estimate, ...]:
    """A part's parameters with 95 % intervals; S and J for stiction, and where a stem began."""
    spread = deviations(found)
    index = next(k for k, p in enumerate(found.parts) if p is part)
    mids = {"OP level": found.record.op_mid, "PV level": found.record.pv_mid}
    said, sticks = [], part.block.code == STICTION  # whose sizes are tried together
    for p in part.block.parameters(Context(found.record, found.given.plant)):
        bends = p.name in _MOMENTS or (part.block.rough and not (p.linear or sticks))
        ends = interval_tried if bends else interval
        said.append(ends(found, f"{index}.{p.name}", mids.get(p.unit, 0.0), _plain_unit(p), p.name, spread))
    if sticks:
        said[:3] = size_of_stiction(found, index)
    elif said and said[-1].name == STEM_START:
        # Half of a band, or of the share of it that a growing one began with.
        reach = 1.0 if said[-1].unit == "OP" else 0.5 * float(np.prod([estimate.value for estimate in said[:-1]]))
        said[-1] = _scaled(said[-1], float(found.record.op[0]), reach, "OP")
    if part.block.name in _OF_ONE_STEM:
        said[0] = between_samples_too(said[0], found.record.as_sampled)
    return tuple(said)


def _scaled(share: Estimate, zero: float, whole: float, unit: str) -> Estimate:
    """A share of a whole as a quantity: zero + share * whole."""
    value, low, high = (zero + whole * number for number in (share.value, share.low, share.high))
    return Estimate(share.name, value, low, high, unit)


def refit_estimates(base: Fit) -> tuple[Estimate, ...]:
    """The simulation's own parameters after the refit, with 95 % intervals."""
    spread = deviations(base)
    names = [f.name for f in base.free if f.name in _PLANT_UNITS]
    units = _PLANT_UNITS | ({"K": "PV/OP/s"} if base.plant.leak == 0.0 else {})
    return tuple(interval(base, name, 0.0, units[name], name, spread) for name in names)


def location_of(effects: tuple[Effect, ...]) -> Location:
    """Where the strongest effect acts."""
    if not effects:
        return NOWHERE
    first = effects[0]
    period = next((p.value for p in first.parameters if p.name == "period"), None)
    return Location(
        first.place, first.windows, first.condition, None if period is None else 1.0 / period, first.evidence
    )


def export(found: Fit, sensors: tuple[Part, ...]) -> ExplainedModel:
    """The explained model, enough to simulate again."""
    p, record = found.plant, found.record.as_sampled
    fields = ("K", "tau", "theta", "b", "x0", "tau2", "leak", "tau3", "zero", "damping", "speed0")
    parts = tuple(
        PartModel(part.block.name, part.block.code, tuple(part.values.tolist())) for part in (*found.parts, *sensors)
    )
    return ExplainedModel(
        record.sampling_interval_s,
        record.op_mid,
        record.pv_mid,
        record.op_span,
        record.pv_span,
        tuple((name, float(getattr(p, name))) for name in fields),
        parts,
        tuple(name for name, _ in record.measured),
        tuple(record.rest.tolist()) if np.any(record.rest != 0.0) else (),
        record.reference_duration_s,
        tuple(mid for _, mid in record.middles),
        record.fed_back,
    )
