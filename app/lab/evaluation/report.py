"""The evaluation in words and tables: figures, reliability diagram, accuracy against coverage, components, failures."""

from collections.abc import Iterable

import numpy as np
from scipy.special import expit

from app.engine.judgement import Judgement
from app.engine.recording import FloatArray, IntArray
from app.engine.verdict.shape_model import ShapeModel
from app.lab.evaluation.fitting import TextArray
from app.lab.evaluation.leave_one_out import by_valve
from app.lab.evaluation.parameters import version_of
from app.lab.evaluation.scoring import Figures, Interval, area_under_curve, balanced, exact, valve_labels


def headline(found: Figures, auc: Interval, forced: Interval) -> str:
    """The figures of the scorer, with 95 % intervals where they were computed."""
    right, accused = exact(found.reliable_right, found.reliable_valves), exact(found.false_alarms, found.healthy)
    rows = (
        ("AUC", f"{found.auc:.3f}", f"{auc.low:.3f} to {auc.high:.3f}"),
        ("forced balanced accuracy", f"{found.forced:.3f}", f"{forced.low:.3f} to {forced.high:.3f}"),
        ("balanced accuracy, undecided counted as wrong", f"{found.decided:.3f}", ""),
        ("decided", f"{100 * found.coverage:.1f} %", ""),
        ("called reliable", f"{100 * found.reliable_share:.1f} %", ""),
        ("right of those called reliable", f"{100 * found.reliable_right:.1f} %", _pct(right)),
        ("healthy valves called sticky and reliable", f"{100 * found.false_alarms:.1f} %", _pct(accused)),
    )
    return _table(("by valve", "value", "95 % interval"), rows)


def _pct(interval: Interval) -> str:
    return f"{100 * interval.low:.1f} to {100 * interval.high:.1f} %"


def shipped_beside(fitted: ShapeModel, shipped: ShapeModel, values: FloatArray) -> str:
    """Whether the shipped numbers are what a fit gives today; where not, how far they move the shapes of `values`.

    values: (n, F) features. Another processor rounds otherwise, which networks amplify: a few hundredths are usual.
    """
    version, today = version_of(shipped), version_of(fitted)
    if version == today:
        return f"The parameters that are shipped, {version}, are what this fit gives"
    moved = np.abs(expit(fitted.log_odds(values)) - expit(shipped.log_odds(values))).max()
    return f"Shipped are the parameters {version}; this fit gives {today}: probabilities move by up to {moved:.3f}"


def reliability_diagram(valves: TextArray, sticky: IntArray, probability: FloatArray) -> str:
    """Stated probability against the share of sticky valves, in five bins of valves."""
    label, p = valve_labels(valves, sticky), by_valve(valves, probability)[1]
    rows = []
    for low in np.arange(0.0, 1.0, 0.2):
        inside = (p >= low) & ((p < low + 0.2) | (low > 0.79))
        if inside.any():
            cells = f"{p[inside].mean():.2f}", f"{label[inside].mean():.2f}", str(int(inside.sum()))
            rows.append((f"{low:.1f} to {low + 0.2:.1f}", *cells))
    return _table(("probability", "mean stated", "share sticky", "valves"), rows)


def accuracy_coverage(valves: TextArray, sticky: IntArray, probability: FloatArray) -> str:
    """How many of the surest valves are right, for growing shares of all valves."""
    label, p = valve_labels(valves, sticky), by_valve(valves, probability)[1]
    order = np.argsort(-np.abs(p - 0.5))
    right = (p[order] > 0.5) == (label[order] == 1)
    rows = []
    for share in (0.3, 0.4, 0.5, 0.6, 0.65, 0.7, 0.8, 0.9, 1.0):
        count = max(1, round(share * len(p)))
        rows.append((f"{100 * share:.0f} %", str(count), f"{100 * right[:count].mean():.1f} %"))
    return _table(("surest share", "valves", "right"), rows)


def by_tier(valves: TextArray, sticky: IntArray, tiers: TextArray, probability: FloatArray) -> str:
    """AUC and forced balanced accuracy among the valves of each tier of labels; "-" where a class is missing in it."""
    rows = []
    for tier in np.unique(tiers):
        inside = tiers == tier
        label, p = valve_labels(valves[inside], sticky[inside]), by_valve(valves[inside], probability[inside])[1]
        both = 0 < label.sum() < len(label)
        forced = f"{balanced((p > 0.5) == (label == 1), label):.3f}" if both else "-"
        auc = f"{area_under_curve(p, label):.3f}" if both else "-"
        rows.append((str(tier), str(len(label)), str(int(label.sum())), auc, forced))
    return _table(("label", "valves", "sticky", "AUC", "forced balanced accuracy"), rows)


def by_way(head: str, found: Iterable[tuple[str, Figures]]) -> str:
    """The figures of each way in which the recordings were stored, or valves left out; head: which of them."""
    rows = (
        (
            *(way, f"{figures.auc:.3f}", f"{figures.forced:.3f}", f"{100 * figures.coverage:.1f} %"),
            *(f"{100 * figures.reliable_share:.1f} %", f"{100 * figures.reliable_right:.1f} %"),
            f"{100 * figures.false_alarms:.1f} %",
        )
        for way, figures in found
    )
    heads = (head, "AUC", "forced balanced accuracy", "decided", "reliable", "right of these", "healthy accused")
    return _table(heads, rows)


def components(valves: TextArray, sticky: IntArray, scores: Iterable[tuple[str, FloatArray]]) -> str:
    """AUC of each component alone, and its balanced accuracy at the threshold that suits these recordings best."""
    rows = []
    label = valve_labels(valves, sticky)
    for name, score in scores:
        known = np.isfinite(score)
        some = valve_labels(valves[known], sticky[known])
        by = by_valve(valves[known], score[known])[1]
        if len(set(some.tolist())) < 2:
            continue
        best = max(balanced((by > t) == (some == 1), some) for t in by)
        rows.append((name, f"{len(some)} of {len(label)}", f"{area_under_curve(by, some):.3f}", f"{best:.3f}"))
    return _table(("component", "valves it applies to", "AUC", "balanced accuracy at its best threshold"), rows)


def failures(names: list[str], causes: list[str], sticky: IntArray, judgements: list[Judgement]) -> str:
    """The recordings whose probability lies on the wrong side, the worst first."""
    rows = []
    for name, cause, label, judgement in zip(names, causes, sticky, judgements, strict=True):
        p = 0.5 if judgement.stiction_probability is None else judgement.stiction_probability
        if (p > 0.5) != (label == 1):
            wrong = "sticky" if label else f"no stiction ({cause or 'cause not stated'})"
            rows.append((abs(p - 0.5), (name, wrong, f"{p:.2f}", judgement.reliability.replace("_", " "))))
    rows.sort(reverse=True)
    return _table(("recording", "label", "probability", "reliability"), [row for _, row in rows])


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])
