"""How well a record tells the fitted numbers: 95 % intervals by slopes, where the simulation is smooth."""

import numpy as np

from app.engine.mismatch.fit.fitting import Fit, residual_rows, slopes, task_of
from app.engine.mismatch.judge.result import Estimate
from app.engine.recording import FloatArray


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
