"""Hammerstein identification: OP through a grid of valves, an ARMAX model behind each; the least RMSE answers."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.engine.armax import ArmaxModel, Criterion, OrderSearch, SearchSpace, refine, search_orders
from app.engine.armax.model import Stages
from app.engine.armax.search import check_length
from app.engine.recording import FloatArray, IntArray, UniformRecord
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


class Identification:
    """Hammerstein identification of one record in one search space after another, by one valve model or the other.

    What has been asked of a stem in a space is not asked again: bands that move it alike share their answer, also where
    the other valve model lays them.
    """

    def __init__(self, record: UniformRecord, config: HammersteinConfig = HammersteinConfig()) -> None:
        """record: PV and OP, (N,), any unit.

        Raises DataError("flat_signal") where PV or OP never moves and DataError("not_finite") where a value is missing.
        """
        self._scaled, self._config = _scale(record, config), config
        self._stems: dict[SearchSpace, _Stems] = {}

    def one_parameter(self, space: SearchSpace, points: IntArray | None = None) -> OneParameterResult:
        """Hammerstein identification with the one-parameter valve (figure 2, eqs 1-7): is the least RMSE at d = 0?

        space: the orders searched. points: which points of the grid are tried, increasing, the first of them 0 (no
        stiction); all where None. d and the RMSE come back in the units of OP and PV; a change of unit, sign or zero of
        either changes nothing else, unless eq 7 is asked for on raw signals.
        Raises DataError("record_too_short") as `search_orders` does.

        Misleads: the least RMSE of one-step predictions is often won by the noise model, and the answer changes with
        the search space: that is what the reliability measure is for. A stem that slips takes OP's value, so a band
        slightly off slips at other samples: between grid points stick-slip may be missed or found at another d.
        Source: Srinivasan, Spinner, Rengaswamy 2015, doi 10.1021/acs.iecr.5b00939.
        """
        op, op_scale = self._scaled.op, self._scaled.op_scale
        d = np.linspace(0.0, self._config.d_max_share, self._config.points_d) * np.ptp(op)
        d = d if points is None else d[points]
        return OneParameterResult(d=d * op_scale, **vars(self._identify(one_parameter(op, d), space)))

    def two_parameter(self, space: SearchSpace) -> TwoParameterResult:
        """Hammerstein identification with a two-parameter valve: is the least RMSE at S = J = 0?

        space, units and errors as `one_parameter`; S and J in the unit of OP. The same source.
        """
        op, op_scale = self._scaled.op, self._scaled.op_scale
        S, J = (share * np.ptp(op) for share in _stiction_grid(self._config))
        v = TWO_PARAMETER[self._config.valve_model](op, S, J)
        return TwoParameterResult(S=S * op_scale, J=J * op_scale, **vars(self._identify(v, space)))

    def _identify(self, v: FloatArray, space: SearchSpace) -> GridResult:
        if space not in self._stems:
            self._stems[space] = _Stems(self._scaled, space, self._config)
        stems = self._stems[space]
        places = stems.searched(v)
        rmse = stems.rmse[places]
        models = {m: stems.model(places[m]) for m in _candidates(rmse, self._config)}
        rmse_refined = np.full(len(v), np.nan)
        if self._config.refined > 0:
            rmse_refined[list(models)] = [model.rmse for model in models.values()]
        best = min(models, key=lambda m: (models[m].rmse, m))
        return GridResult(
            space=space,
            rmse=rmse,
            rmse_refined=rmse_refined,
            aic=stems.aic[places],
            na=stems.orders[places, 0],
            nb=stems.orders[places, 1],
            nc=stems.orders[places, 2],
            best=best,
            model=models[best],
            model_without_stiction=models[0],
            stiction=best != 0,
            first_sample=stems.first_sample,
        )


def identify_one_parameter(
    record: UniformRecord,
    space: SearchSpace,
    config: HammersteinConfig = HammersteinConfig(),
    points: IntArray | None = None,
) -> OneParameterResult:
    """`Identification.one_parameter` of a record in one search space."""
    return Identification(record, config).one_parameter(space, points)


class _Stems:
    """The distinct stems that were searched in one space, in the order in which they were met.

    rmse, aic: (K,), orders: (K, 3); RMSE in the unit of PV. first_sample: errors are judged from this sample on.
    """

    def __init__(self, scaled: _Scaled, space: SearchSpace, config: HammersteinConfig) -> None:
        check_length(len(scaled.pv), space)
        self._scaled, self._space, self._config = scaled, space, config
        self._rows: list[FloatArray] = []
        self._alike: dict[float, list[int]] = {}
        self._found: list[tuple[OrderSearch, int]] = []
        self._models: dict[int, ArmaxModel] = {}
        self.rmse, self.aic, self.orders = np.empty(0), np.empty(0), np.empty((0, 3), dtype=np.int64)
        self.first_sample = 0

    def searched(self, v: FloatArray) -> IntArray:
        """(M,) where each row of v (M, N), in the unit of OP as scaled, stands among the stems; new ones are searched.

        A band that OP never leaves holds the stem, however much wider it is; and a finite record tells bands apart only
        where some move of OP lies between them.
        """
        known = len(self._rows)
        places = np.array([self._place(row, total) for row, total in zip(v, v.sum(axis=1).tolist(), strict=True)])
        if new := self._rows[known:]:
            self._search(np.concatenate(new).reshape(len(new), -1))
        return places

    def model(self, place: int) -> ArmaxModel:
        """The model behind one stem, refined where the configuration refines, in engineering units."""
        if place not in self._models:
            steps = self._config.steps if self._config.refined > 0 else 0
            search, k = self._found[place]
            row, order = self._rows[place], search.order(k)
            fitted = refine(self._scaled.pv, row, order, search, k, steps, self._config.tolerance)
            self._models[place] = fitted.rescaled(self._scaled.pv_scale, self._scaled.op_scale)
        return self._models[place]

    def _place(self, row: FloatArray, total: float) -> int:
        """Where the stem `row` (N,) with this sum stands; at the end, if it is new."""
        before = self._alike.setdefault(total, [])
        for place in before:
            if np.array_equal(self._rows[place], row):
                return place
        before.append(len(self._rows))
        self._rows.append(row)
        return before[-1]

    def _search(self, v: FloatArray) -> None:
        config = self._config
        search = search_orders(self._scaled.pv, v, self._space, config.criterion, config.stages, config.curve_steps)
        self._found += [(search, k) for k in range(len(v))]
        self.rmse = np.append(self.rmse, search.rmse * self._scaled.pv_scale)
        self.aic = np.append(self.aic, search.aic)
        orders = np.stack((search.na, search.nb, search.nc), axis=1)
        self.orders = np.append(self.orders, orders, axis=0)
        self.first_sample = search.first_sample


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


def _candidates(rmse: FloatArray, config: HammersteinConfig) -> list[int]:
    """No stiction and the lowest points of the curve, the smaller band first where two are level."""
    lowest = np.argsort(rmse, kind="stable")[: max(config.refined, 1)]
    return sorted({0, *(int(m) for m in lowest)})
