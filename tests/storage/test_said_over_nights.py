"""What was said of a loop night after night: which verdict counts where a later one or a repair has followed."""

from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import Connection, insert, update

from app.storage import Database, loops, notes
from app.storage.asked_rows import RowFilter
from app.storage.judged import no_further
from app.storage.nights import first_sticking
from app.storage.repaired import Sides, between, sides
from app.storage.tables import audits, verdicts
from app.storage.tables import loops as loops_table
from app.storage.verdicts import count

BEGAN = datetime(2026, 1, 1, tzinfo=UTC)
DAY = timedelta(days=1)
RUN = {"plant": "p", "trigger": "nightly", "state": "done", "config_json": "{}", "config_fingerprint": "c"}
RUN |= {"window_h": 24.0, "window_samples": 100, "total": 1}
SAID = {"samples": 100, "reliability": "reliable", "engine_version": "1", "elapsed_s": 0.1, "health": 50.0}
SAID |= {"input_fingerprint": "f", "config_fingerprint": "c", "reasons": "", "reasons_text": ""}


def night(connection: Connection, number: int, verdict: str, **told: object) -> int:
    """The run of so many nights later, which judged the day before it; its number."""
    ends = BEGAN + number * DAY
    run = insert(audits).values(**RUN, created_at=ends, ended_at=ends).returning(audits.c.id)
    audit_id = connection.execute(run).scalar_one()
    ids = loops.ensure(connection, ["FIC1"])
    window = {"audited_at": ends, "window_start": ends - DAY, "window_end": ends, "input_end_ns": number}
    said = {"loop_id": ids["FIC1"], "audit_id": audit_id, "verdict": verdict} | SAID | window | told
    connection.execute(insert(verdicts).values(said))
    connection.execute(update(loops_table).values(newest_audit_id=audit_id))
    return audit_id


def test_since_when_a_valve_sticks_is_told_of_a_run_as_it_was_then(database: Database) -> None:
    with database.write() as connection:
        runs = [night(connection, at, said) for at, said in enumerate(("no_stiction", "stiction", "stiction"), 1)]
        night(connection, 4, "no_stiction")
        night(connection, 5, "stiction")
        (then,), (today,) = first_sticking(connection, ["FIC1"], runs[2]), first_sticking(connection, ["FIC1"])
    assert (then.audited_at, then.otherwise) == (BEGAN + 2 * DAY, runs[0])
    assert (today.audited_at, today.otherwise) == (BEGAN + 5 * DAY, runs[2] + 1)


def test_a_verdict_whose_window_begins_with_the_repair_is_after_it(database: Database) -> None:
    with database.write() as connection:
        before, across, after = (night(connection, at, "stiction") for at in (1, 2, 3))
        loop_id = loops.ensure(connection, ["FIC1"])["FIC1"]
        assert sides(connection, loop_id, BEGAN + 2 * DAY) == Sides(before, after)
        assert sides(connection, loop_id, BEGAN + 2 * DAY + timedelta(milliseconds=1)) == Sides(across, None)


def test_what_a_run_says_of_a_repair_rests_on_no_verdict_of_later(database: Database) -> None:
    with database.write() as connection:
        first, second = night(connection, 1, "stiction"), night(connection, 2, "no_stiction")
        night(connection, 3, "inconclusive")
        loop_id = loops.ensure(connection, ["FIC1"])["FIC1"]
        notes.add(connection, loop_id, "op", "it", "", BEGAN + 9 * DAY)
        since, until = BEGAN, datetime.now(UTC) + 9 * DAY
        said = [between(connection, since, until, run, 10)[0].verdict_before for run in (first, second, None)]
    assert said == ["stiction", "no_stiction", "inconclusive"]


@pytest.mark.parametrize(("given", "told"), [(1, []), (2, ["FIC1"])])
def test_a_window_that_goes_no_further_is_news_where_newer_samples_were_given(
    database: Database, given: int, told: list[str]
) -> None:
    with database.write() as connection:
        night(connection, 1, "stiction")
        run = night(connection, 2, "stiction", window_end=BEGAN + DAY, input_end_ns=given)
        assert [row.span.tag for row in no_further(connection, run, False, 10)] == told


def test_rows_of_a_run_are_chosen_by_the_samples_that_it_was_given(database: Database) -> None:
    with database.write() as connection:
        run = night(connection, 1, "stiction", input_end_ns=10)
        connection.execute(update(loops_table).values(newest_ns=99))
        bounds = ({"recorded_before_ns": 11}, {"recorded_before_ns": 10}, {"recorded_from_ns": 11})
        counts = [count(connection, RowFilter(audit_id=run, **given)) for given in bounds]
        today = [count(connection, RowFilter(**given)) for given in bounds]
    assert (counts, today) == ([1, 0, 0], [0, 0, 0])
