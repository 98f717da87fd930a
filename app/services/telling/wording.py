"""Codes in plain words, and which loop comes first: the same on the command line, on the pages and in reports."""

from collections.abc import Iterable, Mapping
from typing import Any

from app.engine.codes import NO_ANSWER_VERDICTS, ReasonCode
from app.engine.codes import UNANSWERED as UNANSWERED
from app.engine.evidence import told_probability

VERDICT_WORDS = {
    "stiction": "valve sticks",
    "inconclusive": "cannot tell",
    "not_auditable": "not auditable",
    "no_stiction": "no stiction",
}
POSSIBLY = ", possibly"
"""Behind the words of a verdict that is said `weakly`."""
NEAR_HALF = 0.15
VERDICT_RANK = ("stiction", "inconclusive", "not_auditable", "no_stiction")

STICKS, LIKELY = "valve.stiction", 0.5
"""The effect that an explanation names where the valve sticks, and from which probability on it is more than one of
several that the record hardly tells apart."""

PRIOR_ONLY: ReasonCode = "prior_only"
"""The reason that the record tells no probability."""

NOT_EVALUATED = "not evaluated"
"""In place of a health where too little was measured to say anything."""

SHAKEN_BY_NEIGHBOUR: ReasonCode = "shaken_by_neighbour"
MOVES_SET_POINT: ReasonCode = "moves_set_point"
MOVES_NO_VALVE: ReasonCode = "moves_no_valve"
STOOD_TOGETHER: ReasonCode = "stood_together"
"""The reasons that other loops give for not relying on a verdict, one of them a loop at most."""

RELIABILITY_WORDS = {
    "reliable": "everything that counts agrees; rely on it",
    "not_reliable": "the evidence is not sufficient; look first",
}

LOOK_TODAY_WORDS = "a stuck valve or a dead transmitter; look today"
"""In place of these where PV does not answer OP: that is a failure, whatever the evidence says of stiction."""

LOOK_TOGETHER_WORDS = "PV froze together with other loops; look today, first at what they share"
"""The same where others came to stand with it."""

RELIABILITY_SHORT = {"reliable": "yes", "not_reliable": "look first"}
RELIABILITY_BRIEF = {**RELIABILITY_SHORT, "reliable": "rely on it"}
"""Behind a verdict, where no question stands before it."""

CAUSE_WORDS = {
    "stiction": "the valve sticks",
    "external_oscillation": "external oscillation",
    "disturbance": "disturbances",
    "tuning_or_sinusoidal_disturbance": "tight tuning, or an external sinusoidal disturbance",
    "tight_tuning": "tight tuning",
    "aggressive_controller": "controller too aggressive",
    "sluggish_controller": "controller too sluggish",
    "backlash": "backlash at the valve",
    "set_point_following": "follows its set point",
    "no_oscillation": "does not oscillate",
    "saturated_op": "OP at its limit",
    "op_at_limits": "OP at its limit",
    "on_off_control": "OP on two values: on/off control",
    "quantised_sensor": "coarse sensor",
    "sensor_spikes": "sensor spikes",
    "sensor_sticking": "sticking sensor",
    UNANSWERED: "PV does not answer OP: stuck valve or dead transmitter",
    "controller_not_acting": "OP never moves: controller not acting",
    "not_in_automatic": "not in automatic",
    "sampled_too_slowly": "sampled too slowly",
    "data": "too little usable data",
}

CHANGE_WORDS = {
    "new": "newly said to stick",
    "cured": "no longer sticks",
    "flipped": "verdict changed",
    "wavers": "wavers",
}
WHY_WORDS = {
    "first": "first verdict",
    "method": "the method changed (engine or settings)",
    "repair": "a repair was stated",
    "data": "the record changed (gaps, length or sampling)",
    "loop": "what was seen differs a little from the previous record",
}

STATE_WORDS = {
    "planned": "planned",
    "running": "running",
    "done": "done",
    "partial": "done, some loops failed",
    "cancelled": "cancelled",
    "received": "received, waiting to be read",
    "reading": "being read",
    "failed": "failed",
}


NO_ROOM_YET = "waiting for room on the disk"
FILE_UNSEEN = "waiting: no worker sees its file"
"""Of an upload that is received and cannot be read for that, as that before."""
READ_IN_PART = "done, but the file arrived damaged"

STARTERS = {
    "schedule": "the nightly schedule",
    "command line": "the command line",
    "anyone on this machine": "a local user without a key",  # as it was kept before
}


def starter_words(started_by: str | None) -> str:
    """Who did something: as the trail has it, but for what is no one's name."""
    return "not known" if started_by is None else STARTERS.get(started_by, started_by)


