"""Verdicts of last night may rest on records of months ago: the plant says how far they reach, and who is behind."""

import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest
from sqlalchemy import select, update

from app.services.auditing.audits import LoopFilter, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.backend import Backend
from app.services.digests.making import digest_of
from app.services.digests.telling import as_html, as_text
from app.services.moments import UTC_CLOCK, iso_utc, moment_of, ns_of
from app.services.plant import worst
from app.services.plant.arrivals import (
    NOTHING_NEW,
    NOTHING_NEW_THEN,
    Arrivals,
    arrivals,
    current_ns,
    newest_in_words,
    nothing_new,
)
from app.services.plant.arrivals import sentences as sentences_by
from app.services.plant.listing import listing
from app.services.plant.plant_sheet import plant_sheet
from app.services.plant.silent import of_run
from app.services.recency import LATE
from app.services.reports.documents import plant_report
from app.services.telling.naming import NAMED
from app.storage import arrivals as stored
from app.storage import series
from app.storage.samples import Samples
from app.storage.series import Stretch
from app.storage.tables import loops, newest_rows, verdicts
from tests.services.conftest import MINUTE, START_NS
from tests.services.sent_uploads import read, send

AddLoops = Callable[..., dict[str, int]]
NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)


def sentences(found: Arrivals) -> list[str]:
    return sentences_by(found, UTC_CLOCK)


@pytest.fixture
def ends(backend: Backend, add_loops: AddLoops) -> Callable[..., None]:
    """Sets when the records of loops end, in days before NOON."""

    def set_ends(**days_before: float) -> None:
        ids = add_loops(*days_before)
        with backend.database.write() as connection:
            for tag, days in days_before.items():
                end_ns = ns_of(NOON - timedelta(days=days))
                connection.execute(update(loops).where(loops.c.id == ids[tag]).values(newest_ns=end_ns))

    return set_ends


def test_a_plant_without_records_says_nothing(backend: Backend) -> None:
    assert arrivals(backend) == Arrivals(None, timedelta(0), 0, ())
    assert sentences(arrivals(backend)) == []


def test_records_of_last_night(backend: Backend, ends: Callable[..., None]) -> None:
    ends(A=0.2, B=1.0)
    found = arrivals(backend, at=NOON)
    assert (found.late, found.behind) == (False, 0)
    assert sentences(found) == ["Recorded up to 2026-03-01 07:12 UTC."]


def test_an_export_that_stopped(backend: Backend, ends: Callable[..., None]) -> None:
    ends(A=206, B=206.5)
    found = arrivals(backend, at=NOON)
    assert (found.late, found.behind) == (True, 0)
    assert sentences(found) == ["Recorded up to 2025-08-07 12:00 UTC, 206 days ago: no newer export has arrived."]


def test_loops_that_fell_out_of_the_export_are_named(backend: Backend, ends: Callable[..., None]) -> None:
    ends(A=0.5, B=40, C=1.9)
    found = arrivals(backend, at=NOON)
    assert (found.late, found.behind, [tag for tag, _ in found.named]) == (False, 1, ["B"])
    assert sentences(found)[1] == ("One loop got no samples for two days or more before that: B (2026-01-20 12:00).")


def test_of_many_the_weightiest_are_named(backend: Backend, ends: Callable[..., None]) -> None:
    ends(A=0.5, **{f"L{k}": 10 for k in range(NAMED + 2)})
    with backend.database.write() as connection:
        connection.execute(update(loops).where(loops.c.tag == "L6").values(importance=9.0))
    found = arrivals(backend, at=NOON)
    assert (found.behind, found.named[0][0], len(found.named)) == (NAMED + 2, "L6", NAMED)
    assert sentences(found)[1].endswith(" and 2 more.")
    assert sentences(found)[1].startswith("7 loops got no samples")


def test_a_clock_that_is_ahead_makes_no_other_loop_late(backend: Backend, ends: Callable[..., None]) -> None:
    ends(A=-300, B=0.5)
    found = arrivals(backend, at=NOON)
    assert (found.recorded_to, found.behind) == ("2026-03-01T00:00:00Z", 0)
    told = "One loop has samples ahead of the clock, is their time zone right? A (2026-12-26 12:00)."
    assert sentences(found)[1] == told


def test_a_plant_that_is_all_ahead_of_the_clock_is_told(backend: Backend, ends: Callable[..., None]) -> None:
    ends(A=-1, B=-1)
    (told,) = sentences(arrivals(backend, at=NOON))
    assert told == (
        "2 loops have samples ahead of the clock, is their time zone right? A (2026-03-02 12:00), B (2026-03-02 12:00)."
    )


def test_a_run_is_told_by_what_it_was_given(backend: Backend, add_loops: AddLoops) -> None:
    """What came since then changes nothing of it."""
    ids = add_loops("A", "B")
    run = start_audit(backend)
    audit_chunk(backend, int(run.id), "test")
    at = datetime.fromisoformat(run.created_at)
    before = arrivals(backend, int(run.id), at)
    with backend.database.write() as connection:
        connection.execute(update(loops).where(loops.c.id == ids["A"]).values(newest_ns=ns_of(at)))
    assert arrivals(backend, int(run.id), at) == before
    assert before.recorded_to is not None
    assert before.recorded_to < (arrivals(backend, at=at).recorded_to or "")


