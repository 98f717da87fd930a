"""Leave one group out: every recording judged by a model that has seen no valve of its source, or of its industry."""

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from app.engine.recording import BoolArray, FloatArray
from app.engine.verdict.shape_model import ShapeModel
from app.lab.evaluation.fitting import FitConfig, Samples, TextArray
from app.lab.evaluation.leave_one_out import Table, calibration_of, fit_of
from app.lab.evaluation.recordings import Labelled


def groups_of(loops: list[Labelled]) -> dict[str, dict[str, str]]:
    """By what is left out, the group of each valve. The database of stiction names recordings by their industry
    (CHEM1, PAP2), others do by where they are from."""
    return {
        "whole sources": {loop.valve: loop.source for loop in loops},
        "whole industries, as names begin": {loop.valve: _letters(loop.recording.name) for loop in loops},
    }


def models_without(
    groups: Mapping[str, str], table: Table, against: FloatArray, simulated: Samples, config: FitConfig
) -> dict[str, ShapeModel]:
    """By valve, the calibrated model that has seen none of its group. groups: the group of each valve."""
    group = np.array([groups[valve] for valve in table.valves])
    models = {one: _without(group == one, table, against, simulated, config) for one in np.unique(group)}
    return {valve: models[one] for valve, one in groups.items() if one in models}


def _without(
    left_out: BoolArray, table: Table, against: FloatArray, simulated: Samples, config: FitConfig
) -> ShapeModel:
    """left_out: (n,). The calibration needs valves that its model has not seen: one more is left out for each."""
    raw = np.zeros(len(left_out))
    for valve in np.unique(table.valves[~left_out]):
        own = table.valves == valve
        raw[own] = fit_of(table, ~left_out & ~own, simulated, config).raw_log_odds(table.values[own])
    without: TextArray = np.unique(table.valves[left_out])
    calibration = calibration_of(table, raw, against, without=tuple(without))
    return replace(fit_of(table, ~left_out, simulated, config), calibration=calibration)


def _letters(name: str) -> str:
    found = re.match(r"[^\W\d_]*", name)
    return found[0] if found else ""
