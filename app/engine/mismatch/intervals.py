"""How well a record tells the fitted numbers: 95 % intervals, by slopes where the simulation is smooth, by trying other
sizes where it jumps with them.
"""

import numpy as np

from app.engine.mismatch.fitting import Fit, orthonormal, projected_cost, residual_rows, slopes, task_of
from app.engine.mismatch.result import Estimate
from app.engine.mismatch.task import clipped
from app.engine.recording import FloatArray

CHI2_95 = 3.84
WEAKENED = 24.0
"""By how much less the cost of other sizes of stiction counts than if the model were the truth: the least cost is the
best of many narrow ones, one for each sample at which a stem could have slipped. Measured: docs/PROOF.md."""
S_MOVES = np.geomspace(2e-4, 0.7, 22)  # of ln S
SHARE_MOVES = np.array([0.01, 0.03, 0.07, 0.15, 0.3, 0.6])  # of J / S


def deviations(found: Fit) -> FloatArray:
    """Standard deviation of each free number of a fit, from its whitened slopes; infinite where nothing hangs on it."""
    task = task_of(found)
    jacobian = slopes(task, found.x, found.noise, residual_rows(task, found.x, found.noise))
    information = jacobian.T @ jacobian
    covariance = np.linalg.pinv(information, rcond=1e-12)
    return np.where(np.diag(information) > 0.0, np.sqrt(np.maximum(np.diag(covariance), 0.0)), np.inf)


def interval(found: Fit, name: str, shift: float, unit: str, label: str, spread: FloatArray) -> Estimate:
    k = [f.name for f in found.free].index(name)
    f, x = found.free[k], float(found.x[k])
    low, high = (f.value(float(np.clip(x + side * 1.96 * spread[k], f.low, f.high))) for side in (-1.0, 1.0))
    return Estimate(label, f.value(x) + shift, min(low, high) + shift, max(low, high) + shift, unit)


def size_of_stiction(found: Fit, S: str, share: str) -> tuple[Estimate, Estimate]:
    """S and J of a stem that sticks, unit of OP, over the sizes that explain the record nearly as well; S, share: names
    of the fitted numbers. Slopes say nothing of them: between two sizes at which a slip falls into another sample
    nothing changes, and there everything does.

    Sizes are tried on a grid around the fitted one, all other numbers following along their slopes.
    """
    names = [f.name for f in found.free]
    tried = [names.index(S), names.index(share)]
    task = task_of(found)
    at = residual_rows(task, found.x, found.noise)
    others = [k for k in range(len(names)) if k not in tried]
    basis = orthonormal(slopes(task, found.x, found.noise, at, others))
    allowed = projected_cost(at.rows, basis) + CHI2_95 * WEAKENED
    sizes = [size_at(found, found.x, tried)]
    for moves in around():
        x = found.x.copy()
        x[tried] += moves
        x = clipped(task, x)
        if projected_cost(residual_rows(task, x, found.noise).rows, basis) <= allowed:
            sizes.append(size_at(found, x, tried))
    low, high = np.min(sizes, axis=0), np.max(sizes, axis=0)
    first, second = (Estimate(n, sizes[0][k], float(low[k]), float(high[k]), "OP") for k, n in enumerate(("S", "J")))
    return first, second


def size_at(found: Fit, x: FloatArray, tried: list[int]) -> tuple[float, float]:
    """S and J at coordinates x (P,)."""
    S, share = (found.free[k].value(float(x[k])) for k in tried)
    return S, S * share


def around() -> FloatArray:
    """(M, 2) moves of ln S and J / S about a fitted size."""
    both = [np.concatenate((-moves[::-1], [0.0], moves)) for moves in (S_MOVES, SHARE_MOVES)]
    return np.stack(np.meshgrid(*both, indexing="ij"), axis=-1).reshape(-1, 2)
