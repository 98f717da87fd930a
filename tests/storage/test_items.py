"""The claim on a loop of a run: one owner at a time, fenced by its attempt, given to another where a worker is lost."""

import threading
from dataclasses import replace

import pytest
from sqlalchemy import Connection, event, select, update

from app.engine.audit_config import AuditConfig
from app.storage import Database, audits, items, loops
from app.storage.audits import LoopFilter, Progress
from app.storage.items import Claim, Failure
from app.storage.leases import Reopened
from app.storage.tables import audit_items
from app.storage.tables import loops as loops_table

CONFIG = AuditConfig()
RUN = {
    "trigger": "request",
    "plant": "plant",
    "config_json": CONFIG.canonical_json(),
    "config_fingerprint": CONFIG.fingerprint(),
    "window_h": 24.0,
    "window_samples": 1000,
}


@pytest.fixture
def run(database: Database) -> int:
    """A run over 20 loops."""
    with database.write() as connection:
        loops.ensure(connection, [f"FIC{i:02}" for i in range(20)])
        connection.execute(update(loops_table).values(newest_ns=1))
        audit_id = audits.plan(connection, RUN, LoopFilter())
    assert audit_id is not None
    return audit_id


def claim(database: Database, run: int, owner: str, count: int, lease_s: float = 60.0) -> list[Claim]:
    with database.write() as connection:
        return items.claim(connection, run, owner, count, lease_s)


def progress(database: Database, run: int) -> Progress:
    with database.read() as connection:
        return audits.progress(connection, [run])[run]


def test_a_loop_has_one_owner(database: Database, run: int) -> None:
    first, second = claim(database, run, "a", 12), claim(database, run, "b", 12)
    assert (len(first), len(second)) == (12, 8)
    assert {c.loop_id for c in first}.isdisjoint(c.loop_id for c in second)
    assert claim(database, run, "c", 12) == []


