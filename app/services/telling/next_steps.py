"""What to do next about a loop, by its verdict: the same on its page, in reports and in the guide for operators."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from app.engine.codes import UNANSWERED, Cause, ReasonCode
from app.engine.judgement import (
    ANSWERS_NO_MORE,
    FOREIGN_CYCLE,
    HIDDEN_BAND,
    NO_ANSWER,
    OUTSIDE_CORNERS,
    PV_STANDS,
    UNCOUPLED,
    WOUND_UP,
)
from app.engine.long_records.episodes import BEGAN
from app.engine.verdict.config import VerdictConfig
from app.services.moments import PlantClock
from app.services.telling.repair_sides import of_before
from app.services.telling.stored_evidence import band_of, began_at
from app.services.telling.wording import (
    CAUSE_WORDS,
    MOVES_NO_VALVE,
    MOVES_SET_POINT,
    SHAKEN_BY_NEIGHBOUR,
    STOOD_TOGETHER,
    codes_of,
    sticks_for_sure,
)


def _began_to_stick(hour: str) -> str:
    return f"It has been sticking at least since {hour}, whatever the rest of the record says: ask for a stroke test."


def _has_band(quarter: str) -> str:
    return (
        f"When someone is working on the valve anyway, have OP moved in steps of {quarter}, a few up, then a few down, "
        "and watch the stem. The valve may stick or have backlash by as much as that band, although the loop does not "
        "oscillate. An alternating load disturbance looks the same."
    )


_ONCE_REPAIRED = (
    "once its valve is repaired, this one may stop oscillating by itself. If it goes on, ask for a stroke test here."
)
_IN_MANUAL = (
    "Where operation allows it, put the loop in manual for a few cycles: if the oscillation goes on, it comes "
    "from outside; if it stops, ask for a stroke test."
)


class Ask(StrEnum):
    """What can be asked for, in the words of the guide; which it is, is told by its name."""

    STICKS = (
        "Ask for a stroke test in small steps, up and down, then for a look at packing, positioner and air supply. "
        "Tuning does not cure it."
    )
    MAY_STICK = (
        "Look before anyone picks up a spanner: where operation allows it, put the loop in manual for a few cycles. "
        "If the oscillation goes on, it comes from outside; if it stops, this loop makes it, and a stroke test tells "
        "valve from tuning."
    )
    MAY_BE_SHAKEN = (
        "Look first for what else oscillates with this period: another loop (see the Groups page), a pump, a batch. "
        f"{_IN_MANUAL}"
    )
    SHAKEN = f"Look first at the loop that is named: {_ONCE_REPAIRED}"
    TUNING_UNSURE = (
        "Before anybody touches the tuning, put the loop in manual for a few cycles, where operation allows it: if "
        "the oscillation goes on, it comes from outside; if it stops, ask for a stroke test, and for looser tuning "
        "if the valve moves freely."
    )
    WEAK_UNSURE = "See how it responds to a small set-point step before its tuning is tightened."
    OUTER = (
        "Look at the loop whose set point this OP is: it moves the valve. Ask for a stroke test here only if OP also "
        "moves a valve of its own, and say so in the loop's settings."
    )
    NO_VALVE = (
        "Look at the loop whose set point this OP is: it moves the valve; this loop moves none, according to its "
        "settings."
    )
    BEGAN_TO_STICK = _began_to_stick("the hour that is named")
    CLEARED = "Nothing at the valve."
    NOT_CLEARED = (
        "Nothing for now: nothing points to the valve, and the reasons say why it is not cleared. If it stays like "
        "that for weeks, a stroke test will tell more than another night."
    )
    STANDS_FAST = (
        "Find out whether the valve moves at all: where operation allows it, move OP by a few per cent by hand and "
        "see whether PV follows."
    )
    HAS_BAND = _has_band("a quarter of the band that is named")
    CANNOT_TELL = "Nothing, unless it stays like that for weeks; then a stroke test will tell more than another night."
    OBJECTED = (
        "Audit a longer record before the valve is left alone: this verdict cannot be relied on, and the published "
        "rule, or its fit, says that the valve sticks. If it stays like that, ask for a stroke test."
    )
    NOT_AUDITABLE = "Tell the control engineer what the checks say: a better recording will bring a verdict."
    UNRELATED = (
        "Find out whether PV and OP are tags of one loop, and whether both are recorded. If so, check in the field "
        "whether the stem moves when OP does: with a stuck valve PV does not depend on OP."
    )
    WAIT = "Wait until enough has been recorded since the repair: this verdict is from before it."
    NOTHING_NEWER = (
        "Find out why no newer samples of this loop had arrived when it was audited (its export, its tags, or it is "
        "out of service): this verdict is from the last record there was. Do not send anyone to the valve for it."
    )
    WAIT_ON_SHELF = "Wait until the time that is named."
    UNTIL_THEY_AGREE = (
        "Touch neither valve nor tuning yet, because the audit clears the valve and the newest explanation says that "
        "it sticks: audit and explain a longer record, and if they still disagree, ask for a stroke test."
    )
    AT_LIMIT = (
        "Find out why OP stands at its limit: a valve that does not move, its size, a bypass, a set point out of "
        "reach, or tuning that is too tight, if OP runs from one limit to the other."
    )
    LOOK_TODAY = (
        "Look today, at both: whether the transmitter reads anything (impulse lines, wiring, a frozen signal), and in "
        "the field whether the stem moves when OP does (air, positioner, packing)."
    )
    STOOD_TOGETHER = (
        "Look today, and first at what these loops share: is their unit down, or has an I/O card, a multiplexer, a "
        "gateway or the historian's interface failed? Only if none of this applies, look at the transmitter and the "
        "valve of each. If the unit stays down, shelve them until it runs again."
    )
    SHAKEN_FROM_OUTSIDE = (
        "Leave the valve alone and look for what disturbs this loop: the Groups page shows the loops that oscillate "
        "with it."
    )
    UPSET = "Leave the valve alone and look for what upsets the process."
    TUNING_OR_SINE = (
        "Put the loop in manual for a few cycles, where operation allows it: if the oscillation stops, ask for "
        "looser tuning; if it goes on, it comes from outside."
    )
    WEAKER_TUNING = "Ask for looser tuning: less gain, or a longer integral time."
    STRONGER_TUNING = "Ask for tighter tuning."
    HAS_PLAY = "Have linkage and positioner checked: there is backlash between OP and the stem."
    FOLLOWS_SET_POINT = (
        "Nothing at the valve: PV follows its set point. If the set point should not move so much, look at what "
        "moves it."
    )
    DOES_NOT_SWING = "Nothing: it does not oscillate."
    SWITCHES = (
        "Nothing, if it is meant to switch: leave it out of the audits. Otherwise have OP stored with finer resolution."
    )
    COARSE_SENSOR = "Have the resolution of transmitter and historian checked."
    SENSOR_SPIKES = "Have transmitter and wiring checked: single values jump."
    SENSOR_STICKS = "Have the transmitter checked: it holds one value, then jumps to the next."
    DOES_NOT_ACT = (
        "Find out whether the controller acts at all, whether OP stands at a limit, and whether it is recorded."
    )
    IN_MANUAL = (
        "Find out why it is in manual, or in a mode that is not understood (the upload says which), and whether it may "
        "be put in automatic."
    )
    TOO_SLOW = "Have it recorded faster: ten samples per cycle or more."


REOPEN = "reopen the order."

NOTHING = frozenset(
    (Ask.CLEARED, Ask.NOT_CLEARED, Ask.CANNOT_TELL, Ask.FOLLOWS_SET_POINT, Ask.DOES_NOT_SWING, Ask.SWITCHES)
)
"""What leaves the valve alone."""

BY_CAUSE = {
    UNANSWERED: Ask.LOOK_TODAY,
    "external_oscillation": Ask.SHAKEN_FROM_OUTSIDE,
    "disturbance": Ask.UPSET,
    "tuning_or_sinusoidal_disturbance": Ask.TUNING_OR_SINE,
    "tight_tuning": Ask.WEAKER_TUNING,
    "aggressive_controller": Ask.WEAKER_TUNING,
    "sluggish_controller": Ask.STRONGER_TUNING,
    "backlash": Ask.HAS_PLAY,
    "set_point_following": Ask.FOLLOWS_SET_POINT,
    "no_oscillation": Ask.DOES_NOT_SWING,
    "saturated_op": Ask.AT_LIMIT,
    "op_at_limits": Ask.AT_LIMIT,
    "on_off_control": Ask.SWITCHES,
    "quantised_sensor": Ask.COARSE_SENSOR,
    "sensor_spikes": Ask.SENSOR_SPIKES,
    "sensor_sticking": Ask.SENSOR_STICKS,
    "controller_not_acting": Ask.DOES_NOT_ACT,
    "not_in_automatic": Ask.IN_MANUAL,
    "sampled_too_slowly": Ask.TOO_SLOW,
    "data": Ask.NOT_AUDITABLE,
}
"""Where the valve is not said to stick, by likely cause."""

BY_CAUSE_UNSURE = {
    "tight_tuning": Ask.TUNING_UNSURE,
    "aggressive_controller": Ask.TUNING_UNSURE,
    "sluggish_controller": Ask.WEAK_UNSURE,
}
"""Causes that are acted on only where the verdict is relied on, and what to do before."""

FEW_CYCLES: ReasonCode = "few_cycles"
ENOUGH_CYCLES = VerdictConfig().min_cycles
LONGER = "A longer record will tell more"

OBJECTIONS: frozenset[ReasonCode] = frozenset({"reference_disagrees", "yper_high_stiction"})
"""Reasons of a verdict that is not stiction, for which the published rule says that it is."""

FIT_OBJECTS = 0.9
"""Where a fitted valve that sticks leaves this share, or less, of the RMSE that one that does not leaves."""

BEFORE_A_BAND: frozenset[Cause] = frozenset(
    {
        *("set_point_following", "quantised_sensor", "sensor_spikes", "sensor_sticking", "backlash", "saturated_op"),
        "external_oscillation",
    }
)
"""Causes whose step comes first where the valve may have a band besides."""

BY_REASON: dict[ReasonCode, Ask] = {
    STOOD_TOGETHER: Ask.STOOD_TOGETHER,
    MOVES_NO_VALVE: Ask.NO_VALVE,
    MOVES_SET_POINT: Ask.OUTER,
    SHAKEN_BY_NEIGHBOUR: Ask.SHAKEN,
    PV_STANDS: Ask.LOOK_TODAY,
    ANSWERS_NO_MORE: Ask.LOOK_TODAY,
    WOUND_UP: Ask.AT_LIMIT,
}
"""Whatever the verdict, the first of these that is among its reasons."""

BY_VERDICT = {"no_stiction": Ask.CLEARED, "inconclusive": Ask.CANNOT_TELL, "not_auditable": Ask.NOT_AUDITABLE}


AT_ONCE = frozenset({Ask.WAIT, Ask.LOOK_TODAY, Ask.STOOD_TOGETHER})
"""Steps that a longer record adds nothing to."""


BEHIND_SOURCE = {
    Ask.SHAKEN: f"{_ONCE_REPAIRED[:1].upper()}{_ONCE_REPAIRED[1:]}",
    Ask.MAY_BE_SHAKEN: _IN_MANUAL,
    Ask.SHAKEN_FROM_OUTSIDE: "Leave the valve alone.",
}
"""What is left to say of steps that send elsewhere first, where that place was named before them."""

WAITS = "Wait"
NOT_BEHIND_SOURCE = (Ask.LOOK_TODAY, Ask.STOOD_TOGETHER, Ask.NOTHING_NEWER)
"""With what waits: steps that are taken wherever the oscillation comes from."""


@dataclass(frozen=True)
class Step:
    """What to do about a loop. code: what is asked; whoever has the same one is asked the same. asks: that in words;
    text: with what is known of the loop; besides: what is said of it behind that, for a list under `asks`."""

    code: str
    asks: str
    text: str
    besides: str = ""


def next_step(row: Mapping[str, Any], clock: PlantClock, repaired_at: str | None = None) -> str:
    """`step_of` as the reliability table has it."""
    return step_of(row, clock, repaired_at).text


def step_of(row: Mapping[str, Any], clock: PlantClock, repaired_at: str | None = None) -> Step:
    """What to do about a loop whose row of the reliability table this is. clock: what the step tells times by;
    repaired_at: when it was repaired last (ISO 8601)."""
    if of_before(row, repaired_at):
        return step_for(Ask.WAIT)
    reasons = codes_of(row)
    ask, period_s = _by_verdict(row, reasons), row.get("oscillation_period_s")
    if ask in NOTHING and row["reliability"] != "reliable" and _objected(row, reasons):
        ask = Ask.OBJECTED
    step = step_for(ask, _with_number(ask, row, clock))
    if FEW_CYCLES not in reasons or row["reliability"] == "reliable" or period_s is None or ask in AT_ONCE:
        return step
    lasts_s = ENOUGH_CYCLES * period_s
    if _window_s(row) >= lasts_s:  # of which a stretch was judged that no longer record makes longer
        return step
    longer = f"{LONGER}: {ENOUGH_CYCLES:g} cycles of this loop take {in_hours(lasts_s)}"
    return replace(step, text=f"{step.text} {longer}.", besides=f"{longer[:1].lower()}{longer[1:]}")


def step_for(ask: Ask, text: str | None = None) -> Step:
    """text: what is asked, with what is known of the loop; None: nothing is."""
    return Step(ask.name.lower(), ask.value, text or ask.value)


def _with_number(ask: Ask, row: Mapping[str, Any], clock: PlantClock) -> str | None:
    """With the hour or the size that the step speaks of; None where there is none, or it is not known."""
    if ask is Ask.BEGAN_TO_STICK and (began := began_at(row, clock)):
        return _began_to_stick(began)
    if ask is Ask.HAS_BAND and (size := band_of(row)) is not None:
        return _has_band(f"{size / 4.0:.2g} units (a quarter of the band, {size:.2g})")
    return None


def behind_source(step: str) -> str | None:
    """The text of a step as it is told behind the loop to look at first; None where nobody is to look there first."""
    if step.startswith(WAITS) or any(ask in step for ask in NOT_BEHIND_SOURCE):
        return None
    for ask, rest in BEHIND_SOURCE.items():
        step = step.replace(ask, rest)
    return step


def after_repair(step: Step, repaired: str, order: str | None, *, sure: bool) -> Step:
    """The step for a loop that sticks on though it was repaired: one of its own. repaired: the day; sure: whether that
    it sticks can be relied on."""
    named = f"Repaired {repaired}{f' ({order})' if order else ''}"
    told = f"{named}, did not help" if sure else f"{named}, may not have helped"
    code = f"{step.code}: {told}"
    if sure and order and step == step_for(Ask.STICKS):
        return Step(code, f"{told}: {REOPEN}", f"{told}: {REOPEN}")
    return replace(step, code=code, asks=f"{told}. {step.asks}", text=f"{told}. {step.text}")


def _objected(row: Mapping[str, Any], reasons: Sequence[str]) -> bool:
    """Whether the published rule takes the valve of a row for one that sticks, or its fit does by much."""
    with_, without = row.get("hammerstein_rmse"), row.get("hammerstein_rmse_without_stiction")
    by_fit = with_ is not None and without is not None and with_ <= FIT_OBJECTS * without
    return by_fit or not OBJECTIONS.isdisjoint(reasons)


def _window_s(row: Mapping[str, Any]) -> float:
    """How much was looked at, of which what was judged may be a part; 0 where that is not known."""
    samples, interval_s = row.get("window_samples"), row.get("sampling_interval_s")
    return 0.0 if samples is None or interval_s is None else float(samples * interval_s)


def in_hours(seconds: float) -> str:
    """So that a record as long is long enough."""
    if seconds < 5400.0:
        return f"{math.ceil(seconds / 60.0)} min"
    return f"{math.ceil(seconds / 360.0) / 10.0:g} h"


def _by_verdict(row: Mapping[str, Any], reasons: Sequence[str]) -> Ask:
    if first := next((step for reason, step in BY_REASON.items() if reason in reasons), None):
        return first
    if sticks_for_sure(row):
        return Ask.STICKS
    if BEGAN in reasons:
        return Ask.BEGAN_TO_STICK
    if row["verdict"] == "stiction":
        return Ask.MAY_BE_SHAKEN if {FOREIGN_CYCLE, OUTSIDE_CORNERS} & set(reasons) else Ask.MAY_STICK
    if row["verdict"] == "inconclusive" and UNCOUPLED in reasons:
        return Ask.UNRELATED
    if NO_ANSWER in reasons:
        return Ask.STANDS_FAST
    if HIDDEN_BAND in reasons and row["likely_cause"] not in BEFORE_A_BAND:
        return Ask.HAS_BAND
    cause = row["likely_cause"] or ""
    if row["reliability"] != "reliable" and cause in BY_CAUSE_UNSURE:
        return BY_CAUSE_UNSURE[cause]
    return BY_CAUSE.get(cause, _without_cause(row))


def _without_cause(row: Mapping[str, Any]) -> Ask:
    if row["verdict"] == "no_stiction" and row["reliability"] != "reliable":
        return Ask.NOT_CLEARED
    return BY_VERDICT[row["verdict"]]


PID_CAVEAT = (
    "This does not hold if the controller has derivative action (PID): a sticking valve is often wrongly cleared "
    "there. Then ask for a stroke test if anything else points to the valve."
)

OF_NO_VERDICT = ("not_in_automatic", "sampled_too_slowly", "on_off_control", "op_at_limits", "controller_not_acting")
"""Causes that keep a record from being judged; the others stand beside a valve that is not said to stick."""

MOST_MET = (
    ("valve sticks, rely on it", Ask.STICKS),
    ("valve sticks, look first", Ask.MAY_STICK),
    ("no stiction, rely on it, and no cause is named", f"{Ask.CLEARED} {PID_CAVEAT}"),
    ("no stiction, look first, and no cause is named", Ask.NOT_CLEARED),
    ("cannot tell, and no cause is named", Ask.CANNOT_TELL),
)
OF_STICTION = (
    ("PV does not move as it would if the valve caused the oscillation, or reverses by itself", Ask.MAY_BE_SHAKEN),
    ("a neighbour may be disturbing it", Ask.SHAKEN),
    ("look first, but it sticks up to the end of the record", Ask.BEGAN_TO_STICK),
)
OF_NO_STICTION = (
    ("PV shows no answer to OP", Ask.STANDS_FAST),
    ("PV moves as if the valve had a deadband, and no nearer cause is named", Ask.HAS_BAND),
    ("look first, the step would otherwise be nothing, and the published rule or its fit says stiction", Ask.OBJECTED),
    ("the newest explanation says that the valve sticks, more likely than not", Ask.UNTIL_THEY_AGREE),
)
OF_CANNOT_TELL = (("PV and OP are unrelated", Ask.UNRELATED),)
OF_ANY = (
    ("PV of other loops froze at about the same time", Ask.STOOD_TOGETHER),
    ("OP is the set point of another loop", Ask.OUTER),
    ("the loop's settings say that OP moves no valve", Ask.NO_VALVE),
    ("repaired, and too little recorded since", Ask.WAIT),
    (
        "repaired in the last fortnight, and the valve sticks since, rely on it",
        "The page says that the repair of that day (with its work order) did not help. Reopen the work order.",
    ),
    (
        "PV did not answer OP before a repair of the last fortnight, and does not since",
        "The page says that the repair of that day (with its work order) did not help. Look today, as above.",
    ),
    ("shelved, and it has not become worse in kind since", Ask.WAIT_ON_SHELF),
    ("from an old record", Ask.NOTHING_NEWER),
    (
        "look first, for too few cycles",
        "Do what the line above for this verdict says, and if the page says how many hours are needed, have a longer "
        "record audited.",
    ),
)


def as_table() -> str:
    """The same as tables of Markdown, for the guide: what is met most, then by verdict."""
    unsure = ((f"look first, likely cause: {CAUSE_WORDS[code]}", step) for code, step in BY_CAUSE_UNSURE.items())
    causes = {code: (f"likely cause: {CAUSE_WORDS[code]}", step) for code, step in BY_CAUSE.items()}
    refused = [causes.pop(code) for code in (*OF_NO_VERDICT, "data")]
    dead = causes.pop(UNANSWERED)
    parts = {
        "The five that you meet most": MOST_MET,
        "Valve sticks, and": OF_STICTION,
        "No stiction, and": (*OF_NO_STICTION, *unsure, *causes.values()),
        "Cannot tell, and": (dead, *OF_CANNOT_TELL),
        "Not auditable, and": (dead, *refused, ("no cause is named", Ask.NOT_AUDITABLE)),
        "Whatever the verdict": OF_ANY,
    }
    return "\n\n".join(f"### {title}\n\n{_table(rows)}" for title, rows in parts.items())


def _table(rows: Sequence[tuple[str, str]]) -> str:
    """What asks for the same step in one row."""
    steps: dict[str, dict[str, None]] = {}
    for said, step in rows:
        steps.setdefault(step, {})[said] = None
    lines = [f"| {'; or '.join(said)} | {step} |" for step, said in steps.items()]
    return "\n".join(["| the page says | what to do |", "|---|---|", *lines])
