"""Metrics are counted in the database, so that they hold for every process together."""

from datetime import UTC, date, datetime, timedelta

import pytest
from sqlalchemy import update

from app.api.operations import exposition
from app.services.access import keys
from app.services.access.identity import Role
from app.services.auditing.audits import start_audit
from app.services.auditing.nightly import nightly
from app.services.intake import uploads
from app.services.upkeep.metrics import Metric, Sample, metrics
from app.storage import tables
from app.storage.audits import LoopFilter


def told(backend) -> dict[tuple[str, str], float]:
    return {
        (metric.name.removeprefix("loopaudit_"), ",".join(sample.labels.values())): sample.value
        for metric in metrics(backend)
        for sample in metric.samples
    }


def test_an_empty_plant_has_nothing_open(backend):
    found = told(backend)
    assert found["oldest_open_run_age_seconds", ""] == found["oldest_unread_upload_age_seconds", ""] == 0
    assert [found["queue_depth", kind] for kind in ("upload", "loop", "explanation")] == [0, 0, 0]
    assert ("last_run_duration_seconds", "") not in found
    assert ("newest_sample_timestamp_seconds", "") not in found
    assert found["loops_behind", ""] == 0
    assert found["data_folder_free_bytes", ""] > 0


def test_what_waits_is_counted_with_its_age(backend, add_loops):
    add_loops("FIC1", "FIC2", "FIC3")
    start_audit(backend)
    with uploads.receive(backend, filename="a.csv") as receiving:
        receiving.write(b"time,PV,OP\n0,1,2\n")
        receiving.commit()
    ago = datetime.now(UTC) - timedelta(seconds=90)
    with backend.database.write() as connection:
        connection.execute(update(tables.audits).values(created_at=ago))
        connection.execute(update(tables.uploads).values(received_at=ago))
    found = told(backend)
    assert (found["queue_depth", "loop"], found["queue_depth", "upload"]) == (3, 1)
    assert found["oldest_open_run_age_seconds", ""] == pytest.approx(90, abs=10)
    assert found["oldest_unread_upload_age_seconds", ""] == pytest.approx(90, abs=10)
    assert found["upload_bytes_total", ""] == 17


def test_a_run_that_ended_tells_how_long_it_took_and_what_failed(backend, add_loops):
    add_loops("FIC1")
    start_audit(backend)
    began = datetime(2026, 1, 1, tzinfo=UTC)
    with backend.database.write() as connection:
        ended = {"created_at": began, "ended_at": began + timedelta(minutes=7), "state": "partial"}
        connection.execute(update(tables.audits).values(**ended))
        connection.execute(update(tables.audit_items).values(state="failed", code="time_limit"))
    found = told(backend)
    assert found["last_run_duration_seconds", ""] == 420
    assert found["last_run_ended_timestamp_seconds", ""] == (began + timedelta(minutes=7)).timestamp()
    assert ("last_night_duration_seconds", "") not in found


def test_the_last_run_is_the_one_that_ended_last_whichever_began_first(backend, add_loops):
    add_loops("FIC1")
    long, short = (start_audit(backend) for _ in range(2))
    began = datetime(2026, 1, 1, tzinfo=UTC)
    with backend.database.write() as connection:
        for run, took in ((long, timedelta(hours=5)), (short, timedelta(minutes=7))):
            ended = {"created_at": began, "ended_at": began + took, "state": "done"}
            connection.execute(update(tables.audits).where(tables.audits.c.id == int(run.id)).values(**ended))
    found = told(backend)
    assert found["last_run_duration_seconds", ""] == 5 * 3600
    assert found["last_run_ended_timestamp_seconds", ""] == (began + timedelta(hours=5)).timestamp()


def test_a_night_that_a_clock_ahead_ended_hides_none_that_is_missing_since(backend, add_loops):
    """Until the clock came there again no alarm would see that no night ends any more."""
    add_loops("FIC1")
    runs = [nightly(backend, date(2026, 1, day)) for day in (1, 2)]
    ago, ahead = datetime.now(UTC) - timedelta(hours=7), datetime.now(UTC) + timedelta(days=40)
    with backend.database.write() as connection:
        for run, at, code in zip(runs, (ago, ahead), ("time_limit", "memory"), strict=True):
            mine = tables.audits.c.id == int(run.id)
            connection.execute(update(tables.audits).where(mine).values(created_at=at, ended_at=at, state="partial"))
            mine = tables.audit_items.c.audit_id == int(run.id)
            connection.execute(update(tables.audit_items).where(mine).values(state="failed", code=code))
    found = told(backend)
    for name in ("run", "night"):
        assert found[f"last_{name}_ended_timestamp_seconds", ""] == pytest.approx(ago.timestamp(), abs=1e-3)
    for name in ("failed_items", "failed_items_last_day"):
        assert found[name, "time_limit"] == 1
        assert (name, "memory") not in found


