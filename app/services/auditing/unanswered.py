"""Loops whose PV does not answer OP, heard together: since when, and which of them came to stand with one another."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import TYPE_CHECKING, Any

from app.engine.judgement import ANSWERS_NO_MORE
from app.engine.plant_wide.stood_together import Stand, stood_together
from app.nanoseconds import NS_PER_S
from app.services.moments import EPOCH, PlantClock, iso_utc, seconds_of
from app.services.telling.reasons import SINCE, TOGETHER_SINCE, extra_in
from app.services.telling.standing_wording import with_others
from app.services.telling.wording import codes_in, codes_of

if TYPE_CHECKING:  # an audit of files stores nothing
    from app.storage.unanswered import SaidBefore, UnansweredRow

INTERVALS_APART = 3.0
"""Sampling intervals that may lie between two records that touch."""


@dataclass(frozen=True)
class Standing:
    """What is told of a loop in which PV does not answer OP. fields: of its row, as far as others tell them.
    text, chance_probability: where it came to stand with others; else None."""

    fields: Mapping[str, Any]
    text: str | None = None
    chance_probability: float | None = None


def unknown_since(rows: "Iterable[UnansweredRow]") -> list[int]:
    """Of `storage.unanswered.unanswered` the loops, by id, whose PV stood when the record began."""
    return [row.loop_id for row in rows if _since(row) is None]


def of_plant(rows: "Sequence[UnansweredRow]", before: "Iterable[SaidBefore]" = ()) -> dict[str, Standing]:
    """By tag. rows: `storage.unanswered.unanswered`, before: `unanswered_before` of those that are `unknown_since`.
    Where PV stood when the record began, it has stood since an earlier verdict said, if no time is without a record of
    it."""
    known = {row.tag: _since(row) for row in rows}
    earlier: dict[int, list[SaidBefore]] = {}
    for one in before:
        earlier.setdefault(one.loop_id, []).append(one)
    found = {row.tag: _carried(row, earlier.get(row.loop_id, ())) for row in rows if known[row.tag] is None}
    carried = {tag: since for tag, since in found.items() if since is not None}
    stands = [
        Stand(row.tag, seconds_of(since), (row.input_end_ns - row.input_start_ns) / NS_PER_S, interval_s, row.unit)
        for row in rows
        if (since := known[row.tag] or carried.get(row.tag)) is not None
        and PlantClock.dated(since)  # else each counts from a start of its own
        and (interval_s := row.sampling_interval_s) is not None
        and row.input_start_ns is not None
        and row.input_end_ns is not None
        and _stands(codes_in(row.reasons))
    ]
    return {tag: Standing({SINCE: since}) for tag, since in carried.items()} | _together(stands, carried)


def _carried(row: "UnansweredRow", earlier: "Iterable[SaidBefore]") -> str | None:
    """earlier: the newest first. In all their records PV stood up to the end."""
    start_ns, apart_ns = row.input_start_ns, INTERVALS_APART * NS_PER_S * (row.sampling_interval_s or 0.0)
    for one in earlier:
        if start_ns is None or one.input_end_ns is None or one.input_end_ns < start_ns - apart_ns:
            return None
        if (since := _since(one)) is not None:
            return since
        start_ns = one.input_start_ns and min(start_ns, one.input_start_ns)
    return None


def _since(row: "UnansweredRow | SaidBefore") -> str | None:
    since: str | None = extra_in(row.extra_json).get(SINCE)
    return since


def of_lines(lines: Iterable[Mapping[str, Any]]) -> dict[str, Standing]:
    """The same of audit lines; those without a date stand by themselves."""
    stands = [
        Stand(line["loop"], seconds_of(line[SINCE]), line["samples"] * interval_s, interval_s)
        for line in lines
        if line[SINCE] is not None and (interval_s := line["sampling_interval_s"]) and _stands(codes_of(line))
    ]
    return _together(stands, {})


def _together(stands: Sequence[Stand], carried: Mapping[str, str]) -> dict[str, Standing]:
    found: dict[str, Standing] = {}
    for group in stood_together(stands):
        told = {"stood_with": len(group.stands) - 1, TOGETHER_SINCE: _iso(group.since_s)}
        for tag in (stand.tag for stand in group.stands):
            since = {SINCE: carried[tag]} if tag in carried else {}
            found[tag] = Standing(since | told, with_others(group, tag), group.chance_probability)
    return found


def _stands(reasons: Sequence[str]) -> bool:
    """A PV that moves, and answers no more, did so some time after its stem stuck: that hour tells of no other loop."""
    return ANSWERS_NO_MORE not in reasons


def _iso(seconds: float) -> str | None:
    return iso_utc(EPOCH + timedelta(milliseconds=round(1000.0 * seconds)))
