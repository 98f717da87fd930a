"""The plant on one page: counts, units, what changed since last night, and the worst loops."""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, Literal

from app.engine.long_records.episodes import BEGAN
from app.services.auditing.audits import get_audit
from app.services.backend import Backend
from app.services.moments import iso_utc
from app.services.plant.evidence_moved import moved, probability_moved
from app.services.plant.judged import ToManual, to_manual
from app.services.plant.reliability import checked, following, place_of, with_loop
from app.services.plant.shelving import Shelf, shelf
from app.services.plant.written import written_of
from app.services.results import AuditView, ChangedBy, ChangeView, Page, UnitView
from app.services.telling.repair_sides import BEFORE_REPAIR, SINCE_REPAIR
from app.services.telling.stored_evidence import began_at
from app.services.telling.wording import UNANSWERED, WHY_WORDS, cause_words
from app.storage import plant, verdicts
from app.storage.loops import count as count_loops
from app.storage.loops import count_retired
from app.storage.verdicts import RowFilter

LISTED_CHANGES = 200
WORST = 12
MOST_TILES = 400  # what a browser lays out and paints at once
LEAST_TILES = 3
FILLED_MORE = 0.05
FEWER_SAMPLES = 0.8
SECOND_NIGHT = "said for the second night"
NEWS_FROM = 0.3
"""By so much the probability has moved where a change that is not to be relied on is news."""
BEGAN_WORDS = "began to stick"
LONGER_WORDS = "more was recorded than before"
OF_REPAIRS = {SINCE_REPAIR, BEFORE_REPAIR}


@dataclass(frozen=True)
class Overview:
    """Counts over the newest verdict of each loop in service; `refused` is why loops are not auditable, by likely
    cause; `retired`: how many loops are left out."""

    loops: int
    audited: int
    verdicts: dict[str, int]
    reliable: dict[str, int]
    refused: dict[str, int]
    units: list[UnitView]
    health: float | None
    retired: int = 0


@dataclass(frozen=True)
class Changes:
    """What became of verdicts in the newest whole run (and since then), against each loop's verdict before. to_manual:
    loops that went to manual, whose verdict is the one of before. first: the run is the plant's first, and what is told
    is what came since."""

    run_id: str | None
    run_at: str | None
    rows: list[ChangeView]
    more: bool
    compared: bool = True
    to_manual: Sequence[ToManual] = ()
    first: bool = False


def overview(backend: Backend) -> Overview:
    with backend.database.read() as connection:
        known, counted = count_loops(connection), plant.counts(connection)
        retired = count_retired(connection)
    verdict_count, reliable, refused = Counter[str](), Counter[str](), Counter[str]()
    for row in counted:
        verdict_count[row.verdict] += row.loops
        reliable[row.verdict] += row.loops * (row.reliability == "reliable")
        if row.verdict == "not_auditable":
            refused[row.likely_cause or "data"] += row.loops
    return Overview(
        loops=known,
        audited=verdict_count.total(),
        verdicts=dict(verdict_count),
        reliable=dict(reliable),
        refused=dict(refused.most_common()),
        units=_units(counted),
        health=_mean_health(counted),
        retired=retired,
    )


def changes(backend: Backend, limit: int = LISTED_CHANGES) -> Changes:
    with backend.database.read() as connection:
        run = plant.last_whole_run(connection)
        if run is None:
            return Changes(None, None, [], False)
        # In a plant's first run every verdict is new: that is no news, but what came since is.
        first = not plant.any_run_before(connection, run.id)
        since = run.id + 1 if first else run.id
        compared = not first or plant.any_run_since(connection, run.id)
        found = plant.changes(connection, since, limit + 1) if compared else []
        again = plant.second_nights(connection, run.id, limit) if compared and not first else []
    rows = quiet_last([*(change_of(row) for row in found[:limit]), *second_night(again, found)])
    manual = to_manual(backend, since, and_since=True) if compared else []
    return Changes(str(run.id), iso_utc(run.created_at), rows, len(found) > limit, compared, manual, first)


