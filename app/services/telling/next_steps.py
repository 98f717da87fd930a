"""What to do next about a loop, by its verdict: the same on its page, in reports and in the guide for operators."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from app.engine.codes import UNANSWERED, Cause, ReasonCode
from app.engine.judgement import ANSWERS_NO_MORE, FOREIGN_CYCLE, HIDDEN_BAND, NO_ANSWER, PV_STANDS, UNCOUPLED, WOUND_UP
from app.engine.long_records.episodes import BEGAN
from app.engine.verdict.config import VerdictConfig
from app.services.telling.repair_sides import of_before
from app.services.telling.stored_evidence import band_of, began_at
from app.services.telling.wording import CAUSE_WORDS, MOVES_NO_VALVE, MOVES_SET_POINT, SHAKEN_BY_NEIGHBOUR, codes_of

STICKS = (
    "Ask for a stroke test in small steps, up and down, then for a look at packing, positioner and air supply. Tuning "
    "does not cure it."
)
MAY_STICK = (
    "Look before anyone takes a spanner: where operation allows it, put the loop in manual for some periods. A swing "
    "that goes on comes from outside; one that stops is made here, and a stroke test tells valve from tuning."
)
MAY_BE_SHAKEN = (
    "Look first for what else goes to and fro with this period: another loop (the page of groups), a pump, a batch. "
    "Where operation allows it, put the loop in manual for some periods: a swing that goes on comes from outside, one "
    "that stops asks for a stroke test."
)
SHAKEN = (
    "Look at the loop that is named first: once its valve is mended, this one may stop by itself. If it swings on, ask "
    "for a stroke test here."
)
TUNING_UNSURE = (
    "Before anybody touches the tuning, put the loop in manual for some periods, where operation allows it: a swing "
    "that goes on comes from outside, one that stops asks for a stroke test, and for weaker tuning where the valve is "
    "free."
)
WEAK_UNSURE = "See how it answers a small step of the set point before its tuning is made stronger."
OUTER = (
    "Look at the loop whose set point this OP is: that one moves the valve. Ask for a stroke test here only where OP "
    "moves a valve of its own besides, and say so in the loop's settings."
)
NO_VALVE = "Look at the loop whose set point this OP is: that one moves the valve, this one none, as its settings say."
HOUR_NAMED = "the hour that is named"
BEGAN_TO_STICK = f"It sticks, at least since {HOUR_NAMED}, whatever the rest of the record says: ask for a stroke test."
CLEARED = "Nothing at the valve."
NOT_CLEARED = (
    "Nothing now: nothing accuses the valve, and the reasons say what keeps this from clearing it. If it stays like "
    "that for weeks, a stroke test tells more than another night."
)
STANDS_FAST = (
    "Find out whether the valve moves at all: where operation allows it, move OP by a few per cent by hand and see "
    "whether PV goes along."
)
BAND_NAMED = "a quarter of the band that is named"
HAS_BAND = (
    f"When somebody is at the valve anyway, have OP moved in steps of {BAND_NAMED}, some up, then some down, and the "
    "stem watched: it may stick, or have play, by so much, though the loop does not cycle for it. A load that switches "
    "to and fro looks the same."
)
CANNOT_TELL = "Nothing, unless it stays like that for weeks; then a stroke test tells more than another night."
OBJECTED = (
    "Audit a longer record before the valve is left alone: this is not to be relied on, and the published rule, or its "
    "fit, says that the valve sticks. If it stays like that, ask for a stroke test."
)
NOT_AUDITABLE = "Tell the control engineer what the checks say: better recording brings a verdict."
UNRELATED = (
    "Find out whether PV and OP are tags of one loop, and recorded. If they are, see in the field whether the stem "
    "moves when OP does: behind a valve that is stuck PV owes nothing to OP."
)
WAIT = "Wait until enough is recorded since the repair: what is said here is of before it."
REOPEN = "reopen the order."
UNTIL_THEY_AGREE = (
    "Touch neither valve nor tuning yet, because the audit clears the valve and the newest explanation says that it "
    "sticks: audit and explain a longer record, and where they still disagree, ask for a stroke test."
)

AT_LIMIT = (
    "Find out why OP stands at its limit: a valve that does not move, its size, a bypass, a set point out of reach; "
    "too strong tuning where it runs from one limit to the other."
)

BY_CAUSE = {
    UNANSWERED: "Look today, at both: whether the transmitter reads anything (impulse lines, "
    "wiring, a frozen signal), and in the field whether the stem moves when OP does (air, positioner, packing).",
    "external_oscillation": "Leave the valve alone and look for what shakes this loop: the page of groups shows the "
    "loops that swing with it.",
    "disturbance": "Leave the valve alone and look for what upsets the process.",
    "tuning_or_sinusoidal_disturbance": "Put the loop in manual for some periods, where operation allows it: a swing "
    "that stops asks for weaker tuning, one that goes on comes from outside.",
    "tight_tuning": "Ask for weaker tuning: less gain, or a longer integral time.",
    "aggressive_controller": "Ask for weaker tuning: less gain, or a longer integral time.",
    "sluggish_controller": "Ask for stronger tuning.",
    "backlash": "Have linkage and positioner looked at: there is play between OP and the stem.",
    "set_point_following": "Nothing at the valve: PV goes with its set point. Where that should not move so much, "
    "look at what moves it.",
    "no_oscillation": "Nothing: it does not swing.",
    "saturated_op": AT_LIMIT,
    "op_at_limits": AT_LIMIT,
    "on_off_control": "Nothing where it is meant to switch: leave it out of the audits. Else have OP stored finer.",
    "quantised_sensor": "Have the resolution of transmitter and historian looked at.",
    "sensor_spikes": "Have transmitter and wiring looked at: single values jump.",
    "sensor_sticking": "Have the transmitter looked at: it holds one value and jumps to the next.",
    "controller_not_acting": "Find out whether the controller acts at all, whether OP stands at a limit, and whether "
    "it is recorded.",
    "not_in_automatic": "Find out why it is in manual, and whether it may be put in automatic.",
    "sampled_too_slowly": "Have it recorded faster: ten samples a cycle or more.",
    "data": NOT_AUDITABLE,
}
"""Where the valve is not said to stick, by likely cause."""

BY_CAUSE_UNSURE = {
    "tight_tuning": TUNING_UNSURE,
    "aggressive_controller": TUNING_UNSURE,
    "sluggish_controller": WEAK_UNSURE,
}
"""Causes that are acted on only where the verdict is relied on, and what to do before."""

FEW_CYCLES: ReasonCode = "few_cycles"
ENOUGH_CYCLES = VerdictConfig().min_cycles
LONGER = "A longer record tells more"

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

BY_REASON: dict[ReasonCode, str] = {
    MOVES_NO_VALVE: NO_VALVE,
    MOVES_SET_POINT: OUTER,
    SHAKEN_BY_NEIGHBOUR: SHAKEN,
    PV_STANDS: BY_CAUSE[UNANSWERED],
    ANSWERS_NO_MORE: BY_CAUSE[UNANSWERED],
    WOUND_UP: AT_LIMIT,
}
"""Whatever the verdict, the first of these that is among its reasons."""

BY_VERDICT = {"no_stiction": CLEARED, "inconclusive": CANNOT_TELL, "not_auditable": NOT_AUDITABLE}


AT_ONCE = frozenset({WAIT, BY_CAUSE[UNANSWERED]})
"""Steps that a longer record adds nothing to."""


def next_step(row: Mapping[str, Any], repaired_at: str | None = None) -> str:
    """What to do about a loop whose row of the reliability table this is; `repaired_at`: when it was repaired last
    (ISO 8601)."""
    if of_before(row, repaired_at):
        return WAIT
    reasons = codes_of(row)
    step, period_s = _with_number(_by_verdict(row, reasons), row), row.get("oscillation_period_s")
    if step.startswith("Nothing") and row["reliability"] != "reliable" and _objected(row, reasons):
        step = OBJECTED
    if FEW_CYCLES not in reasons or row["reliability"] == "reliable" or period_s is None or step in AT_ONCE:
        return step
    return f"{step} {LONGER}: {ENOUGH_CYCLES:g} swings of this one take {in_hours(ENOUGH_CYCLES * period_s)}."


def _with_number(step: str, row: Mapping[str, Any]) -> str:
    """The hour and the band that a step speaks of, as the reasons of the row tell them."""
    told = row.get("reasons_text")
    if step == BEGAN_TO_STICK and (began := began_at(told)):
        return step.replace(HOUR_NAMED, began)
    if step == HAS_BAND and (size := band_of(told)) is not None:
        return step.replace(BAND_NAMED, f"{size / 4.0:.2g} units (a quarter of the band, {size:.2g})")
    return step


def apart(step: str) -> tuple[str, str]:
    """What a step asks for, the same of every loop, and what it says of the one loop besides."""
    general, _, longer = step.partition(f" {LONGER}: ")
    head, tail = BEGAN_TO_STICK.split(HOUR_NAMED)
    if general.startswith(head) and general.endswith(tail):
        general = BEGAN_TO_STICK
    return general, f"a longer record tells more: {longer.rstrip('.')}" if longer else ""


def after_repair(step: str, repaired: str, order: str | None, *, sure: bool) -> str:
    """The step for a loop that sticks on though it was repaired. repaired: the day; sure: whether that it sticks can be
    relied on."""
    named = f"Repaired {repaired}{f' ({order})' if order else ''}"
    if not sure:
        return f"{named}, may not have helped. {step}"
    return f"{named}, did not help: {REOPEN}" if order and step == STICKS else f"{named}, did not help. {step}"


def _objected(row: Mapping[str, Any], reasons: Sequence[str]) -> bool:
    """Whether the published rule takes the valve of a row for one that sticks, or its fit does by much."""
    with_, without = row.get("hammerstein_rmse"), row.get("hammerstein_rmse_without_stiction")
    by_fit = with_ is not None and without is not None and with_ <= FIT_OBJECTS * without
    return by_fit or not OBJECTIONS.isdisjoint(reasons)


def in_hours(seconds: float) -> str:
    """So that a record as long is long enough."""
    if seconds < 5400.0:
        return f"{math.ceil(seconds / 60.0)} min"
    return f"{math.ceil(seconds / 360.0) / 10.0:g} h"


def _by_verdict(row: Mapping[str, Any], reasons: Sequence[str]) -> str:
    if first := next((step for reason, step in BY_REASON.items() if reason in reasons), None):
        return first
    if row["verdict"] == "stiction" and row["reliability"] == "reliable":
        return STICKS
    if BEGAN in reasons:
        return BEGAN_TO_STICK
    if row["verdict"] == "stiction":
        return MAY_BE_SHAKEN if FOREIGN_CYCLE in reasons else MAY_STICK
    if row["verdict"] == "inconclusive" and UNCOUPLED in reasons:
        return UNRELATED
    if NO_ANSWER in reasons:
        return STANDS_FAST
    if HIDDEN_BAND in reasons and row["likely_cause"] not in BEFORE_A_BAND:
        return HAS_BAND
    cause = row["likely_cause"] or ""
    if row["reliability"] != "reliable" and cause in BY_CAUSE_UNSURE:
        return BY_CAUSE_UNSURE[cause]
    return BY_CAUSE.get(cause, _without_cause(row))


def _without_cause(row: Mapping[str, Any]) -> str:
    if row["verdict"] == "no_stiction" and row["reliability"] != "reliable":
        return NOT_CLEARED
    return BY_VERDICT[row["verdict"]]


PID_CAVEAT = (
    "Not so where the controller has derivative action (PID): a sticking valve is often cleared wrongly there. Then "
    "ask for a stroke test where anything else speaks for the valve."
)

OF_NO_VERDICT = ("not_in_automatic", "sampled_too_slowly", "on_off_control", "op_at_limits", "controller_not_acting")
"""Causes that keep a record from being judged; the others stand beside a valve that is not said to stick."""

MOST_MET = (
    ("valve sticks, rely on it", STICKS),
    ("valve sticks, look first", MAY_STICK),
    ("no stiction, rely on it, and no cause is named", f"{CLEARED} {PID_CAVEAT}"),
    ("no stiction, look first, and no cause is named", NOT_CLEARED),
    ("cannot tell, and no cause is named", CANNOT_TELL),
)
OF_STICTION = (
    ("PV does not move as it would if the valve made the swing", MAY_BE_SHAKEN),
    ("a neighbour may shake it", SHAKEN),
    ("look first, but it sticks up to the end of the record", BEGAN_TO_STICK),
)
OF_NO_STICTION = (
    ("PV shows no answer to OP", STANDS_FAST),
    ("PV goes as behind a valve with a band, and no nearer cause is named", HAS_BAND),
    ("look first, the step would be nothing, and the published rule or its fit says stiction", OBJECTED),
    ("the newest explanation says, likelier than not, that the valve sticks", UNTIL_THEY_AGREE),
)
OF_CANNOT_TELL = (("PV has nothing to do with OP", UNRELATED),)
OF_ANY = (
    ("OP is the set point of another loop", OUTER),
    ("the loop's settings say that OP moves no valve", NO_VALVE),
    ("repaired, and too little recorded since", WAIT),
    (
        "repaired in the last fortnight, and the valve sticks since, rely on it",
        f"That the repair did not help, with its day and its work order: {REOPEN}",
    ),
    ("shelved, and nothing got worse in kind since", "Wait, until the time that is named."),
    ("look first, for too few swings", f"The step for it. {LONGER}: so many hours."),
)


def as_table() -> str:
    """The same as tables of Markdown, for the guide: what is met most, then by verdict."""
    unsure = ((f"look first, likely cause: {CAUSE_WORDS[code]}", step) for code, step in BY_CAUSE_UNSURE.items())
    causes = {code: (f"likely cause: {CAUSE_WORDS[code]}", step) for code, step in BY_CAUSE.items()}
    refused = [causes.pop(code) for code in (*OF_NO_VERDICT, "data")]
    dead = causes.pop("stuck_valve_or_dead_transmitter")
    parts = {
        "The five that you meet most": MOST_MET,
        "Valve sticks, and": OF_STICTION,
        "No stiction, and": (*OF_NO_STICTION, *unsure, *causes.values()),
        "Cannot tell, and": (dead, *OF_CANNOT_TELL),
        "Not auditable, and": (dead, *refused, ("no cause is named", NOT_AUDITABLE)),
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
