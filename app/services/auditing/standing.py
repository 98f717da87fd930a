"""Loops whose PV does not answer OP, heard together: since when, and which of them came to stand with one another."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from app.engine.judgement import ANSWERS_NO_MORE
from app.engine.plant_wide.stood_together import Stand, stood_together
from app.nanoseconds import NS_PER_S
from app.services.moments import EPOCH, PlantClock, iso_utc
from app.services.telling.standing_wording import with_others
from app.services.telling.wording import codes_of

SINCE = "unanswered_since"


@dataclass(frozen=True)
class Standing:
    """What is told of a loop in which PV does not answer OP. fields: of its row, as far as others tell them.
    text, chance_probability: where it came to stand with others; else None."""

    fields: Mapping[str, Any]
    text: str | None = None
    chance_probability: float | None = None


def of_plant(rows: Sequence[Any]) -> dict[str, Standing]:
    """By tag. rows: `storage.standing.unanswered`. Where PV stood when the record began, it has stood since the verdict
    before said, if that said the same."""
    known = {row.tag: json.loads(row.extra_json).get(SINCE) for row in rows}
    carried = {
        row.tag: json.loads(row.extra_json_before).get(SINCE)
        for row in rows
        if known[row.tag] is None and row.extra_json_before is not None
    }
    carried = {tag: since for tag, since in carried.items() if since is not None}
    stands = [
        Stand(row.tag, _seconds(since), (row.input_end_ns - row.input_start_ns) / NS_PER_S, interval_s, row.unit)
        for row in rows
        if (since := known[row.tag] or carried.get(row.tag)) is not None
        and PlantClock.dated(since)  # else each counts from a start of its own
        and (interval_s := row.sampling_interval_s) is not None
        and row.input_start_ns is not None
        and _stands(row.reasons.split(";"))
    ]
    return {tag: Standing({SINCE: since}) for tag, since in carried.items()} | _together(stands, carried)


def of_lines(lines: Iterable[Mapping[str, Any]]) -> dict[str, Standing]:
    """The same of audit lines; those without a date stand by themselves."""
    stands = [
        Stand(line["loop"], _seconds(line[SINCE]), line["samples"] * interval_s, interval_s)
        for line in lines
        if line[SINCE] is not None and (interval_s := line["sampling_interval_s"]) and _stands(codes_of(line))
    ]
    return _together(stands, {})


def _together(stands: Sequence[Stand], carried: Mapping[str, str]) -> dict[str, Standing]:
    found: dict[str, Standing] = {}
    for group in stood_together(stands):
        told = {"stood_with": len(group.stands) - 1, "stood_together_since": _iso(group.since_s)}
        for tag in (stand.tag for stand in group.stands):
            since = {SINCE: carried[tag]} if tag in carried else {}
            found[tag] = Standing(since | told, with_others(group, tag), group.chance_probability)
    return found


def _stands(reasons: Sequence[str]) -> bool:
    """A PV that moves, and answers no more, did so some time after its stem stuck: that hour tells of no other loop."""
    return ANSWERS_NO_MORE not in reasons


def _seconds(iso: str) -> float:
    return datetime.fromisoformat(iso).timestamp()


def _iso(seconds: float) -> str | None:
    return iso_utc(EPOCH + timedelta(milliseconds=round(1000.0 * seconds)))
