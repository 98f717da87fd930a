"""Hammerstein identification: OP through a grid of valves, an ARMAX model behind each; the least RMSE answers."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from app.engine.armax import ArmaxModel, Criterion, OrderSearch, SearchSpace, polish, refine, search_orders
from app.engine.armax.model import IntArray, Stages
from app.engine.recording import FloatArray, UniformRecord
from app.engine.valve import one_parameter, two_parameter_choudhury, two_parameter_he, two_parameter_kano
from app.errors import DataError

ValveModel = Literal["he", "choudhury", "kano"]
Scaling = Literal["std", "raw"]

TWO_PARAMETER = {"he": two_parameter_he, "choudhury": two_parameter_choudhury, "kano": two_parameter_kano}


@dataclass(frozen=True)
class HammersteinConfig:
    """How the valve grid is laid, how orders are chosen and what is refined. Shares are of OP's range, max - min.

    points_d, d_max_share: d = 0 .. d_max_share in equal steps; the 2 % of the default have FC145's published answer,
    10 % of its range, among them.
    points_S, S_max_share: S likewise without 0; J is S times each of jump_shares (above 1: overshoot), and S = J = 0 is
    always the first point. valve_model: which two-parameter algorithm.
    criterion, scaling: AIC as eq 7 (with PV at unit standard deviation, or raw) or in Ljung's log form, on which
    scaling has no bearing. stages: regressions of the search, 2 or 3.
    curve_steps: steps of prediction-error minimisation that every grid point takes after the search, so that the curve
    compares like with like. refined: how many of the lowest grid points, besides no stiction at all, are then minimised
    to the end before the answer is taken from them; 0 takes it from the curve, and as many as there are points refines
    the whole curve. steps, tolerance: where that minimisation ends.
    """

    points_d: int = 30
    d_max_share: float = 0.58
    points_S: int = 20
    S_max_share: float = 0.8
    jump_shares: tuple[float, ...] = (0.0, 0.25, 0.5, 0.75, 1.0)
    valve_model: ValveModel = "he"
    criterion: Criterion = "log"
    scaling: Scaling = "std"
    stages: Stages = 2
    curve_steps: int = 3
    refined: int = 3
    steps: int = 30
    tolerance: float = 1e-6


@dataclass(frozen=True, eq=False, kw_only=True)
class GridResult:
    """What was found at each of M grid points, and the answer. RMSE in the unit of PV, one-step prediction error.

    rmse: (M,) of the curve, the same procedure at every point. rmse_refined: (M,) after prediction-error minimisation,
    NaN where it was not done. aic, na, nb, nc: (M,) least criterion and its order. best: the grid point with the least
    RMSE (refined, where the configuration refines). model, model_without_stiction: the model at `best` and with no
    stiction, in engineering units; refined, or as on the curve where nothing is refined. stiction: whether
    `best` is a point with a band. first_sample: errors are judged from this sample on.
    """

    space: SearchSpace
    rmse: FloatArray
    rmse_refined: FloatArray
    aic: FloatArray
    na: IntArray
    nb: IntArray
    nc: IntArray
    best: int
    model: ArmaxModel
    model_without_stiction: ArmaxModel
    stiction: bool
    first_sample: int

    @property
    def rmse_best(self) -> float:
        return self.model.rmse

    @property
    def rmse_without_stiction(self) -> float:
        return self.model_without_stiction.rmse


@dataclass(frozen=True, eq=False, kw_only=True)
class OneParameterResult(GridResult):
    """The RMSE curve over d, (M,) in the unit of OP; d[0] = 0."""

    d: FloatArray

    @property
    def d_best(self) -> float:
        return float(self.d[self.best])


@dataclass(frozen=True, eq=False, kw_only=True)
class TwoParameterResult(GridResult):
    """The RMSE surface over (S, J), each (M,) in the unit of OP; S[0] = J[0] = 0."""

    S: FloatArray
    J: FloatArray

    @property
    def S_best(self) -> float:
        return float(self.S[self.best])

    @property
    def J_best(self) -> float:
        return float(self.J[self.best])


@dataclass(frozen=True, eq=False)
class _Scaled:
    """PV and OP as deviations from their mean, divided by their scales: nothing after this depends on a unit."""

    pv: FloatArray
    op: FloatArray
    pv_scale: float
    op_scale: float


def identify_one_parameter(
    record: UniformRecord,
    space: SearchSpace,
    config: HammersteinConfig = HammersteinConfig(),
    points: IntArray | None = None,
) -> OneParameterResult:
    """Hammerstein identification with the one-parameter valve (figure 2, eqs 1-7): is the least RMSE at d = 0?

    record: PV and OP, (N,), any unit. space: the orders searched. points: which points of the grid are tried,
    increasing, the first of them 0 (no stiction); all where None. d and the RMSE come back in the units of OP and PV;
    a change of unit, sign or zero of either changes nothing else, unless eq 7 is asked for on raw signals.
    Raises DataError("flat_signal") where PV or OP never moves, DataError("not_finite") and
    DataError("record_too_short") as `search_orders` does.

    Misleads: the least RMSE of one-step predictions is often won by the noise model, and the answer changes with the
    search space: that is what the reliability measure is for. A stem that slips takes OP's value, so a band slightly
    off slips at other samples: between grid points stick-slip may be missed or found at another d.
    Source: Srinivasan, Spinner, Rengaswamy 2015, doi 10.1021/acs.iecr.5b00939.
    """
    scaled = _scale(record, config)
    d = np.linspace(0.0, config.d_max_share, config.points_d) * np.ptp(scaled.op)
    d = d if points is None else d[points]
    found = _identify(scaled, one_parameter(scaled.op, d), space, config)
    return OneParameterResult(d=d * scaled.op_scale, **vars(found))


def identify_two_parameter(
    record: UniformRecord, space: SearchSpace, config: HammersteinConfig = HammersteinConfig()
) -> TwoParameterResult:
    """Hammerstein identification with a two-parameter valve: is the least RMSE at S = J = 0?

    record, space, units and errors as `identify_one_parameter`; S and J in the unit of OP. The same source.
    """
    scaled = _scale(record, config)
    S, J = _stiction_grid(config)
    S, J = S * np.ptp(scaled.op), J * np.ptp(scaled.op)
    found = _identify(scaled, TWO_PARAMETER[config.valve_model](scaled.op, S, J), space, config)
    return TwoParameterResult(S=S * scaled.op_scale, J=J * scaled.op_scale, **vars(found))


def _stiction_grid(config: HammersteinConfig) -> tuple[FloatArray, FloatArray]:
    S = np.linspace(0.0, config.S_max_share, config.points_S + 1)[1:]
    J = np.outer(S, config.jump_shares)
    return np.append(0.0, np.repeat(S, len(config.jump_shares))), np.append(0.0, J)


def _scale(record: UniformRecord, config: HammersteinConfig) -> _Scaled:
    pv, op = record.pv - record.pv.mean(), record.op - record.op.mean()
    for name, signal in (("PV", pv), ("OP", op)):
        if not np.all(np.isfinite(signal)):
            raise DataError("not_finite", f"{name} has missing values; fill gaps first")
        if np.ptp(signal) == 0.0:
            raise DataError("flat_signal", f"{name} never moves: there is nothing to identify")
    pv_scale = 1.0 if config.scaling == "raw" else float(pv.std())
    op_scale = float(op.std())
    return _Scaled(pv=pv / pv_scale, op=op / op_scale, pv_scale=pv_scale, op_scale=op_scale)


def _identify(scaled: _Scaled, v: FloatArray, space: SearchSpace, config: HammersteinConfig) -> GridResult:
    first_alike = _first_alike(v)
    distinct, places = np.unique(first_alike, return_inverse=True)
    search = search_orders(scaled.pv, v[distinct], space, config.criterion, config.stages)
    search = polish(scaled.pv, v[distinct], search, config.curve_steps)
    candidates = _candidates(search.rmse[places], config)
    asked = sorted({int(places[m]) for m in candidates})
    fitted = {k: _model_at(k, scaled, v[distinct[k]], search, config) for k in asked}
    models = {m: fitted[int(places[m])] for m in candidates}
    rmse_refined = np.full(len(v), np.nan)
    if config.refined > 0:
        rmse_refined[list(models)] = [model.rmse for model in models.values()]
    best = min(models, key=lambda m: (models[m].rmse, m))
    return GridResult(
        space=space,
        rmse=search.rmse[places] * scaled.pv_scale,
        rmse_refined=rmse_refined,
        aic=search.aic[places],
        na=search.na[places],
        nb=search.nb[places],
        nc=search.nc[places],
        best=best,
        model=models[best],
        model_without_stiction=models[0],
        stiction=best != 0,
        first_sample=search.first_sample,
    )


def _first_alike(v: FloatArray) -> IntArray:
    """(M,) for each row of v (M, N) the first one with the same samples: what it does to PV needs to be asked once.

    A band that OP never leaves holds the stem, however much wider it is; and a finite record tells bands apart only
    where some move of OP lies between them.
    """
    seen: dict[float, list[int]] = {}
    alike = np.arange(len(v))
    for m, total in enumerate(v.sum(axis=1).tolist()):
        before = seen.setdefault(total, [])
        alike[m] = next((k for k in before if np.array_equal(v[k], v[m])), m)
        if alike[m] == m:
            before.append(m)
    return alike


def _candidates(rmse: FloatArray, config: HammersteinConfig) -> list[int]:
    """No stiction and the lowest points of the curve, the smaller band first where two are level."""
    lowest = np.argsort(rmse, kind="stable")[: max(config.refined, 1)]
    return sorted({0, *(int(m) for m in lowest)})


def _model_at(k: int, scaled: _Scaled, v: FloatArray, search: OrderSearch, config: HammersteinConfig) -> ArmaxModel:
    """The model behind one stem v (N,), the k-th of the search."""
    steps = config.steps if config.refined > 0 else 0
    fitted = refine(scaled.pv, v, search.order(k), search, k, steps, config.tolerance)
    gain = scaled.pv_scale / scaled.op_scale
    return replace(fitted, b=fitted.b * gain, rmse=fitted.rmse * scaled.pv_scale)
