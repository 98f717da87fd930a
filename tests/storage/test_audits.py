"""Which run is the night that something follows, and how far runs are."""

from datetime import timedelta
from typing import Any

import pytest
from sqlalchemy import Connection, event, insert

from app.storage import Database, tables
from app.storage.audits import ENDED, WITH_RESULTS, newest_night, newest_whole, progress, whole_going_on
from app.storage.types import now
from tests.storage.stored import upload

RUN = {
    "plant": "p",
    "config_json": "{}",
    "config_fingerprint": "c",
    "window_h": 24.0,
    "window_samples": 100,
    "total": 1,
}


def night(connection: Connection, state: str, trigger: str = "nightly", hours_ago: float = 1.0) -> int:
    at = now() - timedelta(hours=hours_ago)
    told = {"state": state, "trigger": trigger, "created_at": at, "ended_at": at if state in ENDED else None}
    return connection.scalar(insert(tables.audits).values(**RUN, **told).returning(tables.audits.c.id)) or 0


@pytest.mark.parametrize("state", ["planned", "running", "cancelled"])
def test_what_follows_a_night_waits_for_it_and_a_reader_takes_the_last_that_has_results(
    database: Database, state: str
) -> None:
    with database.write() as connection:
        before = night(connection, "partial")
        night(connection, "done", trigger="request")
        assert newest_night(connection) == newest_night(connection, passes_by=True) == before
        night(connection, state)
        assert newest_night(connection) is None
        assert newest_night(connection, passes_by=True) == before


@pytest.mark.parametrize("state", WITH_RESULTS)
def test_a_night_that_ended_long_ago_is_none_where_it_may_not_be_so_old(database: Database, state: str) -> None:
    with database.write() as connection:
        run = night(connection, state, hours_ago=25.0)
        assert newest_night(connection, at_most_old=timedelta(hours=24)) is None
        assert newest_night(connection, at_most_old=timedelta(hours=26)) == run


def test_the_progress_of_runs_counts_no_loop_that_is_done(database: Database) -> None:
    """A page of runs counts them: a year of nights of a plant would be gone through."""
    if not database.is_sqlite:
        pytest.skip("plans of SQLite, which are the same whatever the tables hold")
    told: list[str] = []

    def note(_: Any, __: Any, statement: str, parameters: Any, *___: Any) -> None:
        told.extend(row[3] for row in connection.connection.execute(f"EXPLAIN QUERY PLAN {statement}", parameters))

    with database.write() as connection:
        event.listen(connection, "before_cursor_execute", note)
        progress(connection, range(1, 101))
    read = [step.split("INDEX ")[1].split()[0] for step in told if " audit_items " in step]
    assert read == [f"ix_audit_items_{state}" for state in ("open", "claimed", "failed")]


@pytest.mark.parametrize(
    ("state", "ended_minutes_ago", "goes_on"), [("done", 90, True), ("done", 30, False), ("failed", 30, True)]
)
def test_a_run_of_the_whole_plant_is_joined_unless_samples_came_since_it_began(
    database: Database, state: str, ended_minutes_ago: int, goes_on: bool
) -> None:
    with database.write() as connection:
        run = night(connection, "running", trigger="nightly", hours_ago=1.0)
        ended_at = now() - timedelta(minutes=ended_minutes_ago)
        upload(connection, state=state, received_at=ended_at, ended_at=ended_at)
        assert whole_going_on(connection) == (run if goes_on else None)


def test_the_run_that_goes_on_is_the_newest_of_the_whole_plant_though_a_later_one_has_ended(database: Database) -> None:
    with database.write() as connection:
        going_on = night(connection, "running", hours_ago=2.0)
        night(connection, "done")
        found = newest_whole(connection)
    assert found is not None
    assert found.id == going_on