def looked_at_today(row: Mapping[str, Any]) -> bool:
    """Whether PV does not answer OP: a stuck valve or a dead transmitter, as a verdict or as what keeps from one."""
    return row.get("likely_cause") == UNANSWERED and row["verdict"] in NO_ANSWER_VERDICTS


def _of_before_repair(row: Mapping[str, Any]) -> bool:
    """Rows that are shown say so by what is known of the loop's repair."""
    return bool(row.get("of_before_repair"))


def headline(row: Mapping[str, Any]) -> str:
    """What stands behind the verdict of a row, as a sentence would go on."""
    if _of_before_repair(row):
        return "judged from before the repair; wait for newer records"
    if row.get("of_old_record"):
        return "from an old record; no newer samples had arrived"
    if not looked_at_today(row):
        return RELIABILITY_WORDS[row["reliability"]]
    return LOOK_TOGETHER_WORDS if STOOD_TOGETHER in codes_of(row) else LOOK_TODAY_WORDS


def brief(row: Mapping[str, Any]) -> str:
    """The same in two words."""
    return _short(row, RELIABILITY_BRIEF)


def rely(row: Mapping[str, Any]) -> str:
    """The same as the answer to whether it can be relied on."""
    return _short(row, RELIABILITY_SHORT)


def _short(row: Mapping[str, Any], words: Mapping[str, str]) -> str:
    if _of_before_repair(row):
        return "from before the repair"
    if row.get("of_old_record"):
        return "from an old record"
    return "look today" if looked_at_today(row) else words[row["reliability"]]


APART_WORDS = {"old_record": "from old records", "before_repair": "from before the repair"}
"""Of verdicts that could be relied on when they were made, why their rows say something else, in the plural."""


def relied_words(relied: int, apart: Mapping[str, int]) -> str:
    """ "37 can be relied on, 5 from old records"."""
    others = [f"{apart[why]:,} {words}" for why, words in APART_WORDS.items() if apart.get(why)]
    return ", ".join([f"{relied:,} can be relied on", *others])


def cause_words(code: str | None) -> str:
    return "not known" if code is None else CAUSE_WORDS.get(code, code.replace("_", " "))


def codes_of(row: Mapping[str, Any]) -> list[str]:
    """The codes of the reasons of a row, or of an audit line, the weightiest first."""
    reasons = row["reasons"] or ""
    return list(codes_in(reasons)) if isinstance(reasons, str) else [reason["code"] for reason in reasons]


def codes_in(text: str | None) -> tuple[str, ...]:
    """The codes that a column keeps as one text; none where it is empty."""
    return tuple(text.split(";")) if text else ()


def health(value: float | None) -> str:
    """Of 100; too little data is no health, neither a good one nor a bad one."""
    return NOT_EVALUATED if value is None else f"{value:z.0f}"


def probability(value: float | None) -> str:
    """As the engine tells it; a dash where there is none."""
    return "–" if value is None else told_probability(value)


def measured_probability(row: Mapping[str, Any]) -> float | None:
    """None where a row's probability is a prior, not a measurement."""
    return None if PRIOR_ONLY in codes_of(row) else row["stiction_probability"]


def sticks_for_sure(row: Mapping[str, Any]) -> bool:
    """Whether a verdict that the valve sticks is to be relied on: nobody is sent to look elsewhere first."""
    return row["verdict"] == "stiction" and row["reliability"] == "reliable"


def weakly(row: Mapping[str, Any]) -> bool:
    """Whether a verdict is not to be relied on and its probability is so near one half that it could as well have been
    the other one: what shows it in a colour shows it pale."""
    known = measured_probability(row)
    if row["verdict"] not in ("stiction", "no_stiction") or row["reliability"] == "reliable" or known is None:
        return False
    return abs(known - 0.5) < NEAR_HALF


def unusual_importance(row: Any) -> str:
    """ "importance 3", which is why a loop stands above one of less health; empty where it is the usual one."""
    importance = row["importance"] if isinstance(row, Mapping) else row.importance
    return "" if importance == 1.0 else f"importance {importance:g}"


def worst_first(lines: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Sticky valves first, the surest of them at the top, with loops where PV never answers among those that want a
    look; loops without a complaint last; ties by name.
    """
    return sorted(lines, key=_badness)


def _badness(line: Mapping[str, Any]) -> tuple[int, bool, float, str]:
    probability = line.get("stiction_probability")
    today = looked_at_today(line)
    return (
        VERDICT_RANK.index("stiction" if today else line["verdict"]),
        line["reliability"] != "reliable" and not today,
        -(probability if probability is not None else 0.0),
        str(line["recording"]),
    )
