"""What the plant's page and report say of the newest run: whether the night ran, goes on, or failed in part."""

from datetime import UTC, date, datetime, timedelta

from sqlalchemy import insert, update

from app.services.auditing.audits import LoopFilter, cancel_audit, start_audit
from app.services.auditing.nightly import nightly
from app.services.backend import Backend
from app.services.plant.newest_run import newest_run
from app.services.reports.documents import plant_report
from app.storage.tables import audit_items, audits, loops, uploads
from app.storage.types import now
from tests.services.audited_plant import AddLoops, audited

AN_HOUR = timedelta(hours=1)


def test_a_plant_without_a_run_has_nothing_to_say(backend: Backend) -> None:
    found = newest_run(backend)
    assert (found.run, found.words, found.missed, found.going_on) == (None, "", "", False)


def test_a_run_that_goes_on_stands_before_the_one_that_ended(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", "B", n=600)
    first = start_audit(backend)
    assert newest_run(backend).words.endswith(" is still running, 0 of 2 loops audited")
    cancel_audit(backend, first.id)
    audited(backend)
    assert newest_run(backend).words.endswith(" audited all of its 2 loops")
    third = start_audit(backend)
    start_audit(backend, LoopFilter(tags=("A",)))  # of one loop: it says nothing of the plant
    found = newest_run(backend)
    assert found.going_on
    assert found.words.startswith(f"run {third.id} of ")
    assert found.words.endswith("0 of 2 loops audited; the verdicts of the others are from earlier runs")
    assert found.words in plant_report(backend)
    cancel_audit(backend, third.id)
    assert "was cancelled, 0 of 2 loops audited; " in newest_run(backend).words


def test_one_loop_is_told_as_one(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", n=600)
    first = start_audit(backend)
    assert newest_run(backend).words.endswith(" is still running, 0 of 1 loop audited")
    cancel_audit(backend, first.id)
    audited(backend)
    assert newest_run(backend).words.endswith(" audited its only loop")


def test_loops_that_failed_are_counted(backend: Backend, add_loops: AddLoops) -> None:
    ids = add_loops("A", "B", n=600)
    run = audited(backend)
    failed = (audit_items.c.audit_id == run, audit_items.c.loop_id == ids["B"])
    with backend.database.write() as connection:
        connection.execute(update(audit_items).where(*failed).values(state="failed", code="fault", text="it broke"))
        connection.execute(update(audits).values(state="partial"))
    assert newest_run(backend).words.endswith(" audited 1 of 2 loops, 1 failed")
    assert "1 of 2 loops, 1 failed" in plant_report(backend)


def test_a_night_that_did_not_run_is_said(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", n=600)
    hour = datetime(2026, 3, 2, 2, 0, tzinfo=UTC)
    with backend.database.write() as connection:
        connection.execute(update(loops).values(created_at=hour - 9 * AN_HOUR))
    run = audited(backend)
    told = "The nightly audit of 2026-03-02 02:00 UTC has not run."

    def missed(begun: datetime, now: datetime) -> str:
        with backend.database.write() as connection:
            connection.execute(update(audits).where(audits.c.id == run).values(created_at=begun))
        return newest_run(backend, now).missed

    assert missed(hour - 8 * AN_HOUR, hour + AN_HOUR) == told
    assert missed(hour - 8 * AN_HOUR, hour + timedelta(minutes=5)) == ""  # it may just be beginning
    assert missed(hour + 900 * AN_HOUR, hour + AN_HOUR) == told  # a clock that was ahead began it
    assert missed(hour + AN_HOUR, hour + 2 * AN_HOUR) == ""  # somebody has asked for the whole plant since
    with backend.database.write() as connection:
        connection.execute(update(loops).values(created_at=hour + AN_HOUR))
    assert missed(hour - 8 * AN_HOUR, hour + 2 * AN_HOUR) == ""  # a plant that was not there waits for its first night


def test_a_night_that_was_begun_before_its_hour_is_not_missed(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", n=600)
    hour = datetime(2026, 3, 2, 2, 0, tzinfo=UTC)
    run = nightly(backend, hour.date())
    with backend.database.write() as connection:
        connection.execute(update(loops).values(created_at=hour - 9 * AN_HOUR))
        connection.execute(update(audits).where(audits.c.id == int(run.id)).values(created_at=hour - AN_HOUR))
    assert newest_run(backend, hour + AN_HOUR).missed == ""


def test_who_asks_for_the_whole_plant_twice_has_one_run(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", n=600)
    first = start_audit(backend, unless_going_on=True)
    assert start_audit(backend, unless_going_on=True).id == first.id
    cancel_audit(backend, first.id)
    assert start_audit(backend, unless_going_on=True).id != first.id


def test_a_run_that_began_before_newer_samples_came_is_not_joined(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", n=600)
    first = start_audit(backend, unless_going_on=True)
    read = {"content_key": "k", "fingerprint": "f", "filename": "a.csv", "size_bytes": 1, "state": "done"}
    with backend.database.write() as connection:
        connection.execute(insert(uploads).values(**read, received_at=now(), ended_at=now() + AN_HOUR))
    assert start_audit(backend, unless_going_on=True).id != first.id


def test_a_run_says_of_which_night_and_which_part_of_the_plant_it_is(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", "B", n=600, unit="U1")
    assert nightly(backend, date(2026, 1, 31)).night == "2026-01-31"
    parts = {LoopFilter(): "the whole plant", LoopFilter(unit="U1"): "unit U1", LoopFilter(tags=("A",)): "loop A"}
    assert [start_audit(backend, wanted).part for wanted in parts] == list(parts.values())
