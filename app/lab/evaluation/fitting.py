"""Fits the verdict's shape model: a sign-constrained ridge logistic and small networks, weighted by valve."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from app.engine.features import NAMES
from app.engine.recording import FloatArray, IntArray
from app.engine.verdict.shape_model import ShapeModel

TextArray = NDArray[np.str_]

# The sign that physics gives each feature of the logistic, fixed before anything was fitted; the others stay out.
SIGNS = {
    "ccf_odd": 1, "op_dpv": 1, "loop_area": 1, "op_pv_direction": 1, "pv_direction": 1, "coherence_odd": 1,
    "odd_share": 1, "phase_sine": 1, "misfit_drop": 1, "causal_drop": 1, "sticking": 1, "sticking_fine": 1,
    "leg_still": 1, "leg_contrast": 1, "flat_eighth": 1, "flat_quarter": 1, "pv_moves_alone": -1,
    "together_eighth": -1, "together_quarter": -1, "gain": 1, "causal_gain": 1, "causal_sticky": 1, "held_sticky": 1,
    "held_gain": 1, "S_share": 1, "integral_share": 1, "op_kurtosis": -1, "pv_kurtosis": -1, "op_slope_kurtosis": -1,
    "op_bursts": -1, "op_fundamental": 1, "op_fast": -1, "op_slow": -1, "op_triangle": 1, "op_skewness": -1,
    "op_roughness": -1, "pv_roughness": -1, "pv_bicoherence": 1, "pv_quantum": -1,
    "pv_moves_at_limit": -1, "op_at_limit": -1, "oscillation_strength": 1, "oscillation_regularity": 1,
    "leg_size_spread": -1, "leg_time_spread": -1, "swing_spread": -1, "path": 1, "path_slope": 1,
}  # fmt: skip
# How often a sample repeats is the historian's doing; simulated loops have no historian.
_NOT_FOR_NETWORK = ("pv_held", "op_held", "pv_least_step")
CLIP = 3.0
_WEIGHT_OF_ALL = 60.0


@dataclass(frozen=True)
class FitConfig:
    """ridge: penalty of the logistic, for a sample as heavy as 60 recordings. decay: of the networks' weights.

    hidden, networks, steps, batch, rate: size and training of the networks. real_share: weight of the recordings
    against the simulated loops in them.
    """

    ridge: float = 20.0
    decay: float = 0.02
    hidden: int = 8
    networks: int = 4
    steps: int = 300
    batch: int = 512
    rate: float = 0.02
    real_share: float = 0.6


@dataclass(frozen=True, eq=False)
class Samples:
    """values: (n, F) features; sticky: (n,) 0 or 1; weight: (n,), each class adding up to 1."""

    values: FloatArray
    sticky: IntArray
    weight: FloatArray

    def part(self, rows: NDArray[np.bool_]) -> "Samples":
        return Samples(self.values[rows], self.sticky[rows], class_weights(self.weight[rows], self.sticky[rows]))


def class_weights(weight: FloatArray, sticky: IntArray) -> FloatArray:
    """The weights with each class scaled to add up to 1."""
    total = np.bincount(sticky, weights=weight, minlength=2)
    return weight / total[sticky]


def valve_weights(valves: TextArray, sticky: IntArray, trust: FloatArray | float = 1.0) -> FloatArray:
    """(n,) a valve counts once times its label's trust, however many recordings it has; both classes count alike."""
    _, valve, count = np.unique(valves, return_inverse=True, return_counts=True)
    return class_weights(trust / count[valve], sticky)


def resembling_weights(simulated: Samples, real: FloatArray) -> Samples:
    """The simulated loops, weighted towards those that look like recordings (labels are not looked at).

    A logistic that tells recordings from simulated loops gives the density ratio, bounded to 0.05..10.
    """
    values = np.concatenate((real, simulated.values))
    centre, scale = real.mean(axis=0), real.std(axis=0) + 1e-9
    z = np.clip((values - centre) / scale, -CLIP, CLIP)
    is_real = np.concatenate((np.ones(len(real), int), np.zeros(len(simulated.values), int)))
    weight = class_weights(np.ones(len(z)), is_real)
    slope, intercept = _logistic(z, is_real, weight, 20.0, free=True)
    ratio = np.exp(np.clip(z[len(real) :] @ slope + intercept, np.log(0.05), np.log(10.0)))
    return Samples(simulated.values, simulated.sticky, class_weights(ratio * simulated.weight, simulated.sticky))


