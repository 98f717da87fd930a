"""What a free run leaves of PV on samples that its fit has not seen: whether its innovations are white, and whether
they owe anything to OP. A model that lacks nothing leaves neither.

Only the noise model, four poles and zeros, has seen them too: fitted on the others alone, its own errors look like
something left (11 of 100 records of noise alone were not white). What it takes is taken off the degrees of freedom.

Sources: Ljung, Box 1978, doi 10.1093/biomet/65.2.297 (whiteness); Haugh 1976, doi 10.1080/01621459.1976.10480353
(independence of two series, each whitened by itself); Ljung, System Identification, 1999, chapter 16.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, chdtri

from app.engine.mismatch.fit.noise import autocovariances, autoregression, compared_samples, fit_noise, whiten
from app.engine.recording import BoolArray, FloatArray, IntArray

_LAGS = 20
_LEAST_A_LAG = 5
_OP_ORDER = 12
_CHANCE = 0.05
_NOISE_NUMBERS = 2.0
"""So many degrees of freedom the noise model takes of the record it is fitted to: of 6300 records of a load behind a
lag under white noise, 400 to 5000 samples, 30 % held out, 5.1 % were not white; with none 4.4 %, with four 5.9 %."""


@dataclass(frozen=True)
class LagsTest:
    """Squared correlations over some lags, against chi-square. limit: what chance exceeds in one record of twenty."""

    statistic: float
    limit: float
    p_value: float
    lags: int

    @property
    def passed(self) -> bool:
        return self.statistic <= self.limit


@dataclass(frozen=True)
class ResidualTests:
    """whiteness: of the innovations among themselves. independence: of the innovations from OP before them; None where
    OP stood still there.
    """

    whiteness: LagsTest
    independence: LagsTest | None


def residual_tests(
    residual: FloatArray, op: FloatArray, usable: BoolArray, held: BoolArray, late: int = 0
) -> ResidualTests | None:
    """The tests over the innovations of the samples `held` (N,) under the noise model of all usable ones; None where
    they are too few or nothing is left.

    residual: (N,) PV less a free run. op: (N,). late: samples until OP shows in PV; independence is asked over so many
    lags more. Only OP before PV is asked: at lag zero a controller answers PV.
    """
    seen, lags = usable | held, _LAGS + late
    compared = compared_samples(seen)
    asked = held & compared
    at = np.flatnonzero(asked)
    if len(at) < _LEAST_A_LAG * lags:
        return None
    e = np.where(asked, whiten(residual, seen, fit_noise(residual, seen)), 0.0)
    if not np.any(e):
        return None
    share = len(at) / int(np.sum(compared))
    return ResidualTests(white(e, at, _NOISE_NUMBERS * share), _independent(e, op, at, lags))


def white(e: FloatArray, at: IntArray, taken: float) -> LagsTest:
    """Ljung and Box's test of innovations (N,) at the samples `at`; zero elsewhere. taken: degrees of freedom that the
    noise model took there.
    """
    count, lags = len(at), np.arange(1, _LAGS + 1)
    squares = (_lagged_products(e, e, at, lags) / np.sum(e[at] ** 2)) ** 2
    return _against_chance(count * (count + 2.0) * float(np.sum(squares / (count - lags))), _LAGS, taken)


def _independent(e: FloatArray, op: FloatArray, at: IntArray, lags: int) -> LagsTest | None:
    """Haugh's test of innovations (N,) at the samples `at` on the whitened moves of OP one to `lags` samples before;
    None where OP stood still there.

    Each product is held against what OP moved so many samples before: it may be livelier before the samples asked than
    among them. A lag at which it stood tells nothing, and is no degree of freedom.
    """
    moves = np.diff(op, prepend=op[0])
    largest = float(np.max(np.abs(moves)))
    if largest == 0.0:
        return None
    moves = moves / largest
    a = np.convolve(moves, np.concatenate(([1.0], -autoregression(autocovariances(moves, _OP_ORDER)))))[: len(op)]
    energy = np.array([np.sum(a[_before(at, lag)] ** 2) for lag in range(1, lags + 1)])
    told = energy > 0.0
    if not np.any(told):
        return None
    squares = _lagged_products(e, a, at, 1 + np.flatnonzero(told)) ** 2 / (np.sum(e[at] ** 2) * energy[told])
    return _against_chance(len(at) * float(np.sum(squares)), int(np.sum(told)))


def _lagged_products(now: FloatArray, then: FloatArray, at: IntArray, lags: IntArray) -> FloatArray:
    """(lags,) sums of the products of one series (N,) at the samples `at` with another (N,) so many samples before."""
    return np.array([now[at[at >= lag]] @ then[_before(at, lag)] for lag in lags])


def _before(at: IntArray, lag: int) -> IntArray:
    """The samples `lag` before the samples `at`, as far as the record has them."""
    return at[at >= lag] - lag


def _against_chance(statistic: float, lags: int, taken: float = 0.0) -> LagsTest:
    freedom = lags - taken
    return LagsTest(statistic, float(chdtri(freedom, _CHANCE)), float(chdtrc(freedom, statistic)), lags)
