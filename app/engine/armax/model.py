"""What an ARMAX search asks and answers: A(q) y = B(q) v + C(q) e with at least one sample of delay in B."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from app.engine.recording import FloatArray, IntArray
from app.errors import RequestError

Criterion = Literal["paper", "log"]
Stages = Literal[2, 3]

LARGEST_ORDER = 50


def mean_of(v: FloatArray) -> FloatArray:
    """Means (...) of v (..., N); of a v that never moves its very value, so that nothing is left of it. What rounding
    would leave is the same at each sample, as an intercept is, and is fitted or not by the last bit.
    """
    return np.where((v != v[..., :1]).any(axis=-1), v.mean(axis=-1), v[..., 0])


@dataclass(frozen=True)
class Order:
    """Orders: A = 1 + a_1 q^-1 + .. + a_na q^-na, B = b_1 q^-1 + .. + b_nb q^-nb, C = 1 + .. + c_nc q^-nc."""

    na: int
    nb: int
    nc: int

    @property
    def parameters(self) -> int:
        """dM of eq 7: the number of estimated coefficients."""
        return self.na + self.nb + self.nc


@dataclass(frozen=True)
class SearchSpace:
    """All orders 1..na_max x 1..nb_max x nc_min..nc_max. nc_min = 0 adds the models without a noise polynomial (ARX).

    Raises RequestError("search_space") where a bound is out of 1..50 or nc_min is neither 0 nor 1.
    """

    na_max: int
    nb_max: int
    nc_max: int
    nc_min: int = 1

    def __post_init__(self) -> None:
        bounds = (self.na_max, self.nb_max, self.nc_max)
        if not all(1 <= bound <= LARGEST_ORDER for bound in bounds) or self.nc_min not in (0, 1):
            raise RequestError("search_space", f"orders must be 1 to {LARGEST_ORDER}, nc from 0 or 1; got {self}")

    @property
    def orders(self) -> int:
        return self.na_max * self.nb_max * (self.nc_max - self.nc_min + 1)

    @property
    def largest(self) -> int:
        return max(self.na_max, self.nb_max, self.nc_max)


@dataclass(frozen=True, eq=False)
class OrderSearch:
    """The order with the least AIC for each of M valve positions, with its coefficients.

    na, nb, nc: (M,). aic: (M,) the criterion's least value. rmse: (M,) root mean square of the one-step prediction
    error of the chosen model over the samples first_sample..N-1, in the unit of y. a, b, c: (M, na_max), (M, nb_max),
    (M, nc_max) coefficients, zero beyond the chosen order. first_sample: the sample from which every model of the
    search is judged. long_order: order of the long autoregression that gave the innovations.
    """

    space: SearchSpace
    criterion: Criterion
    na: IntArray
    nb: IntArray
    nc: IntArray
    aic: FloatArray
    rmse: FloatArray
    a: FloatArray
    b: FloatArray
    c: FloatArray
    first_sample: int
    long_order: int

    def order(self, m: int) -> Order:
        """The order chosen at grid point m."""
        return Order(int(self.na[m]), int(self.nb[m]), int(self.nc[m]))


@dataclass(frozen=True, eq=False)
class ArmaxModel:
    """An ARMAX model fitted by prediction-error minimisation, on deviations from the mean.

    a, b, c: (na,), (nb,), (nc,) coefficients; C is stable. rmse: root mean square one-step prediction error over the
    samples first_sample..N-1, in the unit of y. aic_paper, aic_log: eq 7 and Ljung's form over the same samples.
    converged: whether the last step changed the sum of squares by less than the tolerance. iterations: steps taken.
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    rmse: float
    aic_paper: float
    aic_log: float
    converged: bool
    iterations: int
    first_sample: int

    @property
    def order(self) -> Order:
        return Order(len(self.a), len(self.b), len(self.c))

    def rescaled(self, y_scale: float, v_scale: float) -> "ArmaxModel":
        """The same model of y times y_scale and v times v_scale, both above 0: what it was fitted to, in other units.

        The error grows with y. Ljung's form of the AIC, its logarithm, is shifted; in eq 7 the error counts against a
        penalty that stays, so that there it depends on the unit which order is best.
        """
        grown = y_scale**2 - 1.0
        return replace(
            self,
            b=self.b * (y_scale / v_scale),
            rmse=self.rmse * y_scale,
            aic_paper=self.aic_paper + grown * self.rmse**2,
            aic_log=self.aic_log + 2.0 * math.log(y_scale),
        )