def fit(real: Samples, simulated: Samples, config: FitConfig, seed: int = 0) -> ShapeModel:
    """The model, not yet calibrated (calibration needs valves that it has not seen)."""
    centre, scale = simulated.values.mean(axis=0), simulated.values.std(axis=0) + 1e-9
    z = np.clip((real.values - centre) / scale, -CLIP, CLIP)
    signs = np.array([SIGNS.get(name, 0) for name in NAMES], dtype=float)
    slope, intercept = _logistic(z * signs, real.sticky, real.weight, config.ridge, free=False)
    z_simulated = np.clip((simulated.values - centre) / scale, -CLIP, CLIP)
    both = Samples(
        np.concatenate((z_simulated, z)),
        np.concatenate((simulated.sticky, real.sticky)),
        np.concatenate(((1 - config.real_share) * simulated.weight, config.real_share * real.weight)),
    )
    networks = [_network(both, config, seed + k) for k in range(config.networks)]
    return ShapeModel(
        centre=centre,
        scale=scale,
        clip=CLIP,
        slope=slope * signs,
        intercept=intercept,
        hidden=np.array([network[0] for network in networks]),
        hidden_bias=np.array([network[1] for network in networks]),
        out=np.array([network[2] for network in networks]),
        out_bias=np.array([float(network[3][0]) for network in networks]),
        calibration=(1.0, 0.0),
    )


def platt(log_odds: FloatArray, sticky: IntArray, weight: FloatArray, against: FloatArray) -> tuple[float, float]:
    """Slope and intercept of the calibrated log-odds (Platt 1999), a little ridge keeping the slope finite.

    against: (n,) what rivals take from the calibrated log-odds. The stated probability has lost it, so that it is
    what has to be calibrated: without, sticky valves come out less likely than they are.
    """
    slope, intercept = _logistic(log_odds[:, None], sticky, weight, 0.5, free=False, offset=-against)
    return float(slope[0]), intercept


def _logistic(
    z: FloatArray, sticky: IntArray, weight: FloatArray, ridge: float, *, free: bool, offset: FloatArray | float = 0.0
) -> tuple[FloatArray, float]:
    """Ridge logistic; without `free` no slope is negative. offset: (n,) added to the log-odds, not fitted."""
    weight = weight / weight.sum() * _WEIGHT_OF_ALL
    columns = np.column_stack((z, np.ones(len(z))))

    def loss(b: FloatArray) -> tuple[float, FloatArray]:
        e = columns @ b + offset
        probability = 1.0 / (1.0 + np.exp(-np.clip(e, -40, 40)))
        gradient = columns.T @ (weight * (probability - sticky))
        gradient[:-1] += ridge * b[:-1]
        value = float(weight @ (np.logaddexp(0.0, e) - sticky * e)) + 0.5 * ridge * float(b[:-1] @ b[:-1])
        return value, gradient

    bounds = [(None if free else 0.0, None)] * z.shape[1] + [(None, None)]
    found = minimize(loss, np.zeros(columns.shape[1]), jac=True, method="L-BFGS-B", bounds=bounds)
    return found.x[:-1], float(found.x[-1])


def _network(samples: Samples, config: FitConfig, seed: int) -> list[FloatArray]:
    """One network trained by Adam (Kingma, Ba 2015): hidden weights, hidden biases, output weights, output bias."""
    rng = np.random.default_rng(seed)
    used = np.array([name not in _NOT_FOR_NETWORK for name in NAMES], dtype=float)
    z = samples.values * used
    features = z.shape[1]
    weights = [
        rng.normal(size=(features, config.hidden)) / np.sqrt(features) * used[:, None],
        np.zeros(config.hidden),
        rng.normal(size=config.hidden) / np.sqrt(config.hidden),
        np.zeros(1),
    ]
    mean, square = [np.zeros_like(w) for w in weights], [np.zeros_like(w) for w in weights]
    chance = np.cumsum(samples.weight) / samples.weight.sum()
    for step in range(1, config.steps + 1):
        rows = np.searchsorted(chance[:-1], rng.random(config.batch))
        rate = config.rate * (1.0 - step / config.steps) + 1e-4
        for k, gradient in enumerate(_gradients(weights, z[rows], samples.sticky[rows], config.decay)):
            mean[k] = 0.9 * mean[k] + 0.1 * gradient
            square[k] = 0.999 * square[k] + 0.001 * gradient**2
            change = mean[k] / (1 - 0.9**step) / (np.sqrt(square[k] / (1 - 0.999**step)) + 1e-8)
            weights[k] = weights[k] - rate * change
    return weights


def _gradients(weights: list[FloatArray], z: FloatArray, sticky: IntArray, decay: float) -> list[FloatArray]:
    hidden = np.tanh(z @ weights[0] + weights[1])
    answer = hidden @ weights[2] + weights[3]
    error = (1.0 / (1.0 + np.exp(-np.clip(answer, -40, 40))) - sticky) / len(z)
    back = np.outer(error, weights[2]) * (1.0 - hidden**2)
    return [
        z.T @ back + decay * weights[0],
        back.sum(axis=0),
        hidden.T @ error + decay * weights[2],
        np.array([error.sum()]),
    ]
