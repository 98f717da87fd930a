"""What to do first in the plant: one list over all units, with what wants a look today at its head."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import takewhile
from typing import Any

from app.engine.codes import NO_ANSWER_VERDICTS
from app.engine.long_records.episodes import BEGAN
from app.services.backend import Backend
from app.services.moments import PlantClock
from app.services.plant.judged import Judged, judged
from app.services.plant.listing import Listing
from app.services.plant.nights import Night, Onset, nights, onsets
from app.services.plant.repaired import repairs
from app.services.plant.stood_together import Together
from app.services.plant.worst import asked_today, listed
from app.services.stating.shelving import Shelved
from app.services.telling.naming import named
from app.services.telling.next_steps import Step
from app.services.telling.reasons import SINCE
from app.services.telling.wording import VERDICT_WORDS, brief, codes_of, looked_at_today
from app.storage.asked_rows import RowFilter

MOST, MOST_TODAY = 10, 5
LOOKED_AT = 200
FIRST_SAID, OR_BEFORE = "first said on", " or before"
FROM_THE_FIRST = "said since its first night,"
"""Of a loop of which nothing else is on record: what came before it nobody knows."""
BEFORE_THE_DATE = re.compile(r"^\D*")


@dataclass(frozen=True)
class Work:
    """A loop and what to do about it. size: S, the deadband plus stickband, empty where it is not measured; since: how
    long the same was said of it; judged: of which time its verdict is, where not up to its newest samples; shelved:
    until when it is shelved, and why it is listed all the same; written: its work order and repair. stood_with: the
    other loops that came to stand with it, which are not listed for themselves; together: what is said of them all.
    owner: who looks after it."""

    loop: str
    unit: str | None
    verdict: str
    told: str
    step: Step
    size: str
    since: str
    written: str
    reliability: str = "not_reliable"
    judged: str = ""
    shelved: str = ""
    stood_with: tuple[str, ...] = ()
    together: str = ""
    owner: str = ""

    @property
    def facts(self) -> str:
        """All but the step, in one line."""
        others = f"with it {named(self.stood_with)}" if self.stood_with else ""
        told = (self.together, others, self.size, self.since, self.judged, self.shelved, self.written)
        whose = f"looked after by {self.owner}" if self.owner else ""
        return "; ".join(one for one in (*told, whose) if one)


def work_list(backend: Backend, by: Listing, most: int = MOST, besides: Sequence[str] = ()) -> list[Work]:
    """Repairs that did not help come first, then what wants a look today, which begins with the newest; in the other
    parts those come first that lack most to full health, times their importance. Loops that came to stand together are
    listed once. besides: tags of valves that are listed at the end if nowhere else."""
    audit_id, together = by.audit_id, by.together

    def told_of(limit: int, asked: RowFilter) -> list[Work]:
        rows = listed(backend, by, limit, replace(asked, recorded_from_ns=by.since_ns)) if limit else []
        tags = [row["loop"] for row in rows]
        last, of_time = nights(backend, tags, audit_id), judged(backend, tags, audit_id)
        began = onsets(backend, tags, audit_id)

        def told(row: Mapping[str, Any]) -> Work:
            tag = row["loop"]
            since = _since(row, last.get(tag, ()), backend.clock, began.get(tag))
            work = _work(row, since, of_time.get(tag), by.shelf.of(tag), backend.clock)
            return work if tag not in together.by_tag else _for_all(work, together.by_tag[tag], backend.clock)

        return [told(row) for row in rows]

    failed = [repair.loop for repair in repairs(backend, audit_id, by.notes_until).listed if repair.outcome == "sticks"]
    sticks = RowFilter(verdict=("stiction",))
    work = told_of(most, replace(sticks, tags=tuple(failed), reliability="reliable")) if failed else []
    again = {one.loop for one in work}
    today = told_of(LOOKED_AT, asked_today(by.since_ns))
    work += sorted(today, key=lambda one: BEFORE_THE_DATE.sub("", one.since), reverse=True)[
        : min(MOST_TODAY, most - len(work))
    ]
    for reliability in ("reliable", "not_reliable"):
        room = most - len(work)
        sticking = told_of(room and room + len(again), replace(sticks, reliability=reliability))
        work += [one for one in sticking if one.loop not in again][:room]
    # Of these valves, which stick, `most` may have left no room.
    left = tuple(sorted(set(besides) - {one.loop for one in work}))
    return work + (told_of(len(left), replace(sticks, tags=left)) if left else [])


def _work(
    row: Mapping[str, Any], since: str, of_time: Judged | None, shelved: Shelved | None, clock: PlantClock
) -> Work:
    # What is said of a shelving names the order that it was shelved with.
    told = shelved is not None and shelved.work_order == row["work_order"]
    written = [f"work order {row['work_order']}"] if row["work_order"] and not told else []
    written += [f"repaired {clock.short(row['repaired_at'])}"] if row["repaired_at"] else []
    return Work(
        loop=row["loop"],
        unit=row["unit"],
        verdict=row["verdict"],
        reliability=row["reliability"],
        told=f"{VERDICT_WORDS[row['verdict']]}, {brief(row)}",
        step=row["step"],
        size=_size(row),
        since=since,
        written=", ".join(written),
        judged=of_time.words(clock) if of_time else "",
        shelved=row["shelved"] or "",
        owner=row["owner"] or "",
    )


def _for_all(work: Work, of_all: Together, clock: PlantClock) -> Work:
    """Of the loop that speaks for those that came to stand with it."""
    since = f"since {clock.short(of_all.since)}"
    return replace(work, unit=of_all.unit, since=since, stood_with=of_all.others, together=of_all.words)


def _size(row: Mapping[str, Any]) -> str:
    size, of_span = row["stiction_S"], row["stiction_S_pct_of_span"]
    if size is None or row["verdict"] != "stiction":
        return ""
    return f"S {size:.3g} units of OP" if of_span is None else f"S {of_span:.1f} % of OP's span"


def _since(row: Mapping[str, Any], last: Sequence[Night], clock: PlantClock, onset: Onset | None = None) -> str:
    """Where PV does not answer, since when, if that was seen; of a valve that sticks, when it began to, as its first
    verdict told it; else the first of the nights that said the same, which is when that was said, not when it began.
    Where a repair came in between that is told."""
    unanswered_since = row.get(SINCE)
    if looked_at_today(row) and unanswered_since and clock.dated(unanswered_since):
        return f"since {clock.short(unanswered_since)}"
    if row["verdict"] == "stiction" and onset is not None:
        return _since_onset(row, last, clock, onset)
    if BEGAN in codes_of(row) and row["episode_start"]:
        return f"since {clock.short(row['episode_start'])}"
    return _since_night(row, last, clock)


def _since_night(row: Mapping[str, Any], last: Sequence[Night], clock: PlantClock) -> str:
    alike = NO_ANSWER_VERDICTS if looked_at_today(row) else (row["verdict"],)
    same = list(takewhile(lambda night: night.verdict in alike, reversed(last)))
    if not same:
        return ""
    day = same[-1].date
    over = _over(row, day, clock)
    if same[-1].is_first:
        return f"{FROM_THE_FIRST} {day}{over}"
    return f"{FIRST_SAID} {day}{OR_BEFORE if len(same) == len(last) else ''}{over}"


def _since_onset(row: Mapping[str, Any], last: Sequence[Night], clock: PlantClock, onset: Onset) -> str:
    """Where the nights of a tag before this one said the same, it is older than the loop's own first verdict."""
    day = clock.date(datetime.fromisoformat(onset.at))
    if onset.first and last and last[0].date < day:
        return _since_night(row, last, clock)
    if onset.seen:
        began = clock.short(onset.at)
        return f"since {began}{_over(row, began, clock)}"
    return f"{FROM_THE_FIRST if onset.first else FIRST_SAID} {day}{_over(row, day, clock)}"


def _over(row: Mapping[str, Any], since: str, clock: PlantClock) -> str:
    """Of a valve that sticks since a day or a time before its repair."""
    if row["verdict"] != "stiction" or not row["repaired_at"] or row["of_before_repair"]:
        return ""
    at = datetime.fromisoformat(row["repaired_at"])
    return f", still after the repair of {clock.date(at)}" if since[:10] < clock.date(at) else ""