def test_a_night_that_nothing_came_for_says_so(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A")
    runs = [start_audit(backend)]
    audit_chunk(backend, int(runs[0].id), "test")
    runs.append(start_audit(backend))
    audit_chunk(backend, int(runs[1].id), "test")
    at = datetime.fromisoformat(runs[1].created_at)
    assert NOTHING_NEW not in of_run(backend, int(runs[0].id), at, arrivals(backend, int(runs[0].id), at))
    assert of_run(backend, int(runs[1].id), at, arrivals(backend, int(runs[1].id), at))[-1] == NOTHING_NEW
    assert plant_sheet(backend, arrivals(backend))["arrivals"][-1] == NOTHING_NEW
    assert NOTHING_NEW in plant_report(backend)
    with backend.database.write() as connection:
        connection.execute(update(loops).values(newest_ns=loops.c.newest_ns + 60 * MINUTE))
    told = plant_sheet(backend, arrivals(backend))["arrivals"]
    assert told[-1] == NOTHING_NEW_THEN, "what is said to be recorded is newer than what the run was given"
    assert of_run(backend, int(runs[1].id), at, arrivals(backend, int(runs[1].id), at))[-1] == NOTHING_NEW


def test_a_digest_asks_once_how_far_records_reach_and_a_page_of_a_loop_for_the_newest_alone(
    backend: Backend, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_loops("A")
    run = start_audit(backend)
    audit_chunk(backend, int(run.id), "test")
    asked: list[str] = []
    for name in ("newest", "ending"):
        monkeypatch.setattr(stored, name, counted(getattr(stored, name), asked))
    digest_of(backend, run.id)
    assert asked == ["newest", "ending", "ending", "ending"]
    asked.clear()
    assert current_ns(backend) == arrivals(backend).current_ns
    assert asked == ["newest", "newest", "ending", "ending", "ending"]


def counted(function: Callable[..., Any], asked: list[str]) -> Callable[..., Any]:
    def called(*given: Any, **named: Any) -> Any:
        asked.append(function.__name__)
        return function(*given, **named)

    return called


def test_a_loop_that_somebody_audited_in_between_does_not_make_a_night_old(
    backend: Backend, add_loops: AddLoops
) -> None:
    ids = add_loops("A", "B")
    audit_chunk(backend, int(start_audit(backend).id), "test")
    steps = START_NS + np.arange(300, 600) * MINUTE
    values = {"pv": 20 + np.sin(np.arange(300) / 6), "op": 50 + np.cos(np.arange(300) / 6)}
    with backend.database.write() as connection:
        series.add(connection, [Stretch(loop, Samples(steps, values)) for loop in ids.values()], None)
    audit_chunk(backend, int(start_audit(backend, LoopFilter(tags=("A",))).id), "test")
    night = start_audit(backend)
    audit_chunk(backend, int(night.id), "test")
    assert nothing_new(backend, int(night.id)) == []


def test_the_age_of_one_loop() -> None:
    def ago(age: timedelta) -> str:
        return iso_utc(moment_of(ns_of(datetime.now(UTC) - age))) or ""

    def told(age: timedelta) -> str:
        return newest_in_words(ago(age), UTC_CLOCK).removeprefix(f"newest sample {UTC_CLOCK.short(ago(age))}")

    assert newest_in_words(None, UTC_CLOCK) == ""
    assert told(timedelta(days=1)) == ""
    assert told(timedelta(seconds=30)) == told(timedelta(minutes=-30)) == ""
    assert told(LATE + timedelta(hours=1)) == ", 2 days ago"
    assert told(timedelta(hours=-24)) == ", ahead of the clock: is its time zone right?"
    assert newest_in_words("1970-01-01T00:16:39Z", UTC_CLOCK).startswith("time of day not known")


def test_a_loop_without_a_date_is_neither_late_nor_what_the_plant_is_recorded_to(
    backend: Backend, add_loops: AddLoops
) -> None:
    ids = add_loops("A", "B")
    with backend.database.write() as connection:
        connection.execute(update(loops).where(loops.c.id == ids["A"]).values(newest_ns=999 * 10**9))
        connection.execute(update(loops).where(loops.c.id == ids["B"]).values(newest_ns=ns_of(NOON)))
    told = "Without a date, because their files give no start: A. No other loop is compared with them."
    assert sentences(arrivals(backend, at=NOON)) == ["Recorded up to 2026-03-01 12:00 UTC.", told]
    with backend.database.write() as connection:
        connection.execute(update(loops).values(newest_ns=999 * 10**9))
    assert arrivals(backend, at=NOON).recorded_to is None


def test_loops_whose_records_are_old_have_a_list_of_their_own(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", "B", "C", "D")
    run = start_audit(backend)
    audit_chunk(backend, int(run.id), "test")
    with backend.database.write() as connection:
        for tag, days in (("A", 0.5), ("B", 40), ("C", 1.9), ("D", 2.6)):
            end_ns = ns_of(NOON - timedelta(days=days))
            connection.execute(update(loops).where(loops.c.tag == tag).values(newest_ns=end_ns))
    since_ns = arrivals(backend, at=NOON).current_ns
    assert {row["loop"] for row in worst.worst(backend, listing(backend, since_ns))} == {"A", "C"}
    assert {row["loop"] for row in worst.worst_of_old(backend, listing(backend, since_ns))} == {"B", "D"}
    assert worst.worst_of_old(backend, listing(backend)) == worst.complaints_of_old(backend, listing(backend)) == []
    with backend.database.write() as connection:
        for row in connection.execute(select(loops.c.id, loops.c.newest_ns)).all():
            mine = update(verdicts).where(verdicts.c.loop_id == row.id)
            connection.execute(mine.values(input_end_ns=row.newest_ns, verdict="stiction"))
        connection.execute(update(newest_rows).values(verdict="stiction"))
    found = digest_of(backend, run.id)
    assert {one.loop for area in found.areas for one in area.loops} == {"A", "C"}
    assert {one.loop for one in found.old} == {"B", "D"}
    text, html = as_text(found), as_html(found)
    title = next(line for line in text.splitlines() if line.startswith("WORST OF OLD RECORDS"))
    assert title.endswith(
        ": no sample since 2026-02-27 00:00 UTC, 2 days before the newest of the plant, or without a date; their "
        "verdicts date from then"
    )
    assert re.search(r"B: valve sticks .*, newest sample 2026-01-20 12:00$", text, flags=re.MULTILINE)
    assert "Worst of old records" in html
    assert "No sample since 2026-02-27 00:00 UTC" in html
    assert "newest sample 2026-01-20 12:00" in html
    ((_, rows),) = worst.complaints_of_units(backend, listing(backend, since_ns), 5)
    assert {row["loop"] for row in rows} == {"A", "C"}


def test_that_no_valve_sticks_is_not_said_where_one_of_an_old_record_does(
    backend: Backend, add_loops: AddLoops
) -> None:
    """Neither in a digest nor in the report of the plant, which lists it."""
    add_loops("A", "B")
    run = start_audit(backend)
    audit_chunk(backend, int(run.id), "test")

    def told(**verdict_of: str) -> tuple[str, str, str]:
        with backend.database.write() as connection:
            for tag, days in (("A", 0.5), ("B", 40)):
                end_ns = ns_of(NOON - timedelta(days=days))
                connection.execute(update(loops).where(loops.c.tag == tag).values(newest_ns=end_ns))
                loop_id = select(loops.c.id).where(loops.c.tag == tag).scalar_subquery()
                for table in (verdicts, newest_rows):
                    said = {"verdict": verdict_of[tag], "likely_cause": None}
                    told = said | ({"input_end_ns": end_ns} if table is verdicts else {})
                    connection.execute(update(table).where(table.c.loop_id == loop_id).values(**told))
        found = digest_of(backend, run.id)
        return as_text(found), as_html(found), plant_report(backend)

    for text in told(A="no_stiction", B="stiction"):
        assert "No other valve sticks, as far as the newest records tell." in text
        assert "No valve sticks" not in text
        assert re.search(r"\bB\b", re.split("worst of old records", text, flags=re.IGNORECASE)[1])
    for text in told(A="no_stiction", B="no_stiction"):
        assert "No valve sticks, as far as the records tell." in text
        assert "worst of old records" not in text.lower()


def test_a_run_and_the_plant_say_the_same_of_a_loop_that_is_ahead_of_the_clock(backend: Backend) -> None:
    """Of such a loop a run is given what is not ahead: that is no newest sample of the plant."""
    now = datetime.now(UTC).replace(microsecond=0)
    for tag, ahead in (("A", timedelta(minutes=-10)), ("B", timedelta(hours=7))):
        first = int((now + ahead).timestamp()) - 5 * 7200
        rows = "".join(f"{first + 5 * k},{k % 7}.5,{k % 5}.5\n" for k in range(7201))
        assert (
            read(backend, send(backend, f"time,{tag}.PV,{tag}.OP\n{rows}".encode(), name=f"{tag}.csv")).state == "done"
        )
    run = start_audit(backend)
    audit_chunk(backend, int(run.id), "test")
    at = datetime.fromisoformat(run.created_at)
    of_plant, of_that_run = arrivals(backend, at=at), arrivals(backend, int(run.id), at)
    assert of_plant.recorded_to == iso_utc(now - timedelta(minutes=10))
    assert (of_plant.ahead, of_plant.named_ahead) == (1, (("B", iso_utc(now + timedelta(hours=7))),))
    assert of_that_run == of_plant
    digest = digest_of(backend, run.id)
    assert digest.arrivals[:2] == sentences(of_plant)
    read(backend, send(backend, f"time,A.PV,A.OP\n{int(now.timestamp()) + 60},1,1\n".encode(), name="later.csv"))
    assert arrivals(backend, int(run.id), at) == of_plant
