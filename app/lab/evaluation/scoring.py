"""Figures by valve: a valve counts once, however many recordings it has."""

from dataclasses import dataclass

import numpy as np
from scipy.special import betaincinv

from app.engine.judgement import Judgement
from app.engine.recording import BoolArray, FloatArray, IntArray
from app.lab.evaluation.fitting import TextArray
from app.lab.evaluation.leave_one_out import by_valve


@dataclass(frozen=True)
class Figures:
    """auc; forced: balanced accuracy of probability > 0.5; decided: balanced accuracy with undecided ones wrong.

    coverage: share of valves decided. reliable_share, reliable_right: share of valves called reliable, and right of
    them. false_alarms: share of healthy valves called sticky and reliable. valves, healthy: how many there are.
    """

    auc: float
    forced: float
    decided: float
    coverage: float
    reliable_share: float
    reliable_right: float
    false_alarms: float
    valves: int
    healthy: int

    @property
    def reliable_valves(self) -> float:
        return self.reliable_share * self.valves


@dataclass(frozen=True)
class Interval:
    low: float
    high: float


def area_under_curve(score: FloatArray, sticky: IntArray) -> float:
    """Chance that a sticky valve scores above a healthy one; ties count half."""
    positive, negative = score[sticky == 1][:, None], score[sticky == 0][None, :]
    return float(np.mean((positive > negative) + 0.5 * (positive == negative)))


def balanced(right: FloatArray, sticky: IntArray) -> float:
    return 0.5 * float(right[sticky == 1].mean() + right[sticky == 0].mean())


def valve_labels(valves: TextArray, sticky: IntArray) -> IntArray:
    return by_valve(valves, sticky.astype(float))[1].round().astype(np.int64)


def figures(valves: TextArray, sticky: IntArray, judgements: list[Judgement]) -> Figures:
    """The figures of judgements, one a recording."""
    label = valve_labels(valves, sticky)
    said = np.array([{"stiction": 1, "no_stiction": 0}.get(j.verdict, -1) for j in judgements])
    reliable = np.array([j.reliability == "reliable" for j in judgements]) & (said >= 0)
    probability = np.array([0.5 if j.stiction_probability is None else j.stiction_probability for j in judgements])

    def mean(values: FloatArray | BoolArray) -> FloatArray:
        return by_valve(valves, values.astype(float))[1]

    p, weight = mean(probability), mean(reliable)
    right = mean(reliable & (said == sticky))
    alarms = mean(reliable & (said == 1) & (sticky == 0))
    return Figures(
        auc=area_under_curve(p, label),
        forced=balanced((p > 0.5) == (label == 1), label),
        decided=balanced(mean(said == sticky), label),
        coverage=float(mean(said >= 0).mean()),
        reliable_share=float(weight.mean()),
        reliable_right=float(right.sum() / weight.sum()) if weight.sum() else float("nan"),
        false_alarms=float(alarms[label == 0].mean()),
        valves=len(label),
        healthy=int((label == 0).sum()),
    )


def bootstrap(label: IntArray, probability: FloatArray, draws: int = 2000, seed: int = 0) -> tuple[Interval, Interval]:
    """95 % intervals of AUC and of forced balanced accuracy over valves drawn again within their class."""
    rng = np.random.default_rng(seed)
    sticky, healthy = probability[label == 1], probability[label == 0]
    areas, forced = [], []
    for _ in range(draws):
        s, h = rng.choice(sticky, len(sticky)), rng.choice(healthy, len(healthy))
        areas.append(float(np.mean((s[:, None] > h) + 0.5 * (s[:, None] == h))))
        forced.append(0.5 * float(np.mean(s > 0.5) + np.mean(h <= 0.5)))
    return _interval(areas), _interval(forced)


def exact(share: float, of: float) -> Interval:
    """95 % interval of a share of so many independent valves: where the tails of the binomial distribution end.

    Valves drawn again tell nothing of a share with one exception or none. `of` need not be whole: a valve with several
    recordings may count in part. Source: Clopper, Pearson 1934, doi 10.1093/biomet/26.4.404.
    """
    if not of > 0.0:
        return Interval(0.0, 1.0)
    held, rest = share * of, (1.0 - share) * of
    low = float(betaincinv(held, rest + 1.0, 0.025)) if held > 0.0 else 0.0
    high = float(betaincinv(held + 1.0, rest, 0.975)) if rest > 0.0 else 1.0
    return Interval(low, high)


def _interval(values: list[float]) -> Interval:
    low, high = np.quantile(values, [0.025, 0.975])
    return Interval(float(low), float(high))
