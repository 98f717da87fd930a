"""What a verdict rests on, point by point with a tick or a cross, and where another answer disagrees."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from app.engine.codes import CheckCode, ReasonCode
from app.services.moments import PlantClock
from app.services.telling.repair_sides import explained_before, explained_long_before
from app.services.telling.stored_evidence import explained, votes
from app.services.telling.wording import LIKELY, STICKS, cause_words, measured_probability, probability, sticks_for_sure

Says = Literal["agrees", "otherwise", "nothing"]
MARKS: dict[Says, str] = {"agrees": "✓", "otherwise": "✗", "nothing": "·"}
JUDGED = ("stiction", "no_stiction")

UNCLEAR: tuple[ReasonCode, ...] = (
    "evidence_not_clear",
    "not_cleared",
    "linear_look_alikes",
    "set_point_moves",
    "nearly_sinusoidal",
    "keeps_time",
)
APART: tuple[ReasonCode, ...] = (
    "uncoupled",
    "uncoupled_slowly",
    "same_signal",
    "no_answer",
    "foreign_cycle",
    "outside_corners",
    "hidden_band",
    "pv_stands",
    "wound_up",
    "answers_no_more",
)
DIVIDED: tuple[ReasonCode, ...] = (
    "few_cycles",
    "few_samples",
    "windows_disagree",
    "stretches_disagree",
    "newer_disagrees",
    "stiction_began",
    "short_lived_stiction",
)
POOR: tuple[ReasonCode, ...] = (
    "filled_share",
    "filled",
    "mode_share",
    "pv_quantised",
    "pv_interpolated",
    "stored_points",
    "op_flat",
    "pv_flat",
)
DOUBTED: tuple[ReasonCode, ...] = ("moves_set_point", "moves_no_valve", "shaken_by_neighbour", "stood_together")
OLDER: tuple[ReasonCode, ...] = ("before_repair",)
"""Codes of reasons, by what they speak against."""
AGAINST = frozenset((*UNCLEAR, *APART, *DIVIDED, *POOR, *DOUBTED, *OLDER))

WITHOUT_A_VOTE: dict[CheckCode, str] = {
    "op_interpolated": (
        "an integrating controller draws such lines by itself while PV stands still; but no size is stated then"
    ),
}
"""Why a check of the record that did not pass takes nothing from a verdict, where that is not plain."""

DISAGREES = (
    "Two answers on this page disagree: by the shapes of PV and OP the valve does not stick, by the explanation below "
    "it does (probability {probability})."
)

NAMES_OTHERWISE = (
    "The explanation below names something other than the valve (probability {probability}). Follow the verdict: it "
    "can be relied on, and {why}."
)
OLDER_SAID = (
    "An older explanation {what} (probability {probability}), based on data up to {until}, long before the data of "
    "this verdict: follow the verdict, and explain the loop again if you doubt it."
)
HARDLY = "the record can hardly tell that cause from others"
BESIDES = "the explanation says what a simulation lacks, which may also be true; look at that after the valve"
AT_THE_VALVE = (STICKS, "valve.deadband")
"""Effects that are the same repair as a valve that sticks."""

LEAST_DERIVATIVE = 0.1
"""Derivative time in sampling intervals: what is read off noise is less."""

DERIVATIVE = (
    "The controller of this loop has derivative action. A valve that sticks is often missed then, even if the "
    "verdict is marked reliable: with an earlier fit of the model behind it, 62 of 220 simulated sticking valves "
    "were wrongly cleared as reliable. A stroke test tells more."
)


@dataclass(frozen=True)
class Point:
    """One thing that a verdict may rest on. moves: whether the verdict, or its reliability, depends on it; what does
    not was only heard."""

    says: Says
    text: str
    moves: bool = True

    @property
    def mark(self) -> str:
        return MARKS[self.says]


def points(row: Mapping[str, Any], detail: Mapping[str, Any], shaken_by: str | None = None) -> list[Point]:
    """What speaks for a verdict and against it, the weightiest first; empty where the valve was not judged. shaken_by:
    the loop that may be what makes this one swing, as it is known by now."""
    if row["verdict"] not in JUDGED or measured_probability(row) is None:
        return []
    reasons = {reason["code"]: reason["text"] for reason in detail["reasons"]}
    found = [
        _kept("shapes", f"probability of stiction {probability(row['stiction_probability'])}", UNCLEAR, reasons),
        _rivals(row, detail.get("rivals", ()), reasons),
        _kept("PV and OP", "they are related, beyond chance", APART, reasons),
        _kept("length", f"{row['cycles'] or 0.0:.1f} cycles, and its parts agree", DIVIDED, reasons),
        _kept("record", _whole(row), POOR, reasons),
        _not_passed(detail, reasons),
        _others(row, reasons, shaken_by),
        _time(reasons),
        _fit(row, detail.get("rivals", ())),
        _methods(row, detail),
        _published(row, reasons),
    ]
    reliable = row["reliability"] == "reliable"
    return [_beside(point) if reliable else point for point in found if point is not None]


def contradiction(
    row: Mapping[str, Any],
    explanation: Mapping[str, Any] | None,
    repaired_at: str | None = None,
    hold_days: float = math.inf,
) -> str | None:
    """Says so where a valve that is said not to stick is what the newest explanation names. repaired_at: when the loop
    was repaired last (ISO 8601): what was recorded before says nothing of the valve since. hold_days: what ended longer
    before what the verdict is of disputes it no more."""
    likeliest = _likeliest(row, explanation, repaired_at, hold_days)
    if (
        row["verdict"] != "no_stiction"
        or likeliest is None
        or likeliest["effect"] != STICKS
        or likeliest["probability"] < LIKELY
    ):
        return None
    return DISAGREES.format(probability=probability(likeliest["probability"]))


def names_otherwise(
    row: Mapping[str, Any],
    explanation: Mapping[str, Any] | None,
    repaired_at: str | None = None,
    hold_days: float = math.inf,
) -> str | None:
    """Says which to follow where a valve sticks, to be relied on, and the newest explanation names no valve.
    repaired_at, hold_days: as in `contradiction`."""
    likeliest = _likeliest(row, explanation, repaired_at, hold_days)
    if not sticks_for_sure(row) or likeliest is None:
        return None
    if not {likeliest["effect"], *likeliest.get("alternatives", ())}.isdisjoint(AT_THE_VALVE):
        return None
    told = likeliest["probability"]
    return NAMES_OTHERWISE.format(probability=probability(told), why=BESIDES if told >= LIKELY else HARDLY)


def older_said(
    row: Mapping[str, Any],
    explanation: Mapping[str, Any] | None,
    repaired_at: str | None,
    hold_days: float,
    clock: PlantClock,
) -> str | None:
    """What an explanation said that is too old to dispute a verdict (`hold_days`) and would do so otherwise."""
    if explanation is None or not explained_long_before(explanation, row, hold_days):
        return None
    sticks = contradiction(row, explanation, repaired_at)
    likeliest = _likeliest(row, explanation, repaired_at)
    if likeliest is None or not (sticks or names_otherwise(row, explanation, repaired_at)):
        return None
    what = "said that the valve sticks" if sticks else "named something other than the valve"
    told = probability(likeliest["probability"])
    return OLDER_SAID.format(what=what, probability=told, until=clock.day(explanation["window_end"]))


def _likeliest(
    row: Mapping[str, Any],
    explanation: Mapping[str, Any] | None,
    repaired_at: str | None,
    hold_days: float = math.inf,
) -> Mapping[str, Any] | None:
    """Of what an explanation that is done names, unless it is of before the repair, or of too long ago."""
    if explanation is None or explanation["state"] != "done":
        return None
    if explained_before(explanation, repaired_at) or explained_long_before(explanation, row, hold_days):
        return None
    return max(explanation["effects"], key=lambda effect: effect["probability"], default=None)


def derivative(row: Mapping[str, Any], explanation: Mapping[str, Any] | None) -> str | None:
    """Says so where a valve is not accused and the newest explanation found a controller that differentiates."""
    closed = (explanation or {}).get("closed_loop")
    if row["verdict"] not in ("no_stiction", "inconclusive") or not closed:
        return None
    found = any(_differentiates(closed.get(name)) for name in ("controller", "given_controller"))
    return DERIVATIVE if found else None


def _differentiates(law: Mapping[str, Any] | None) -> bool:
    kc, kd = (law or {}).get("kc") or 0.0, (law or {}).get("kd") or 0.0
    return kc != 0.0 and kd / kc >= LEAST_DERIVATIVE


def _kept(name: str, told: str, against: Sequence[str], reasons: Mapping[str, str]) -> Point:
    """Agrees, unless a reason that speaks against it was given."""
    doubts = [reasons[code] for code in against if code in reasons]
    return Point("otherwise", f"{name}: {doubts[0]}") if doubts else Point("agrees", f"{name}: {told}")


def _others(row: Mapping[str, Any], reasons: Mapping[str, str], shaken_by: str | None) -> Point:
    if shaken_by is None or not reasons.keys().isdisjoint(DOUBTED):
        return _kept("other loops", "none of them is known to move it", DOUBTED, reasons)
    says: Says = "agrees" if row["verdict"] == "no_stiction" else "otherwise"
    return Point(says, f"other loops: it oscillates in step with {shaken_by}, which may be disturbing it")


def _time(reasons: Mapping[str, str]) -> Point | None:
    """Only where it speaks against: most loops were never repaired."""
    doubts = [reasons[code] for code in OLDER if code in reasons]
    return Point("otherwise", f"time: {doubts[0]}") if doubts else None


def _beside(point: Point) -> Point:
    """What speaks against a verdict that can be relied on all the same did not move it."""
    return replace(point, moves=False) if point.says == "otherwise" else point


def _whole(row: Mapping[str, Any]) -> str:
    automatic, filled = row["automatic_share"], row["filled_share"]
    mode = "mode not recorded" if automatic is None else f"{100.0 * automatic:.0f} % in automatic"
    return f"{mode}, {100.0 * (filled or 0.0):.0f} % filled in"


def _not_passed(detail: Mapping[str, Any], reasons: Mapping[str, str]) -> Point | None:
    """Of the checks of the record those that did not pass and do not count against the verdict: shown beside what does,
    or the page would say of one record that it is whole and that it fails."""
    failed = [finding["code"] for finding in detail.get("findings", ()) if finding["outcome"] == "fail"]
    silent = [code for code in failed if code not in reasons or code not in AGAINST]
    if not silent:
        return None
    told = "; ".join(f"{code.replace('_', ' ')}{_because(code)}" for code in silent)
    return Point("nothing", f"checks that did not pass, but do not weaken the verdict: {told}")


def _because(code: CheckCode) -> str:
    why = WITHOUT_A_VOTE.get(code)
    return f" ({why})" if why else ""


def _rivals(row: Mapping[str, Any], rivals: Sequence[Mapping[str, Any]], reasons: Mapping[str, str]) -> Point:
    counted = [rival["code"] for rival in rivals if rival["code"] in reasons and rival["code"] != "stiction"]
    if row["verdict"] == "stiction":
        if counted:
            return Point("otherwise", f"other explanations: {cause_words(counted[0])}")
        return Point("agrees", "other explanations: none that counts against it stands out")
    if row["likely_cause"] is None:
        return Point("nothing", "other explanations: none stands out")
    return Point("agrees", f"other explanations: {cause_words(row['likely_cause'])}")


def _fit(row: Mapping[str, Any], rivals: Sequence[Mapping[str, Any]]) -> Point | None:
    shares = next((explained(rival) for rival in rivals if rival["code"] == "stiction"), None)
    if shares is None:
        return None
    text = f"fit: a sticky valve explains {shares.sticky_pct} % of PV, a linear one {shares.linear_pct} %"
    return Point(_side(row, shares.sticky_pct, shares.linear_pct), text, moves=False)


def _methods(row: Mapping[str, Any], detail: Mapping[str, Any]) -> Point | None:
    found = votes(detail)
    if found is None:
        return None
    told = f"published methods: {_count(found.sticks)} stiction, {_count(found.free)} none"
    return Point(_side(row, found.sticks, found.free), told, moves=False)


def _count(methods: int) -> str:
    return f"{methods} {'says' if methods == 1 else 'say'}"


def _side(row: Mapping[str, Any], sticks: float, free: float) -> Says:
    if sticks == free:
        return "nothing"
    return "agrees" if (sticks > free) == (row["verdict"] == "stiction") else "otherwise"


def _published(row: Mapping[str, Any], reasons: Mapping[str, str]) -> Point | None:
    if row["table2_reading"] is None:
        return None
    otherwise = "reference_disagrees" in reasons
    told = f"published rule: {'it disagrees' if otherwise else 'it agrees'}"
    return Point("otherwise" if otherwise else "agrees", told, moves=False)
