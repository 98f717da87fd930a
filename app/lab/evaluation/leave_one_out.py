"""Leave one valve out: every recording judged by a model that has seen nothing of its valve."""

from dataclasses import dataclass

import numpy as np

from app.engine.features import extract
from app.engine.oscillation import detect
from app.engine.recording import BoolArray, FloatArray, IntArray
from app.engine.verdict.shape_model import ShapeModel
from app.lab.evaluation.fitting import (
    FitConfig,
    Samples,
    TextArray,
    class_weights,
    fit,
    platt,
    resembling_weights,
    valve_weights,
)
from app.lab.testbench.known_loops import known_loops


@dataclass(frozen=True, eq=False)
class Table:
    """Features (n, F) of n recordings with their valves (n,), their labels (n,) and what these count in a fit (n,)."""

    values: FloatArray
    valves: TextArray
    sticky: IntArray
    trust: FloatArray

    def samples(self) -> Samples:
        """All recordings, ready to be fitted."""
        return Samples(self.values, self.sticky, valve_weights(self.valves, self.sticky, self.trust))


def fit_of(table: Table, kept: BoolArray, simulated: Samples, config: FitConfig) -> ShapeModel:
    """Of the recordings that are kept (n,) alone: the simulated loops are weighted by what looks like these."""
    real = table.samples().part(kept)
    return fit(real, resembling_weights(simulated, real.values), config)


def calibration_of(
    table: Table, raw: FloatArray, against: FloatArray, without: tuple[str, ...] = ()
) -> tuple[float, float]:
    """From the raw log-odds of all valves but those left out."""
    kept = ~np.isin(table.valves, without)
    valves, sticky = table.valves[kept], table.sticky[kept]
    return platt(raw[kept], sticky, valve_weights(valves, sticky), against[kept])


def simulated_samples(count: int, seed: int) -> Samples:
    """Features of `count` simulated loops, each of one window."""
    values, sticky = [], []
    for loop in known_loops(count, seed):
        features = extract(loop.record, detect(loop.record), most_windows=1)
        if features is not None:
            values.append(features.values)
            sticky.append(loop.cause == "stiction")
    labels = np.array(sticky, dtype=np.int64)
    return Samples(np.array(values), labels, class_weights(np.ones(len(labels)), labels))


def by_valve(valves: TextArray, values: FloatArray) -> tuple[TextArray, FloatArray]:
    """Valves (V,) and the mean of `values` (n,) over the recordings of each."""
    names, valve = np.unique(valves, return_inverse=True)
    return names, np.bincount(valve, weights=values) / np.bincount(valve)
