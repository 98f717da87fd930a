"""Exact fits: the least sum of squared one-step prediction errors of one ARMAX order."""

import numpy as np

from app.engine.armax.kernel import SMALLEST_RESIDUAL, criterion_value
from app.engine.armax.minimise import TOLERANCE, minimise
from app.engine.armax.model import ArmaxModel, Order, OrderSearch, mean_of
from app.engine.armax.predict import prediction_errors
from app.engine.armax.search import estimate_order
from app.engine.recording import FloatArray

STEPS = 100


def refine(
    y: FloatArray,
    v: FloatArray,
    order: Order,
    start: OrderSearch | None = None,
    point: int = 0,
    steps: int = STEPS,
    tolerance: float = TOLERANCE,
) -> ArmaxModel:
    """The ARMAX model of one order with the least sum of squared one-step prediction errors, from a good start.

    y: (N,) process output. v: (N,) valve position. Any unit; both are taken as deviations from their mean.
    start, point: the search of the same y and v and its grid point of this order, whose coefficients begin, and over
    whose samples the errors are judged; without it a search of this order alone. steps: most Levenberg-Marquardt steps.
    tolerance: relative change of the sum of squares that ends it.
    The errors before sample max(na, nb) are taken as 0, so this is conditional maximum likelihood for Gaussian e.
    Raises what `search_orders` raises. Misleads: a sum of squares may have several minima; the one next to the start is
    found. Source: Ljung, System Identification, 1999, chapter 10.
    """
    if start is None:
        start = estimate_order(y, v[None, :], order)
    a, b, c = (x[point, :n].copy() for x, n in ((start.a, order.na), (start.b, order.nb), (start.c, order.nc)))
    y, v, errors = y - y.mean(), v - mean_of(v), np.empty(len(y))
    prediction_errors(y, v, a, b, c, errors)
    total, taken, converged = minimise(y, v, a, b, c, errors, start.first_sample, steps, tolerance)
    samples = len(y) - start.first_sample
    total = max(total, SMALLEST_RESIDUAL * float(y @ y))
    return ArmaxModel(
        a=a,
        b=b,
        c=c,
        rmse=float(np.sqrt(total / samples)),
        aic_paper=float(criterion_value(total, samples, order.parameters, False)),
        aic_log=float(criterion_value(total, samples, order.parameters, True)),
        converged=bool(converged),
        iterations=int(taken),
        first_sample=start.first_sample,
    )
