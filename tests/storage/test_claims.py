"""Who lost a claim has no more say, what failed for want of room costs no try, and who was to be told is told."""

from sqlalchemy import Connection, select, update

from app.storage import Database, audits, explanations, items, loops, uploads
from app.storage.audits import LoopFilter
from app.storage.tables import audits as runs
from app.storage.tables import loops as loops_table
from app.storage.tables import uploads as uploads_table
from app.storage.types import clock_s
from tests.storage.stored import upload

RUN = {"trigger": "request", "plant": "plant", "config_json": "{}", "config_fingerprint": "", "window_h": 24.0}


def test_an_upload_is_claimed_no_more_often_than_it_may_be(database: Database) -> None:
    with database.write() as connection:
        sent = upload(connection)
        claims = [uploads.claim(connection, sent, "worker", -1.0, 2) for _ in range(3)]
    assert [claim and claim.attempt for claim in claims] == [1, 2, None]


def test_who_lost_an_upload_ends_nothing_though_it_has_the_name_of_who_reads_it(database: Database) -> None:
    with database.write() as connection:
        sent = upload(connection)
        lost, held = (
            uploads.claim(connection, sent, "worker", -1.0, 3),
            uploads.claim(connection, sent, "worker", 60, 3),
        )
        assert lost is not None
        assert held is not None
        assert not uploads.renew(connection, lost, 60.0)
        assert not uploads.end(connection, lost, "failed", {})
        assert uploads.end(connection, held, "done", {})


def test_of_what_failed_only_a_fault_of_ours_is_tried_again_and_counts_as_received_now(database: Database) -> None:
    with database.write() as connection:
        ours = upload(connection, "a", state="failed", error_code="reader_lost", receipt_number=1, attempts=3)
        theirs = upload(connection, "b", state="failed", error_code="not_a_table", receipt_number=2, attempts=1)
        done = upload(connection, "c", state="done", receipt_number=3)
        for name in "defg":
            uploads.receive(connection, sent(name))
        assert [uploads.try_again(connection, one) for one in (ours, theirs, done)] == [True, False, False]
        last = select(uploads_table.c.id).order_by(uploads_table.c.receipt_number.desc(), uploads_table.c.id).limit(1)
        assert connection.scalar(last) == ours
        row = uploads.by_id(connection, ours)
    assert row is not None
    assert (row.state, row.attempts, row.error_code) == ("received", 0, None)


def sent(name: str) -> dict[str, object]:
    told = {"content_key": name, "fingerprint": name, "filename": name, "size_bytes": 1, "reading_json": "{}"}
    return told | {"content_type": None, "received_by": None}


def test_an_explanation_without_room_waits_its_pause_and_loses_no_try(database: Database) -> None:
    with database.write() as connection:
        (loop_id,) = loops.ensure(connection, ["FIC1"]).values()
        explanations.ask(connection, {"loop_id": loop_id, "window_start_ns": 0, "window_end_ns": 1})
        claim = explanations.claim_next(connection, "worker", 60.0)
        assert claim is not None
        assert explanations.wait_for_room(connection, claim, 60.0)
        (row,) = explanations.page(connection, loop_id, 1)
        assert (row.state, row.attempts) == ("open", 0)
        assert explanations.to_announce(connection, -1.0) == []  # as long ago as that, were there no pause


def planned(connection: Connection) -> int:
    loops.ensure(connection, ["FIC1", "FIC2"])
    connection.execute(update(loops_table).values(newest_ns=1))
    return audits.plan(connection, {**RUN, "window_samples": 100}, LoopFilter()) or 0


def test_a_run_of_which_somebody_called_nobody_is_announced_whoever_calls_another_since(database: Database) -> None:
    with database.write() as connection:
        run = planned(connection)
        audits.note_announced(connection, run)
        audits.note_called(connection, run)
        assert audits.to_announce(connection, 20.0) == []
        audits.note_uncalled(connection, run)
        audits.note_called(connection, run)
        assert audits.to_announce(connection, 20.0) == [run]


def test_a_run_that_some_work_on_is_announced_again_after_a_good_while(database: Database) -> None:
    with database.write() as connection:
        run = planned(connection)
        assert items.claim(connection, run, "worker", 1, 1000.0)
        told = []
        for seconds in (30.0, 70.0):
            connection.execute(update(runs).values(announced_s=clock_s() - seconds))
            told.append(audits.to_announce(connection, 20.0))
    assert told == [[], [run]]