def test_claims_at_the_same_time_never_meet(database: Database, run: int) -> None:
    taken: list[int] = []

    def work(owner: str) -> None:
        while claims := claim(database, run, owner, 3):
            taken.extend(c.loop_id for c in claims)

    threads = [threading.Thread(target=work, args=(f"w{i}",)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(taken) == len(set(taken)) == 20


def test_what_has_ended_is_nobodys_and_a_failure_keeps_its_reason(database: Database, run: int) -> None:
    done, failed = claim(database, run, "a", 2)
    row = select(*(audit_items.c[name] for name in ("state", "owner", "lease_until_s", "attempts", "code", "text")))
    with database.write() as connection:
        items.finish(connection, [done])
        items.fail(connection, [Failure(failed, "fault", "ValueError: x")])
        rows = [connection.execute(row.where(audit_items.c.loop_id == one.loop_id)).one() for one in (done, failed)]
    assert rows == [("done", None, None, 1, None, None), ("failed", None, None, 1, "fault", "ValueError: x")]


def test_a_run_ends_once_nothing_is_left(database: Database, run: int) -> None:
    claims = claim(database, run, "a", 20)
    with database.write() as connection:
        items.finish(connection, claims[:19])
        assert audits.complete(connection) == []
        assert audits.end_if_complete(connection, run) == 0
        items.fail(connection, [Failure(claims[19], "fault", "ValueError: x")])
        assert audits.complete(connection) == [run]
        assert audits.end_if_complete(connection, run) == 1
        assert audits.complete(connection) == []
        assert audits.end_if_complete(connection, run) == 0
    with database.read() as connection:
        assert audits.by_id(connection, run).state == "partial"
        assert [f.code for f in items.failures(connection, run, 10)] == ["fault"]
    assert progress(database, run) == Progress(done=19, failed=1)


def test_a_lost_worker_cannot_write_any_more(database: Database, run: int) -> None:
    lost = claim(database, run, "a", 20, lease_s=-1.0)
    with database.write() as connection:
        assert items.reopen_expired(connection, max_attempts=3, lease_s=60.0) == Reopened(20, 0, {run: 1})
    again = claim(database, run, "a", 20)
    with database.write() as connection:
        assert items.finish(connection, lost) == set()
        items.fail(connection, [Failure(c, "fault", "late") for c in lost])
        assert items.renew(connection, lost, 60.0) == 0
        assert items.finish(connection, again) == {again[0].loop_id}
    assert progress(database, run).failed == 0


def test_claims_of_one_owner_hold_by_the_attempt_of_each(database: Database, run: int) -> None:
    """One was tried before, the others not."""
    claim(database, run, "lost", 1, lease_s=-1.0)
    with database.write() as connection:
        items.reopen_expired(connection, max_attempts=3, lease_s=60.0)
    held = claim(database, run, "a", 19) + claim(database, run, "a", 20)
    assert sorted(one.attempt for one in held) == [1] * 19 + [2]
    with database.write() as connection:
        assert items.renew(connection, [replace(one, attempt=3 - one.attempt) for one in held], 60.0) == 0
        assert items.renew(connection, [replace(one, owner="lost") for one in held], 60.0) == 0
        assert items.renew(connection, [replace(one, audit_id=run + 1) for one in held], 60.0) == 0
        assert items.renew(connection, held, 60.0) == 20
        assert items.finish(connection, held) == {one.loop_id for one in held}
        assert items.finish(connection, held) == set()
        assert items.hand_back(connection, held) == 0


def test_loops_that_nobody_began_are_as_if_nobody_had_claimed_them(database: Database, run: int) -> None:
    """Not tried, so that they are claimed together, and no worker is lost by them."""
    held = claim(database, run, "a", 20)
    with database.write() as connection:
        assert items.hand_back(connection, held) == 20
    assert claim(database, run, "b", 20) == [replace(one, owner="b") for one in held]


def test_lost_workers_are_counted_by_run(database: Database, run: int) -> None:
    """Those too of which all loops are given up; each once, whatever it held."""
    with database.write() as connection:
        connection.execute(update(audit_items).where(audit_items.c.loop_id <= 3).values(attempts=2))
        other = audits.plan(connection, RUN, LoopFilter()) or 0
    for audit_id, owner, count in ((run, "a", 5), (run, "b", 12), (run, "c", 1), (other, "d", 20)):
        claim(database, audit_id, owner, count, lease_s=-1.0)
    with database.write() as connection:
        assert items.reopen_expired(connection, 3, 60.0, audit_id=other) == Reopened(20, 0, {other: 1})
        assert items.reopen_expired(connection, 3, 60.0) == Reopened(17, 1, {run: 3})
        assert items.reopen_expired(connection, 3, 60.0) == Reopened(0, 0)


def test_a_loop_that_was_tried_before_is_claimed_alone(database: Database, run: int) -> None:
    claim(database, run, "a", 4, lease_s=-1.0)
    with database.write() as connection:
        items.reopen_expired(connection, max_attempts=3, lease_s=60.0)
    assert len(claim(database, run, "b", 20)) == 16
    alone = claim(database, run, "b", 20)
    assert [c.attempt for c in alone] == [2]


def test_a_loop_that_takes_its_worker_down_is_set_aside(database: Database, run: int) -> None:
    for _ in range(2):
        while claim(database, run, "a", 20, lease_s=-1.0):
            pass
        with database.write() as connection:
            reopened = items.reopen_expired(connection, max_attempts=2, lease_s=60.0)
    assert reopened == Reopened(0, 20, {run: 1})
    with database.write() as connection:
        assert audits.end_if_complete(connection, run) == 1
        assert {f.code for f in items.failures(connection, run, 20)} == {"worker_lost"}


def test_a_lease_that_ends_while_others_are_taken_back_gives_no_loop_a_try_too_many(
    database: Database, run: int
) -> None:
    claim(database, run, "slow", 20)
    looked: list[str] = []

    def time_passes(connection: Connection, _: object, statement: str, *__: object) -> None:
        looked.append(statement)
        if len(looked) == 1:  # for those that were tried too often: none yet
            connection.execute(update(audit_items).values(lease_until_s=0.0))

    with database.write() as connection:
        event.listen(connection, "after_cursor_execute", time_passes)
        assert items.reopen_expired(connection, max_attempts=1, lease_s=60.0) == Reopened(0, 0)
        assert items.reopen_expired(connection, max_attempts=1, lease_s=60.0) == Reopened(0, 20, {run: 1})
    assert progress(database, run) == Progress(failed=20)


def test_a_cancelled_run_gives_out_nothing(database: Database, run: int) -> None:
    held = claim(database, run, "a", 5)
    with database.write() as connection:
        assert audits.cancel(connection, run) == 20
        assert audits.cancel(connection, run) == 0
        assert items.finish(connection, held) == set()
        assert audits.end_if_complete(connection, run)
        assert audits.by_id(connection, run).state == "cancelled"
    assert claim(database, run, "b", 5) == []
    assert progress(database, run) == Progress(cancelled=20)


def test_what_was_called_off_is_told_behind_what_failed_and_of_a_loop_not_at_all(database: Database, run: int) -> None:
    with database.write() as connection:
        last = items.claim(connection, run, "a", 20, 60.0)[-1]
        items.fail(connection, [Failure(last, "fault", "it broke")])
        audits.cancel(connection, run)
        assert [one.code for one in items.failures(connection, run, 2)] == ["fault", items.CANCELLED]
        assert items.newest_failure(connection, last.loop_id, 0) == (run, "it broke")
        assert items.newest_failure(connection, last.loop_id, run) is None
        assert items.newest_failure(connection, last.loop_id - 1, 0) is None


def test_of_a_reason_without_an_end_the_beginning_is_kept(database: Database, run: int) -> None:
    with database.write() as connection:
        (held,) = items.claim(connection, run, "a", 1, 60.0)
        items.fail(connection, [Failure(held, "fault", 5000 * "x")])
        assert [one.text for one in items.failures(connection, run, 2)] == [2000 * "x"]


def test_the_progress_of_several_runs_is_told_apart(database: Database, run: int) -> None:
    with database.write() as connection:
        other = audits.plan(connection, RUN, LoopFilter())
        claims = items.claim(connection, run, "a", 3, 60.0)
        items.finish(connection, claims[:1])
        items.fail(connection, [items.Failure(claims[1], "fault", "it broke")])
        called_off = items.claim(connection, other, "a", 2, 60.0)
        items.finish(connection, called_off[:1])
        audits.cancel(connection, other)
        found = audits.progress(connection, [run, other])
        left = found[run].open
        assert found == {
            run: Progress(open=left, claimed=1, done=1, failed=1),
            other: Progress(done=1, cancelled=left + 2),
        }
        assert left + 3 == audits.by_id(connection, run).total
        assert audits.progress(connection, [other]) == {other: found[other]}


def test_a_stalled_run_is_announced_once_in_a_while(database: Database, run: int) -> None:
    with database.write() as connection:
        assert audits.to_announce(connection, 30.0) == [run]
        assert audits.to_announce(connection, 30.0) == []
        assert audits.to_announce(connection, -1.0) == [run]
        items.claim(connection, run, "a", 20, 60.0)
        assert audits.to_announce(connection, -1.0) == []


def test_one_run_a_night(database: Database, run: int) -> None:
    with database.write() as connection:
        first = audits.plan(connection, {**RUN, "nightly_for": "2026-01-31"}, LoopFilter())
        assert audits.plan(connection, {**RUN, "nightly_for": "2026-01-31"}, LoopFilter()) is None
        assert audits.by_night(connection, "plant", "2026-01-31").id == first
        assert audits.plan(connection, {**RUN, "nightly_for": "2026-02-01"}, LoopFilter()) is not None


def test_nothing_claimed_is_nothing_to_renew_finish_or_fail(database: Database, run: int) -> None:
    with database.write() as connection:
        before = audits.progress(connection, [run])[run]
        assert items.renew(connection, [], 60.0) == 0
        assert items.finish(connection, []) == set()
        items.fail(connection, [])
        assert audits.progress(connection, [run])[run] == before