def listed_first(
    backend: Backend, since_ns: int | None, changed: Changes | None = None
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """What the plant's page lists at its head: the loops to look at today, and the worst of the others."""
    today = look_today(backend, changed, since_ns)
    return today, worst(backend, beside={row["loop"] for row in today}, since_ns=since_ns)


def worst_tags(backend: Backend, since_ns: int | None, shelved: Shelf) -> list[str]:
    """The tags of what `listed_first` lists as the worst, in its order, from the narrow rows alone."""
    with backend.database.read() as connection:

        def first(limit: int, asked: RowFilter) -> list[str]:
            wanted = replace(asked, left_out=shelved.left_out)
            return [row.tag for row in verdicts.sent_rows(connection, limit, "priority", True, wanted, None)]

        today = set(first(LISTED_CHANGES, _asked_today(since_ns)))
        found = first(WORST + len(today), RowFilter(recorded_from_ns=since_ns))
    return [tag for tag in found if tag not in today][:WORST]


def look_today(backend: Backend, changed: Changes | None, since_ns: int | None = None) -> list[dict[str, Any]]:
    """The loops in which PV does not answer OP, those first of which that is news, without those that are shelved;
    since_ns: as of `worst`."""
    news = {row.loop for row in changed.rows} if changed else set()
    rows = not_shelved(backend, LISTED_CHANGES, _asked_today(since_ns))
    return sorted(rows, key=lambda row: row["loop"] not in news)


def _asked_today(since_ns: int | None) -> RowFilter:
    refused = ("inconclusive", "not_auditable")
    return RowFilter(verdict=refused, likely_cause=UNANSWERED, recorded_from_ns=since_ns)


def worst(
    backend: Backend, limit: int = WORST, beside: Collection[str] = (), since_ns: int | None = None
) -> list[dict[str, Any]]:
    """The loops at the head of the list by what is missing to full health x importance, without those that are
    shelved; `beside`: tags of those that are listed elsewhere; since_ns: only loops with a sample as new as that."""
    rows = not_shelved(backend, limit + len(beside), RowFilter(recorded_from_ns=since_ns))
    return [row | {"of_old_record": False} for row in rows if row["loop"] not in beside][:limit]


def worst_of_old(backend: Backend, since_ns: int | None, limit: int = WORST) -> list[dict[str, Any]]:
    """The same of the loops that are left out there: what is said of them is of an old record."""
    found = [] if since_ns is None else not_shelved(backend, limit, RowFilter(recorded_before_ns=since_ns))
    return [row | {"of_old_record": True} for row in found]


def nothing_worst(sticking: int, old: bool) -> str:
    """What is said where no loop is listed as a worst one. sticking: how many verdicts say that the valve sticks; those
    are shelved, or of old records, which have a list of their own (`old`)."""
    if not sticking:
        return "No valve sticks, as far as the records tell."
    return f"No other valve sticks, as far as the {'newest ' if old else ''}records tell."


def not_shelved(
    backend: Backend, limit: int, asked: RowFilter, shelved: Shelf | None = None, notes_until: datetime | None = None
) -> list[dict[str, Any]]:
    """Rows of `table`, the weightiest first, without loops that are shelved; one that is worse than when it was shelved
    is among them, and says so (`shelved`)."""
    known = shelf(backend) if shelved is None else shelved
    wanted = replace(asked, left_out=known.left_out)
    return table(backend, limit, filters=wanted, shelved=known, notes_until=notes_until).rows


def table(
    backend: Backend,
    limit: int,
    cursor: str | None = None,
    sort: str = "-priority",
    filters: RowFilter | None = None,
    shelved: Shelf | None = None,
    notes_until: datetime | None = None,
) -> Page[dict[str, Any]]:
    """Rows of the reliability table with what a page shows besides: importance and priority, what to do, and what is
    written of an order or a repair (until `notes_until`) or a shelving (as of `shelved`; None: of now)."""
    name = checked(limit, sort)
    asked = place_of(cursor)
    with backend.database.read() as connection:
        place = asked[1] if asked is not None and asked[0] == sort else None
        found = verdicts.table(connection, limit + 1, name, sort.startswith("-"), filters or RowFilter(), place)
    shown = [with_loop(row) for row in found[:limit]]
    written = written_of(backend, shown, shelved, notes_until)
    told = [{**written.beside(row), "shelved": written.shelved_words(row)} for row in shown]
    return Page(told, following(found, limit, sort))


def tiles(backend: Backend) -> dict[str, list[Any]]:
    """For the treemap: units (name, loops, importance, health) and their worst loops (tag, unit, importance, verdict,
    health), so many in all as can be drawn at once; `unit_tiles` has the others."""
    with backend.database.read() as connection:
        units = _units(plant.counts(connection))
        each = max(LEAST_TILES, MOST_TILES // max(len(units), 1))
        loops = plant.worst_of_units(connection, each)
    return {
        "units": [[unit.unit, unit.loops, unit.importance, unit.health] for unit in units],
        "loops": [list(row) for row in loops],
    }


def unit_tiles(backend: Backend, unit: str | None) -> dict[str, list[Any]]:
    """The worst loops of one unit (None: of those that name none), as `tiles` has them."""
    with backend.database.read() as connection:
        return {"loops": [list(row) for row in plant.worst_of_unit(connection, unit, MOST_TILES)]}


def unit_names(backend: Backend) -> list[str]:
    with backend.database.read() as connection:
        return plant.units(connection)


@dataclass(frozen=True)
class RunFigures:
    """What a run came to: verdicts by kind, and how long its loops took."""

    run: AuditView
    verdicts: dict[str, int]
    loops: int
    mean_s: float | None
    longest_s: float | None
    total_s: float | None
    slowest: list[tuple[str, float]]


def run_figures(backend: Backend, audit_id: str) -> RunFigures:
    run = get_audit(backend, audit_id)
    with backend.database.read() as connection:
        took = plant.durations(connection, int(run.id))
        slowest = [(row.tag, row.elapsed_s) for row in plant.slowest(connection, int(run.id), 5)]
        counted = plant.verdict_counts(connection, int(run.id))
    return RunFigures(run, counted, took.loops, took.mean, took.longest, took.total, slowest)


def _units(counted: list[Any]) -> list[UnitView]:
    units: dict[str | None, list[Any]] = {}
    for row in counted:
        units.setdefault(row.unit, []).append(row)
    return [_unit(unit, units[unit]) for unit in sorted(units, key=lambda unit: unit or "")]


def _unit(unit: str | None, rows: list[Any]) -> UnitView:
    counted: Counter[str] = Counter()
    for row in rows:
        counted[row.verdict] += row.loops
    return UnitView(unit, counted.total(), dict(counted), _mean_health(rows), sum(row.importance for row in rows))


def _mean_health(rows: list[Any]) -> float | None:
    """Weighted by importance; loops whose verdict has no health are left out."""
    told = [row for row in rows if row.weighted_health is not None]
    weight = sum(row.weight for row in told)
    return sum(row.weighted_health for row in told) / weight if weight else None


def quiet_last(changes: Sequence[ChangeView]) -> list[ChangeView]:
    """What wavers is listed behind what is news."""
    return sorted(changes, key=lambda change: change.kind == "wavers")


def second_night(again: Sequence[Any], changed: Sequence[Any]) -> list[ChangeView]:
    """Those of `plant.second_nights` that are news, and that have not changed since."""
    since = {row.tag for row in changed}
    return [told for row in again if row.tag not in since and (told := of_second_night(row)) is not None]


def of_second_night(row: Any) -> ChangeView | None:
    """A change that wavered the night before and stands: news now. None where it was news then."""
    before, between = row.probability_before, row.probability_between
    if None not in (before, between) and abs(between - before) >= NEWS_FROM:
        return None
    told = change_of(row)
    return replace(told, kind="new", because=f"{SECOND_NIGHT}; {told.because}")


def change_of(row: Any) -> ChangeView:
    why = _why(row)
    kind = "wavers" if _wavers(row, why) else _kind(row.verdict_before, row.verdict)
    verdicts_told = (row.verdict_before, row.verdict, why, _because(why, row))
    of_now = (row.reasons_text, row.health, row.reliability, row.likely_cause)
    return ChangeView(row.tag, row.unit, kind, *verdicts_told, *of_now)


def _kind(before: str | None, now: str) -> Literal["new", "cured", "flipped"]:
    """new: it is now said to stick. cured: it was, and now it is said not to. flipped: any other change."""
    if now == "stiction":
        return "new"
    return "cured" if before == "stiction" and now == "no_stiction" else "flipped"


def _wavers(row: Any, why: ChangedBy) -> bool:
    """Whether a change is that of a loop on the edge: not to be relied on, and its probability has hardly moved. A
    valve that began to stick, and a PV that never answers, are news all the same."""
    if why not in ("loop", "data") or row.reliability == "reliable" or row.likely_cause == UNANSWERED:
        return False
    probabilities = (row.probability_before, row.probability)
    near = None in probabilities or abs(probabilities[1] - probabilities[0]) < NEWS_FROM
    return near and BEGAN not in row.reasons.split(";")


def _why(row: Any) -> ChangedBy:
    """Another engine or configuration is the method; a record much poorer, shorter or longer is the data."""
    if row.verdict_before is None:
        return "first"
    if row.engine_changed or row.config_changed:
        return "method"
    new = set(row.reasons.split(";")) - set((row.reasons_before or "").split(";"))
    if OF_REPAIRS & new:
        return "repair"
    if BEGAN in new:
        return "loop"
    if "not_auditable" in (row.verdict_before, row.verdict):
        return "auditable"
    poorer = (row.filled_more or 0.0) > FILLED_MORE
    shorter = row.samples_ratio is not None and row.samples_ratio < FEWER_SAMPLES
    resampled = row.interval_ratio is not None and not 0.99 <= row.interval_ratio <= 1.01
    return "data" if poorer or shorter or resampled or _longer(row) else "loop"


def _longer(row: Any) -> bool:
    return row.samples_ratio is not None and row.samples_ratio > 1 / FEWER_SAMPLES


def _because(why: ChangedBy, row: Any) -> str:
    """Where the record is why, what of it moved most comes first: that more was recorded makes no valve stick."""
    words, evidence = _cause(why, row), moved(row) if why in ("loop", "data") else ""
    if words.startswith(BEGAN_WORDS):
        return words
    if words == WHY_WORDS["loop"]:
        return evidence or probability_moved(row) or words
    return f"{evidence}; {words}" if evidence else words


def _cause(why: ChangedBy, row: Any) -> str:
    if why in ("loop", "data") and row.likely_cause == UNANSWERED != row.likely_cause_before:
        return cause_words(UNANSWERED)
    if why == "loop" and BEGAN in row.reasons.split(";"):
        began = began_at(row.reasons_text)
        return f"{BEGAN_WORDS} {began}" if began else f"{BEGAN_WORDS} within the record"
    if why == "data" and _longer(row):
        return LONGER_WORDS
    if why != "auditable":
        return WHY_WORDS[why]
    if row.likely_cause == UNANSWERED == row.likely_cause_before:
        return f"still: {cause_words(UNANSWERED)}"
    if row.verdict == "not_auditable":
        return f"cannot be audited now: {cause_words(row.likely_cause or 'data')}"
    return f"could not be audited before: {cause_words(row.likely_cause_before or 'data')}"
