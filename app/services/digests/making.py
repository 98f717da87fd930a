"""The digest of a run: read from the tables, and put into words."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

from sqlalchemy import Connection

from app.counting import counted
from app.errors import RequestError
from app.services.addresses import loop_address
from app.services.audit_json.rows import OLD
from app.services.auditing.audits import get_audit
from app.services.backend import Backend
from app.services.cursors import identifier
from app.services.digests.digest import NOTHING_CHANGED, Area, Changed, Digest, DigestLoop, Unlisted
from app.services.moments import PlantClock, moment_of
from app.services.outward import AuditOut
from app.services.plant.arrivals import arrivals
from app.services.plant.changes import TOLD_FIRST, change_of, for_all, kind_of, second_night
from app.services.plant.judged import Judged, ToManual, judged, to_manual
from app.services.plant.listing import listing
from app.services.plant.overview import cause_of_refusal, tally
from app.services.plant.repaired import Repairs, repairs
from app.services.plant.silent import of_run
from app.services.plant.stood_together import AsOne
from app.services.plant.told_until import run_to_work_by
from app.services.plant.work_list import Work, work_list
from app.services.plant.worst import complaints_of_old, complaints_of_units
from app.services.recency import LATE, OLD_FROM
from app.services.stating.shelving import Shelf
from app.services.telling.naming import one_line
from app.services.telling.reasons import reasons_of
from app.services.telling.wording import PRIOR_ONLY, VERDICT_WORDS, codes_of
from app.storage import changes, digests, plant, set_apart
from app.storage.digests import CountRow, RefusedRow, ToBeDone
from app.storage.set_apart import SetApart

TOP = 5
CHANGES = 30
ALL_WORK = 200
LONGEST_WHY = 200


def run_to_tell(backend: Backend) -> str:
    """As `run_to_work_by`. Raises RequestError("no_run")."""
    with backend.database.read() as connection:
        number = run_to_work_by(connection)
    if number is None:
        raise RequestError("no_run", "no audit has ended yet; `loopaudit nightly` runs one")
    return str(number)


def _changed(connection: Connection, number: int, clock: PlantClock, together: AsOne) -> Changed:
    """Those that are newly said to stick are told whatever else changed; what wavers comes last. Of loops that came to
    stand together and changed the change of the weightiest is told."""
    found = changes.of_run(connection, number)
    again = {one.loop: one for one in second_night(changes.second_nights(connection, number, CHANGES), found, clock)}
    kinds = {row.tag: kind_of(row) for row in found} | {tag: one.kind for tag, one in again.items()}
    changed = together.among(kinds)
    others = changed.others
    tags = sorted((tag for tag in kinds if tag not in others), key=lambda tag: TOLD_FIRST[kinds[tag]])
    listed, besides = tags[:CHANGES], tags[CHANGES:]
    rows = changes.of_run_in_full(connection, number, [tag for tag in listed if tag not in again])
    told = {row.tag: for_all(change_of(row, clock), changed) for row in rows} | again
    new_besides = [tag for tag in besides if kinds[tag] == "new"]
    shown = [told[tag] for tag in listed if tag in told]
    return Changed(shown, new_besides, len(besides) + len(others) - len(new_besides))


def ended_run(backend: Backend, audit_id: str) -> AuditOut:
    """The run, where it has a digest. Raises NotFoundError("unknown_audit") and RequestError("run_goes_on")."""
    run = get_audit(backend, audit_id)
    if not run.ended:
        raise RequestError(
            "run_goes_on", f"the run {run.id} has not ended yet: {counted(run.open, 'loop is', 'loops are')} open"
        )
    return run


def digest_of(backend: Backend, audit_id: str) -> Digest:
    """Raises as `ended_run`."""
    return _made(_read(backend, ended_run(backend, audit_id)), backend.clock)


@dataclass(frozen=True)
class _Read:
    """What a digest is made of. worst: by unit; of_time: by tag, of those of `worst` and `old`."""

    plant: str
    url: str
    run: AuditOut
    since_ns: int | None
    arrivals: list[str]
    shelf: Shelf
    compared: bool
    changed: Changed
    counted: list[CountRow]
    apart: list[SetApart]
    worst: list[tuple[str | None, list[dict[str, Any]]]]
    old: list[dict[str, Any]]
    of_time: dict[str, Judged]
    not_auditable: list[RefusedRow]
    to_be_done: list[ToBeDone]
    retired: int
    work: list[Work]
    to_manual: list[ToManual]
    repairs: Repairs


def _read(backend: Backend, run: AuditOut) -> _Read:
    number, began = identifier(run.id), datetime.fromisoformat(run.created_at)
    reach = arrivals(backend, number, began)
    since_ns = reach.current_ns
    by = listing(backend, since_ns, number)
    with backend.database.read() as connection:
        counted = digests.counts_of(connection, number)
        apart = set_apart.of_run(connection, number, OLD_FROM, by.notes_until)
        retired = digests.retired_since(connection, number)
        not_auditable = digests.refused_of(connection, number, TOP, by.shelf.left_out)
        # In a plant's first run every verdict is new: that is no news.
        compared = plant.any_run_before(connection, number)
        changed = _changed(connection, number, backend.clock, by.together) if compared else NOTHING_CHANGED
        to_be_done = digests.to_be_done(connection, number, since_ns, by.left_out)
    worst, old = complaints_of_units(backend, by, TOP), complaints_of_old(backend, by, TOP)
    tags = [row["loop"] for rows in (*(rows for _, rows in worst), old) for row in rows]
    besides = sorted(changed.new)
    return _Read(
        plant=backend.settings.plant,
        url=backend.settings.public_url,
        run=run,
        since_ns=since_ns,
        arrivals=of_run(backend, number, began, reach),
        shelf=by.shelf,
        compared=compared,
        changed=changed,
        counted=counted,
        apart=apart,
        worst=worst,
        old=old,
        of_time=judged(backend, tags, number),
        not_auditable=not_auditable,
        to_be_done=to_be_done,
        retired=retired,
        work=work_list(backend, by, ALL_WORK, besides),
        to_manual=to_manual(backend, number) if compared else [],
        repairs=repairs(backend, number, by.notes_until),
    )


def _made(read: _Read, clock: PlantClock) -> Digest:
    told = tally(read.counted, read.apart)
    refused_loops: dict[str, list[str]] = {}
    for row in read.not_auditable:
        refused_loops.setdefault(cause_of_refusal(row.likely_cause), []).append(row.tag)

    def loop_of(row: Mapping[str, Any]) -> DigestLoop:
        of_time = read.of_time.get(row["loop"])
        return _loop(row, read.url, of_time.words(clock) if of_time else "")

    return Digest(
        plant=read.plant,
        run=read.run,
        verdicts=told.verdicts,
        refused=told.refused,
        refused_loops=refused_loops,
        arrivals=read.arrivals,
        work=read.work,
        unlisted=_unlisted(read.to_be_done, read.work),
        areas=[Area(unit, [loop_of(row) for row in rows]) for unit, rows in read.worst],
        old=[replace(loop_of(row), recorded_to=row["recorded_to"], of_old_record=row[OLD]) for row in read.old],
        changed=read.changed,
        to_manual=_manual_words(read.to_manual, clock),
        repairs=read.repairs.listed,
        more_repairs=read.repairs.more,
        shelf=read.shelf,
        compared=read.compared,
        public_url=read.url,
        clock=clock,
        retired=read.retired,
        why_old=_why_old(read.since_ns, clock) if read.old else "",
        reliable=told.sticking,
    )


def _manual_words(found: Sequence[ToManual], clock: PlantClock) -> list[str]:
    return [
        f"{one_line(one.loop)}: went to manual (automatic -> manual); its verdict, {VERDICT_WORDS[one.verdict]}, is "
        f"from before that: {one.judged.words(clock)}"
        for one in found[:CHANGES]
    ]


def _loop(row: Mapping[str, Any], url: str, of_time: str) -> DigestLoop:
    return DigestLoop(
        loop=row["loop"],
        verdict=row["verdict"],
        reliability=row["reliability"],
        stiction_probability=row["stiction_probability"],
        likely_cause=row["likely_cause"],
        health=row["health"],
        importance=row["importance"],
        why=reasons_of(row)[0][:LONGEST_WHY],
        address=loop_address(url, row["loop"]),
        judged=of_time,
        measured=PRIOR_ONLY not in codes_of(row),
        shelved=row["shelved"] or "",
        of_before_repair=row["of_before_repair"],
    )


def _unlisted(to_be_done: Sequence[ToBeDone], work: Sequence[Work]) -> Unlisted:
    counted, listed = Counter[str](), Counter(_counted_as(one.verdict, one.reliability) for one in work)
    for row in to_be_done:
        counted[_counted_as(row.verdict, row.reliability)] += row.loops
    return Unlisted(**(counted - listed))


def _counted_as(verdict: str, reliability: str) -> str:
    """Of what there is something to do about: where the valve is not said to stick, PV does not answer OP."""
    if verdict != "stiction":
        return "unanswered"
    return "reliable" if reliability == "reliable" else "unsure"


def _why_old(since_ns: int | None, clock: PlantClock) -> str:
    """Since when they are old, and why they have a list of their own."""
    if since_ns is None:
        return ""
    return (
        f"no sample since {clock.told_at(moment_of(since_ns))}, {LATE.days} days before the newest of the plant, or "
        "without a date; their verdicts date from then"
    )
