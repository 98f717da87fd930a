"""The claim on an explanation: one owner at a time, fenced by its attempt, given to another where a worker is lost."""

import threading

import pytest
from sqlalchemy import insert, select, update

from app.engine.audit_config import AuditConfig
from app.storage import Database, audits, explanations, items, loops
from app.storage.audits import LoopFilter
from app.storage.explanations import ExplanationClaim, ExplanationRow
from app.storage.leases import Reopened
from app.storage.tables import audits as audits_table
from app.storage.tables import explanations as explanations_table
from app.storage.tables import loops as loops_table
from app.storage.tables import verdicts
from app.storage.types import now

CONFIG = AuditConfig()
RUN = {
    "trigger": "nightly",
    "plant": "plant",
    "config_json": CONFIG.canonical_json(),
    "config_fingerprint": CONFIG.fingerprint(),
    "window_h": 24.0,
    "window_samples": 1000,
}
TAGS = [f"FIC{i}" for i in range(6)]


@pytest.fixture
def ids(database: Database) -> dict[str, int]:
    """Six loops with samples."""
    with database.write() as connection:
        found = loops.ensure(connection, TAGS)
        connection.execute(update(loops_table).values(newest_ns=1))
    return found


def ask(database: Database, loop_id: int) -> int:
    with database.write() as connection:
        return explanations.ask(connection, {"loop_id": loop_id, "window_start_ns": 0, "window_end_ns": 1})


def claim(database: Database, owner: str = "a", lease_s: float = 60.0) -> ExplanationClaim | None:
    with database.write() as connection:
        return explanations.claim_next(connection, owner, lease_s)


def end(database: Database, held: ExplanationClaim, verdict: str) -> bool:
    with database.write() as connection:
        return explanations.end(connection, held, "done", {"verdict": verdict, "packed": b"x"})


def newest(database: Database, loop_id: int) -> ExplanationRow:
    with database.read() as connection:
        return explanations.page(connection, loop_id, 1)[0]


def run_with_verdicts(
    database: Database, ids: dict[str, int], told: dict[str, tuple[str, float, float | None]], **values: object
) -> int:
    """An ended nightly run; told: verdict, probability and regularity by tag; health is what that leaves of 100."""
    with database.write() as connection:
        audit_id = audits.plan(connection, RUN, LoopFilter(tags=tuple(told)))
        items.finish(connection, items.claim(connection, audit_id, "a", 20, 60.0))
        for tag, (verdict, probability, regularity) in told.items():
            connection.execute(
                insert(verdicts).values(
                    {
                        "loop_id": ids[tag],
                        "audit_id": audit_id,
                        "audited_at": now(),
                        "input_start_ns": 10,
                        "input_end_ns": 20,
                        "samples": 100,
                        "verdict": verdict,
                        "stiction_probability": probability,
                        "oscillation_regularity": regularity,
                        "reliability": "reliable",
                        "health": None if probability is None else 100.0 * (1.0 - probability),
                        "engine_version": "1",
                        "elapsed_s": 0.1,
                        "input_fingerprint": "f",
                        "config_fingerprint": "c",
                        "reasons": "",
                        "reasons_text": "",
                        **values,
                    }
                )
            )
        audits.end_if_complete(connection, audit_id)
    return audit_id


def test_the_oldest_comes_first_and_has_one_owner(database: Database, ids: dict[str, int]) -> None:
    first, second = ask(database, ids["FIC1"]), ask(database, ids["FIC0"])
    assert [claim(database, owner).explanation_id for owner in "ab"] == [first, second]
    assert claim(database, "c") is None


