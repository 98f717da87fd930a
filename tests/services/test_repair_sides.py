"""Which verdicts are of before a repair and which of after it: SQL and Python say the same."""

from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import Connection, insert

from app.services.audit_json.rows import as_row
from app.services.backend import Backend
from app.services.moments import ns_of
from app.services.plant import before_after
from app.services.stating import notes
from app.services.telling.repair_sides import side_of, span_of
from app.storage import loops, repaired, tables, verdicts
from app.storage import notes as stored_notes

REPAIRED = datetime(2026, 1, 2, 12, 0, 0, 250_700, tzinfo=UTC)
RUN = {"trigger": "nightly", "plant": "p", "state": "done", "config_json": "{}", "config_fingerprint": "c"}
RUN |= {"window_h": 24.0, "window_samples": 100, "total": 1}
SAID = {"samples": 100, "reliability": "reliable", "engine_version": "1", "elapsed_s": 0.1, "input_fingerprint": "f"}
SAID |= {"config_fingerprint": "c", "reasons": "", "reasons_text": ""}


def said(connection: Connection, loop_id: int, windows: list[tuple[datetime | None, datetime | None]]) -> list[int]:
    """A verdict of each window in a run of its own, made long before the repair; the runs, the oldest first."""
    at = REPAIRED - timedelta(days=9)
    made = [{**RUN, "created_at": at, "ended_at": at} for _ in windows]
    runs = sorted(connection.scalars(insert(tables.audits).returning(tables.audits.c.id), made))
    keys = [{"loop_id": loop_id, "audit_id": run, "audited_at": at, "verdict": f"of {run}"} for run in runs]
    rows = [{**key, "window_start": start, "window_end": end} for key, (start, end) in zip(keys, windows, strict=True)]
    connection.execute(insert(tables.verdicts), [{**SAID, **row} for row in rows])
    connection.execute(tables.loops.update().values(newest_ns=1, newest_audit_id=runs[-1]))
    return runs


@pytest.fixture
def loop_id(backend: Backend) -> int:
    with backend.database.write() as connection:
        return loops.ensure(connection, ["FIC1"])["FIC1"]


@pytest.mark.parametrize("start_us", [-3_000_000, -700, 0])
@pytest.mark.parametrize("end_us", [-1_000, -701, -700, -300, 0, 300, 2_000])
def test_both_cut_what_is_below_a_millisecond(backend: Backend, loop_id: int, start_us: int, end_us: int) -> None:
    start, end = (REPAIRED + timedelta(microseconds=us) for us in (start_us, max(start_us, end_us)))
    with backend.database.write() as connection:
        (run,) = said(connection, loop_id, [(start, end)])
        sides = repaired.sides(connection, loop_id, REPAIRED)
        stored_notes.add(connection, loop_id, "", "packing renewed", "", REPAIRED)
        (listed,) = repaired.between(connection, REPAIRED - timedelta(days=1), datetime.now(UTC), None, 10)
    side = side_of((start, end), REPAIRED)
    assert sides == repaired.Sides(run if side == "before" else None, run if side == "after" else None)
    assert listed.verdict_before == (f"of {run}" if side == "before" else None)
    assert listed.side == side


@pytest.mark.parametrize("start_us", [-3_000_000, -701, -700, 0, 2_000])
@pytest.mark.parametrize("end_us", [-1_000, -701, -700, 0, 2_000])
@pytest.mark.parametrize("at", [REPAIRED, REPAIRED.replace(microsecond=999_700), REPAIRED.replace(microsecond=0)])
def test_without_a_window_all_that_was_looked_at_tells_the_side(
    backend: Backend, loop_id: int, at: datetime, start_us: int, end_us: int
) -> None:
    given = [ns_of(at) + us * 1000 for us in (start_us, max(start_us, end_us))]
    with backend.database.write() as connection:
        (run,) = said(connection, loop_id, [(None, None)])
        made = {"audited_at": at + timedelta(days=1), "input_start_ns": given[0], "input_end_ns": given[1]}
        connection.execute(tables.verdicts.update().values(**made))
        sides = repaired.sides(connection, loop_id, at)
        stored_notes.add(connection, loop_id, "", "transmitter changed", "", at)
        (listed,) = repaired.between(connection, at - timedelta(days=1), datetime.now(UTC), None, 10)
        row = as_row(verdicts.of_runs(connection, loop_id, [run])[run])
    side = side_of(span_of(row), at)
    assert (side == "before") == (given[1] // 10**6 < ns_of(at) // 10**6)
    assert sides == repaired.Sides(run if side == "before" else None, run if side == "after" else None)
    assert listed.side == side


def test_a_verdict_without_a_window_is_of_before_where_it_was_made_before(backend: Backend, loop_id: int) -> None:
    with backend.database.write() as connection:
        (run,) = said(connection, loop_id, [(None, None)])
        assert repaired.sides(connection, loop_id, REPAIRED) == repaired.Sides(run, None)
        assert repaired.sides(connection, loop_id, REPAIRED - timedelta(days=99)) == repaired.Sides(None, None)


def test_the_last_before_is_found_behind_a_thousand_nights_since(backend: Backend, loop_id: int) -> None:
    day = timedelta(days=1)
    before, after = (REPAIRED - 2 * day, REPAIRED - day), (REPAIRED, REPAIRED + day)
    with backend.database.write() as connection:
        runs = said(connection, loop_id, [before, before, *[after] * 1001])
    notes.add_note(backend, "FIC1", "packing renewed", repaired_at=REPAIRED)
    repair = before_after.newest_repair(backend, "FIC1")
    assert [side and side["audit_id"] for side in (repair.before, repair.after)] == [str(runs[1]), str(runs[-1])]
    with backend.database.read() as connection:
        (row,) = repaired.between(connection, REPAIRED - day, datetime.now(UTC), None, 10)
    assert (row.verdict_before, row.verdict) == (f"of {runs[1]}", f"of {runs[-1]}")
