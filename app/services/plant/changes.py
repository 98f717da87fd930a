"""Which verdicts are other ones than before, and why."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from app.engine.judgement import UNCOUPLED, WOUND_UP
from app.engine.long_records.episodes import BEGAN
from app.services.backend import Backend
from app.services.moments import PlantClock, iso_utc
from app.services.plant.evidence_moved import moved, probability_moved
from app.services.plant.judged import ToManual, to_manual
from app.services.plant.stood_together import ALONE, AsOne
from app.services.results import ChangedBy, ChangeView, Kind
from app.services.telling.reasons import extra_in
from app.services.telling.repair_sides import BEFORE_REPAIR, SINCE_REPAIR
from app.services.telling.stored_evidence import began_at
from app.services.telling.wording import UNANSWERED, WHY_WORDS, cause_words, codes_in, weakly
from app.storage import changes as changed_verdicts
from app.storage import plant
from app.storage.changes import ChangedRow, SecondNight

LISTED_CHANGES = 200
FILLED_MORE = 0.05
FEWER_SAMPLES = 0.8
SECOND_NIGHT = "said for the second night"
NEWS_FROM = 0.3
"""By so much the probability has moved where a change that is not to be relied on is news."""
TOLD_FIRST: dict[Kind, int] = {"new": 0, "cured": 1, "flipped": 1, "wavers": 2}
LONGER_WORDS = "more data than before"
OF_REPAIRS = {SINCE_REPAIR, BEFORE_REPAIR}
UNDECIDED_BY = {
    WOUND_UP: ("OP stays at its limit, and PV does not come back", "OP is no longer at its limit"),
    UNCOUPLED: ("PV and OP are unrelated", "PV and OP are related again"),
}
"""Reasons that nothing can be told of a valve, whatever the probability: what is said where one comes, and goes."""


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


def changes(backend: Backend, limit: int = LISTED_CHANGES, together: AsOne = ALONE) -> Changes:
    """together: loops that are told of as one: of those that changed the change of the weightiest is told."""
    with backend.database.read() as connection:
        run = plant.last_whole_run(connection)
        if run is None:
            return Changes(None, None, [], False)
        # In a plant's first run every verdict is new: that is no news, but what came since is.
        first = not plant.any_run_before(connection, run.id)
        since = run.id + 1 if first else run.id
        compared = not first or plant.any_run_since(connection, run.id)
        changed = together.among(changed_verdicts.tags_since_run(connection, since, list(together.ids.values())))
        found = changed_verdicts.since_run(connection, since, limit + 1, changed.left_out) if compared else []
        again = changed_verdicts.second_nights(connection, run.id, limit) if compared and not first else []
    told = [for_all(change_of(row, backend.clock), changed) for row in found[:limit]]
    rows = news_first([*told, *second_night(again, found, backend.clock)])
    manual = to_manual(backend, since, and_since=True) if compared else []
    return Changes(str(run.id), iso_utc(run.created_at), rows, len(found) > limit, compared, manual, first)


def for_all(change: ChangeView, together: AsOne) -> ChangeView:
    """Said of the loop that speaks for those that came to stand with it, as far as they are listed."""
    group = together.by_tag.get(change.loop)
    if group is None:
        return change
    more = f"{len(group.others):,} more with it: " if group.others else ""
    return replace(change, because=f"{change.because}; {more}{group.words}")


def news_first(changes: Sequence[ChangeView]) -> list[ChangeView]:
    """Valves that are newly said to stick are listed first, and what wavers behind all that is news."""
    return sorted(changes, key=lambda change: TOLD_FIRST[change.kind])


def kind_of(row: ChangedRow) -> Kind:
    """new: it is now said to stick. cured: it was, and now it is said not to. wavers: no news. flipped: any other."""
    if _wavers(row, _why(row)):
        return "wavers"
    if row.verdict == "stiction":
        return "new"
    return "cured" if row.verdict_before == "stiction" and row.verdict == "no_stiction" else "flipped"


def second_night(again: Sequence[SecondNight], changed: Sequence[ChangedRow], clock: PlantClock) -> list[ChangeView]:
    """Those of `changed_verdicts.second_nights` that are news, and that have not changed since."""
    since = {row.tag for row in changed}
    return [told for one in again if one.changed.tag not in since and (told := of_second_night(one, clock)) is not None]


def of_second_night(night: SecondNight, clock: PlantClock) -> ChangeView | None:
    """A change that wavered the night before and stands: news now. None where it was news then."""
    if _is_far(night.changed.probability_before, night.probability_between):
        return None
    told = change_of(night.changed, clock)
    return replace(told, kind="new", because=f"{SECOND_NIGHT}; {told.because}")


def change_of(row: ChangedRow, clock: PlantClock) -> ChangeView:
    why = _why(row)
    verdicts_told = (row.verdict_before, row.verdict, why, _because(why, row, clock))
    of_now = (row.reasons_text, row.health, row.reliability, row.likely_cause)
    said = row._asdict() | {"stiction_probability": row.probability}
    return ChangeView(row.tag, row.unit, kind_of(row), *verdicts_told, *of_now, weakly=weakly(said))


def _wavers(row: ChangedRow, why: ChangedBy) -> bool:
    """Whether a change is that of a loop on the edge: not to be relied on, and its probability has hardly moved. A
    valve that began to stick, a PV that never answers, and what has left no probability to decide by, are news all the
    same."""
    if why not in ("loop", "data") or row.reliability == "reliable" or row.likely_cause == UNANSWERED:
        return False
    if _undecided(row):
        return False
    return not _is_far(row.probability_before, row.probability) and BEGAN not in codes_in(row.reasons)


def _is_far(before: float | None, now: float | None) -> bool:
    """Whether a probability has moved far enough to be news."""
    return before is not None and now is not None and abs(now - before) >= NEWS_FROM


def _why(row: ChangedRow) -> ChangedBy:
    """Another engine or configuration is the method; a record much poorer, shorter or longer is the data."""
    if row.verdict_before is None:
        return "first"
    if row.engine_changed or row.config_changed:
        return "method"
    new = set(codes_in(row.reasons)) - set(codes_in(row.reasons_before))
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


def _longer(row: ChangedRow) -> bool:
    return row.samples_ratio is not None and row.samples_ratio > 1 / FEWER_SAMPLES


def _because(why: ChangedBy, row: ChangedRow, clock: PlantClock) -> str:
    """Where the record is why, what of it moved most comes first: that more was recorded makes no valve stick."""
    evidence = (_undecided(row) or moved(row)) if why in ("loop", "data") else ""
    if why == "loop" and not _answers_no_more(row):
        if BEGAN in codes_in(row.reasons):
            return _began(row, clock)
        return evidence or probability_moved(row) or WHY_WORDS["loop"]
    words = _cause(why, row)
    return f"{evidence}; {words}" if evidence else words


def _undecided(row: ChangedRow) -> str:
    """What has made a verdict one that cannot tell, or has let it tell again, where that is not the probability."""
    now, before = codes_in(row.reasons), codes_in(row.reasons_before)
    for code, (comes, goes) in UNDECIDED_BY.items():
        if row.verdict == "inconclusive" and code in now and code not in before:
            return comes
        if row.verdict_before == "inconclusive" and code in before and code not in now:
            return goes
    return ""


def _answers_no_more(row: ChangedRow) -> bool:
    return bool(row.likely_cause == UNANSWERED != row.likely_cause_before)


def _began(row: ChangedRow, clock: PlantClock) -> str:
    start = extra_in(row.extra_json).get("episode_start")
    began = began_at({"episode_start": start, "reasons_text": row.reasons_text}, clock)
    return f"began to stick {began or 'within the record'}"


def _cause(why: ChangedBy, row: ChangedRow) -> str:
    if why in ("loop", "data") and _answers_no_more(row):
        return cause_words(UNANSWERED)
    if why == "data" and _longer(row):
        return LONGER_WORDS
    if why != "auditable":
        return WHY_WORDS[why]
    if row.verdict == "not_auditable":
        return f"cannot be audited now: {cause_words(row.likely_cause or 'data')}"
    return f"could not be audited before: {cause_words(row.likely_cause_before or 'data')}"