def test_a_run_amid_which_the_clock_was_put_back_took_no_time_below_nothing(backend, add_loops):
    add_loops("FIC1")
    start_audit(backend)
    at = datetime(2026, 1, 1, tzinfo=UTC)
    with backend.database.write() as connection:
        ended = {"created_at": at + timedelta(hours=1), "ended_at": at, "state": "done"}
        connection.execute(update(tables.audits).values(**ended))
    assert told(backend)["last_run_duration_seconds", ""] == 0


def test_a_run_over_one_loop_hides_neither_the_failures_of_the_night_nor_a_night_that_is_missing(backend, add_loops):
    add_loops("FIC1", "FIC2", "FIC3")
    nightly(backend, date(2026, 1, 1))
    other = start_audit(backend, LoopFilter(tags=("FIC3",)))
    ended = datetime.now(UTC) - timedelta(hours=7)
    with backend.database.write() as connection:
        connection.execute(update(tables.audits).values(created_at=ended, ended_at=ended, state="partial"))
        of_other = tables.audits.c.id == int(other.id)
        connection.execute(update(tables.audits).where(of_other).values(ended_at=ended + timedelta(hours=6)))
        connection.execute(update(tables.audit_items).values(state="failed", code="time_limit"))
        of_other = tables.audit_items.c.audit_id == int(other.id)
        connection.execute(update(tables.audit_items).where(of_other).values(code="memory"))
    found = told(backend)
    assert found["failed_items", "time_limit"] == 3
    assert ("failed_items", "memory") not in found
    assert (found["failed_items_last_day", "time_limit"], found["failed_items_last_day", "memory"]) == (3, 1)
    assert found["last_night_ended_timestamp_seconds", ""] == pytest.approx(ended.timestamp(), abs=1e-3)
    assert found["last_night_duration_seconds", ""] == 0
    assert found["last_run_duration_seconds", ""] == 6 * 3600


def test_an_export_that_stands_still_and_loops_that_fell_out_of_it_are_told(backend, add_loops):
    ids = add_loops("FIC1", "FIC2")
    newest = datetime.now(UTC) - timedelta(days=30)
    with backend.database.write() as connection:
        for tag, at in (("FIC1", newest), ("FIC2", newest - timedelta(days=3))):
            values = {"newest_ns": int(at.timestamp()) * 1_000_000_000}
            connection.execute(update(tables.loops).where(tables.loops.c.id == ids[tag]).values(**values))
    found = told(backend)
    assert found["newest_sample_timestamp_seconds", ""] == int(newest.timestamp())
    assert found["loops_behind", ""] == 1


def test_failures_of_days_ago_are_not_told_as_today_s(backend, add_loops):
    add_loops("FIC1")
    start_audit(backend)
    ended = datetime.now(UTC) - timedelta(hours=25)
    with backend.database.write() as connection:
        connection.execute(update(tables.audits).values(created_at=ended, ended_at=ended, state="partial"))
        connection.execute(update(tables.audit_items).values(state="failed", code="time_limit"))
    assert ("failed_items_last_day", "time_limit") not in told(backend)


def test_prometheus_is_told_all_digits():
    metric = Metric("a_seconds", "gauge", "A time.", (Sample(1_795_283_999.25), Sample(12_345_678), Sample(0.1)))
    lines = "".join(exposition([metric])).splitlines()
    assert lines[2:] == ["a_seconds 1795283999.25", "a_seconds 12345678", "a_seconds 0.1"]


def test_keys_that_ended_are_not_counted(backend):
    keys.create_key(backend, "a", Role.read, lifetime=None)
    keys.create_key(backend, "b", Role.read, lifetime=timedelta(seconds=-1))
    gone = keys.create_key(backend, "c", Role.read, lifetime=None)
    keys.revoke_key(backend, gone.key.id)
    assert told(backend)["active_keys", ""] == 1