def test_claims_at_the_same_time_never_meet(database: Database, ids: dict[str, int]) -> None:
    for _ in range(20):
        ask(database, ids["FIC0"])
    taken: list[int] = []

    def work(owner: str) -> None:
        while held := claim(database, owner):
            taken.append(held.explanation_id)

    threads = [threading.Thread(target=work, args=(f"w{i}",)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(taken) == len(set(taken)) == 20


def test_a_lost_worker_cannot_write_any_more(database: Database, ids: dict[str, int]) -> None:
    ask(database, ids["FIC0"])
    lost = claim(database, "a", lease_s=-1.0)
    with database.write() as connection:
        assert explanations.reopen_expired(connection, max_attempts=3, lease_s=60.0) == Reopened(1, 0)
    again = claim(database, "b")
    assert again.attempt == 2
    with database.write() as connection:
        assert not explanations.renew(connection, lost, 60.0)
        assert not explanations.note_first(connection, lost, b"late")
    assert not end(database, lost, "consistent")
    assert end(database, again, "missing_physics")
    assert not end(database, again, "consistent")
    row = newest(database, ids["FIC0"])
    assert (row.state, row.verdict, row.ended) == ("done", "missing_physics", True)


def test_a_claim_that_is_renewed_is_not_taken_away(database: Database, ids: dict[str, int]) -> None:
    ask(database, ids["FIC0"])
    held = claim(database, "a", lease_s=-1.0)
    with database.write() as connection:
        assert explanations.renew(connection, held, 60.0)
        assert explanations.reopen_expired(connection, max_attempts=3, lease_s=60.0) == Reopened(0, 0)


def test_what_takes_its_workers_down_fails_and_holds_up_nobody(database: Database, ids: dict[str, int]) -> None:
    deadly, other = ask(database, ids["FIC0"]), ask(database, ids["FIC1"])
    assert claim(database, "a", lease_s=-1.0).explanation_id == deadly
    with database.write() as connection:
        assert explanations.reopen_expired(connection, max_attempts=2, lease_s=60.0) == Reopened(1, 0)
    assert claim(database, "b").explanation_id == other
    assert claim(database, "c", lease_s=-1.0).explanation_id == deadly
    with database.write() as connection:
        assert explanations.reopen_expired(connection, max_attempts=2, lease_s=60.0) == Reopened(0, 1)
    row = newest(database, ids["FIC0"])
    assert (row.state, row.error_code) == ("failed", "worker_lost")
    assert "2 times" in row.error_text


def test_waiting_ones_are_announced_once_in_a_while(database: Database, ids: dict[str, int]) -> None:
    asked = ask(database, ids["FIC0"])
    with database.write() as connection:
        assert explanations.to_announce(connection, 30.0) == []  # whoever asked has rung
        assert explanations.to_announce(connection, -1.0) == [asked]
        assert explanations.to_announce(connection, 30.0) == []
    claim(database)
    with database.write() as connection:
        assert explanations.to_announce(connection, -1.0) == []
        assert not explanations.any_waiting(connection)


def test_the_worst_loops_of_a_night_are_asked_for_once(database: Database, ids: dict[str, int]) -> None:
    with database.write() as connection:
        important = update(loops_table).where(loops_table.c.tag == "FIC3").values(importance=10.0)
        connection.execute(important)
    told = {
        "FIC0": ("stiction", 0.9, None),
        "FIC1": ("no_stiction", 0.1, None),
        "FIC2": ("no_stiction", 0.2, 3.0),
        "FIC3": ("inconclusive", 0.5, 2.0),
        "FIC4": ("not_auditable", None, None),
    }
    run = run_with_verdicts(database, ids, told)
    with database.write() as connection:
        assert audits.newest_night(connection) == run
        assert explanations.plan_for_run(connection, run, 2) == 2
        assert explanations.plan_for_run(connection, run, 5) == 0
        query = select(explanations_table.c.loop_id, explanations_table.c.window_start_ns)
        planned = connection.execute(query.order_by(explanations_table.c.id)).all()
    assert [tuple(row) for row in planned] == [(ids["FIC3"], 10), (ids["FIC0"], 10)]


def planned(database: Database, run: int, count: int) -> list[int]:
    """The loops of which a run asks for an explanation."""
    with database.write() as connection:
        explanations.plan_for_run(connection, run, count)
        query = select(explanations_table.c.loop_id).where(explanations_table.c.audit_id == run)
        return list(connection.scalars(query.order_by(explanations_table.c.id)))


def test_a_night_asks_in_the_order_in_which_lists_have_the_worst_first(database: Database, ids: dict[str, int]) -> None:
    run = run_with_verdicts(database, ids, {"FIC0": ("stiction", 0.6, None), "FIC1": ("stiction", 0.9, None)})
    with database.write() as connection:
        connection.execute(update(verdicts).where(verdicts.c.loop_id == ids["FIC0"]).values(health=5.0))
    assert planned(database, run, 1) == [ids["FIC0"]]


@pytest.mark.parametrize("news", [{"input_end_ns": 30}, {"input_fingerprint": "g"}, {"engine_version": "2"}])
def test_what_a_night_asked_for_is_asked_again_only_where_something_is_new(
    database: Database, ids: dict[str, int], news: dict[str, object]
) -> None:
    told = {"FIC0": ("stiction", 0.9, None), "FIC1": ("stiction", 0.8, None), "FIC2": ("stiction", 0.7, None)}
    assert planned(database, run_with_verdicts(database, ids, told), 2) == [ids["FIC0"], ids["FIC1"]]
    assert planned(database, run_with_verdicts(database, ids, told), 2) == [ids["FIC2"]]
    assert planned(database, run_with_verdicts(database, ids, told), 2) == []
    assert planned(database, run_with_verdicts(database, ids, told, **news), 2) == [ids["FIC0"], ids["FIC1"]]


def test_a_night_asks_only_where_something_sticks_or_swings(database: Database, ids: dict[str, int]) -> None:
    told = {"FIC1": ("no_stiction", 0.1, 0.4), "FIC2": ("no_stiction", 0.2, 3.0), "FIC4": ("not_auditable", None, None)}
    run = run_with_verdicts(database, ids, told)
    with database.write() as connection:
        assert explanations.plan_for_run(connection, run, 5) == 1
    assert newest(database, ids["FIC2"]).audit_id == run


def test_a_run_that_goes_on_is_not_explained_yet(database: Database, ids: dict[str, int]) -> None:
    run_with_verdicts(database, ids, {"FIC0": ("stiction", 0.9, None)})
    with database.write() as connection:
        audits.plan(connection, {**RUN, "nightly_for": "2026-02-02"}, LoopFilter())
        assert audits.newest_night(connection) is None


def test_what_a_night_asked_for_waits_for_audits_and_people(database: Database, ids: dict[str, int]) -> None:
    run = run_with_verdicts(database, ids, {"FIC0": ("stiction", 0.9, None)})
    with database.write() as connection:
        explanations.plan_for_run(connection, run, 1)
        other = audits.plan(connection, {**RUN, "trigger": "request"}, LoopFilter(tags=("FIC5",)))
    assert claim(database) is None
    with database.write() as connection:
        assert explanations.to_announce(connection, -1.0) == []
    asked = ask(database, ids["FIC1"])
    assert claim(database).explanation_id == asked
    with database.write() as connection:
        items.finish(connection, items.claim(connection, other, "a", 20, 60.0))
    asked = ask(database, ids["FIC1"])
    assert claim(database).explanation_id == asked
    assert newest(database, ids["FIC0"]).id == claim(database).explanation_id


def test_explanations_outlive_their_run(database: Database, ids: dict[str, int]) -> None:
    run = run_with_verdicts(database, ids, {"FIC0": ("stiction", 0.9, None)})
    with database.write() as connection:
        explanations.plan_for_run(connection, run, 1)
        connection.execute(audits_table.delete().where(audits_table.c.id == run))
    assert newest(database, ids["FIC0"]).audit_id is None


def test_the_newest_come_first_page_by_page(database: Database, ids: dict[str, int]) -> None:
    asked = [ask(database, ids["FIC0"]) for _ in range(5)]
    ask(database, ids["FIC1"])
    with database.read() as connection:
        first = explanations.page(connection, ids["FIC0"], 3)
        rest = explanations.page(connection, ids["FIC0"], 3, first[-1].id)
    assert [row.id for row in (*first, *rest)] == asked[::-1]


def test_an_explanation_is_found_by_its_loop_and_in_pages(database: Database, ids: dict[str, int]) -> None:
    asked = [ask(database, ids["FIC0"]) for _ in range(3)]
    other = ask(database, ids["FIC1"])
    with database.read() as connection:
        page = explanations.page(connection, ids["FIC0"], 2)
        assert [row.id for row in page] == asked[:0:-1]
        assert [row.id for row in explanations.page(connection, ids["FIC0"], 2, page[-1].id)] == asked[:1]
        assert explanations.by_id(connection, ids["FIC0"], other) is None
        found = explanations.by_id(connection, ids["FIC1"], other)
        assert found is not None
        assert (found.state, found.ended) == ("open", False)
        assert explanations.packed_answer(connection, other) is None
        assert explanations.packed_simulation(connection, other) is None
    held = claim(database)
    assert held is not None
    with database.read() as connection:
        assert explanations.claimed(connection, held).state == "claimed"


def test_a_claim_that_was_renewed_outlives_its_first_lease(database: Database, ids: dict[str, int]) -> None:
    ask(database, ids["FIC0"])
    held = claim(database, lease_s=-1.0)
    assert held is not None
    with database.write() as connection:
        assert explanations.renew(connection, held, 60.0)
        assert not explanations.renew(connection, ExplanationClaim(held.explanation_id, 99, held.owner), 60.0)
        assert explanations.reopen_expired(connection, 3, 60.0) == Reopened(0, 0)
