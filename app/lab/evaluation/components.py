"""Scores of each component of the verdict alone, and of the published rule beside it."""

import numpy as np

from app.engine.corroborate import corroborate
from app.engine.long_records.stretches import NEWEST_SAMPLES, newest
from app.engine.recording import FloatArray
from app.engine.reference import published_rule
from app.engine.reference.reliability import climb
from app.engine.verdict.shape_model import ShapeModel
from app.errors import DataError
from app.lab.evaluation.fitting import SIGNS
from app.lab.evaluation.recordings import Labelled

_SHOWN = ("ccf_odd", "op_dpv", "loop_area", "sticking", "leg_still", "flat_eighth", "gain", "causal_gain", "held_gain",
          "op_kurtosis", "op_fundamental", "op_fast", "op_triangle", "pv_bicoherence", "pv_roughness", "integral_share",
          "oscillation_strength", "oscillation_regularity")  # fmt: skip


def component_scores(
    loops: list[Labelled], models: dict[str, ShapeModel], reference: bool
) -> list[tuple[str, FloatArray]]:
    """(name, (n,) scores, NaN where the component does not apply); higher speaks for stiction."""
    logistic = [None if x.features is None else float(models[x.valve].logistic_part(x.features.values)) for x in loops]
    network = [None if x.features is None else float(models[x.valve].network_part(x.features.values)) for x in loops]
    scores = [("shape logistic", _array(logistic)), ("shape networks", _array(network))]
    for name in _SHOWN:
        values = [None if x.features is None else SIGNS[name] * x.features.named(name) for x in loops]
        scores.append((name, _array(values)))
    scores.extend(_methods(loops))
    if reference:
        scores.extend(_published(loops))
    return scores


def _methods(loops: list[Labelled]) -> list[tuple[str, FloatArray]]:
    """The published detection methods, each where it applies."""
    said: dict[str, list[float | None]] = {}
    for k, loop in enumerate(loops):
        if loop.features is None or loop.oscillation is None or loop.fitness.record is None:
            continue
        integrating = loop.recording.integrating
        for answer in corroborate(loop.fitness.record, loop.oscillation, integrating):
            said.setdefault(answer.method, [None] * len(loops))[k] = answer.statistic
    return [(f"method: {name}", _array(values)) for name, values in said.items()]


def _published(loops: list[Labelled]) -> list[tuple[str, FloatArray]]:
    yper, rule = [], []
    for loop in loops:
        try:
            found = None if loop.fitness.record is None else climb(newest(loop.fitness.record, NEWEST_SAMPLES))
        except DataError:
            found = None
        yper.append(None if found is None else found.yper.yper_pct)
        rule.append(None if found is None else published_rule.judge(found).stiction_probability)
    return [("Yper, unit standard deviation", _array(yper)), ("published rule", _array(rule))]


def _array(values: list[float | None]) -> FloatArray:
    return np.array([np.nan if value is None else float(value) for value in values])
