"""A run over a plant: every loop ends with one verdict or one stated failure, whatever happens to one of them."""

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from datetime import time as clock_time

import numpy as np
import pytest
from sqlalchemy import Connection, Table, func, select, update
from sqlalchemy.exc import OperationalError
from typer.main import get_command

from app.cli.main import cli
from app.engine.audit import Audit, audit
from app.engine.recording import Recording
from app.errors import DataError, NotFoundError, RequestError
from app.services import loops
from app.services.access.trail import list_trail
from app.services.audit_json.models import ReliabilityRow
from app.services.auditing import audits, chunks, nightly
from app.services.auditing.audits import LoopFilter
from app.services.backend import Backend
from app.services.plant import loop_verdicts
from app.services.stating import properties
from app.services.upkeep.readiness import readiness
from app.services.upkeep.sweep import sweep
from app.settings import Settings
from app.storage import audits as stored_audits
from app.storage import items
from app.storage import series as stored_series
from app.storage.tables import audit_items, series, verdicts
from app.storage.tables import audits as audits_table
from app.storage.tables import loops as loops_table

AddLoops = Callable[..., dict[str, int]]


def work_off(backend: Backend, audit_id: str, owner: str = "w") -> None:
    while chunks.audit_chunk(backend, int(audit_id), owner):
        pass


def test_every_loop_gets_its_verdict(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1", "FIC2", "FIC3")
    run = audits.start_audit(backend)
    assert (run.state, run.total, run.open) == ("planned", 3, 3)
    work_off(backend, run.id)
    run = audits.get_audit(backend, run.id)
    assert (run.state, run.open, run.done, run.failed) == ("done", 0, 3, 0)
    row = ReliabilityRow.model_validate(loop_verdicts.loop_health(backend, "FIC2"))
    assert (row.loop, row.samples, row.sampling_interval_s, row.audit_id) == ("FIC2", 300, 60.0, run.id)
    assert (row.window_start, row.window_end) == ("2025-06-15T15:06:40Z", "2025-06-15T20:05:40Z")
    detail = loop_verdicts.verdict_detail(backend, "FIC2")
    assert detail["rungs"]
    assert [reason["code"] for reason in detail["reasons"]] == row.reasons.split(";")


def test_a_stored_verdict_is_that_of_the_engine_and_can_be_made_again(backend: Backend, add_loops: AddLoops) -> None:
    ids = add_loops("FIC1")
    properties.patch_loop(backend, "FIC1", {"op_low": 0.0, "op_high": 100.0, "integrating": False})
    run = audits.start_audit(backend)
    work_off(backend, run.id)
    stored = loop_verdicts.loop_health(backend, "FIC1")
    with backend.database.read() as connection:
        given = connection.execute(select(verdicts.c.input_start_ns, verdicts.c.input_end_ns)).one()
        samples = stored_series.between(connection, ids["FIC1"], given.input_start_ns, given.input_end_ns)
    properties.patch_loop(backend, "FIC1", {"op_low": 20.0, "op_high": 60.0, "integrating": True})
    now = chunks.recording_of(loops.find(backend, "FIC1"), samples)
    stated = loop_verdicts.verdict_detail(backend, "FIC1")["stated"]
    assert stated == {"op_range": [0.0, 100.0], "pv_range": None, "integrating": False}
    recording = replace(now, **stated)
    again = audit(recording)
    assert stored["input_fingerprint"] != now.fingerprint()
    assert stored["input_fingerprint"] == again.input_fingerprint
    assert stored["config_fingerprint"] == again.config_fingerprint
    assert stored["verdict"] == again.judgement.verdict
    assert stored["stiction_probability"] == again.judgement.stiction_probability


def test_delivered_twice_changes_nothing(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1", "FIC2")
    run = audits.start_audit(backend)
    work_off(backend, run.id)
    before = audits.get_audit(backend, run.id)
    assert chunks.audit_chunk(backend, int(run.id), "late") == 0
    assert audits.get_audit(backend, run.id) == before
    assert _count(backend, verdicts) == 2


def test_one_loop_that_crashes_or_hangs_leaves_the_others_alone(
    backend: Backend, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch
) -> None:
    tags = ["CRASH", "DATA", "FIC1", "HANG", "MEMORY"]
    add_loops(*tags)

    def spoiled(recording: Recording, config: object) -> Audit:
        if recording.name == "HANG":
            time.sleep(60)
        errors = {"CRASH": ZeroDivisionError("x"), "MEMORY": MemoryError(), "DATA": DataError("odd", "no use")}
        if recording.name in errors:
            raise errors[recording.name]
        return audit(recording)

    monkeypatch.setattr(chunks, "audit", spoiled)
    quick = backend.settings.model_copy(update={"loop_limit_s": 2.0})
    run = audits.start_audit(backend)
    work_off(Backend(quick, backend.database, backend.queue), run.id)
    run = audits.get_audit(backend, run.id)
    assert (run.state, run.done, run.failed) == ("partial", 1, 4)
    assert {f.loop: f.code for f in run.failures} == {
        "CRASH": "fault",
        "DATA": "odd",
        "HANG": "time_limit",
        "MEMORY": "memory",
    }


@pytest.mark.parametrize("damaged", [b"\x02", b"", b"\x02\x01\x00\x00\x00\x02\x00\x00\x00{}", bytes(60)])
def test_a_damaged_stretch_is_told_with_its_loop_and_the_others_are_audited_at_once(
    backend: Backend, add_loops: AddLoops, damaged: bytes
) -> None:
    ids = add_loops("FIC1", "FIC2", "FIC3")
    with backend.database.write() as connection:
        this = update(series).where(series.c.loop_id == ids["FIC2"]).values(packed=damaged)
        (stretch,) = connection.scalars(this.returning(series.c.id))
    run = audits.start_audit(backend)
    assert chunks.audit_chunk(backend, int(run.id), "w") == 3
    ended = audits.get_audit(backend, run.id)
    assert (ended.state, ended.done, ended.failed) == ("partial", 2, 1)
    (failure,) = ended.failures
    assert (failure.loop, failure.code) == ("FIC2", "fault")
    assert f"stretch {stretch} of the stored samples cannot be read" in failure.text


def test_a_data_base_that_stays_away_is_no_fault_of_the_loops(
    backend: Backend, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not even where their windows have to be read one by one."""
    add_loops("FIC1", "FIC2")
    run, asked = audits.start_audit(backend), []

    def away(*arguments: object) -> dict:
        asked.append(arguments)
        raise ZeroDivisionError if len(asked) == 1 else OperationalError("SELECT 1", {}, Exception("away"))

    monkeypatch.setattr(chunks.series, "windows", away)
    impatient = backend.settings.model_copy(update={"lease_s": 0.05})
    with pytest.raises(OperationalError):
        chunks.audit_chunk(Backend(impatient, backend.database, backend.queue), int(run.id), "w")
    ended = audits.get_audit(backend, run.id)
    assert (ended.done, ended.failed, ended.open) == (0, 0, 2)


def test_a_late_worker_cannot_overwrite(backend: Backend, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch) -> None:
    """While it audits, its claim runs out and another worker finishes the loop."""
    add_loops("FIC1")
    run = audits.start_audit(backend)

    def slow(recording: Recording, config: object) -> Audit:
        monkeypatch.setattr(chunks, "audit", audit)
        with backend.database.write() as connection:
            connection.execute(update(audit_items).values(lease_until_s=0.0))
        sweep(backend)
        assert chunks.audit_chunk(backend, int(run.id), "quick") == 1
        return audit(Recording("other", np.arange(300.0), recording.op, recording.pv))

    monkeypatch.setattr(chunks, "audit", slow)
    chunks.audit_chunk(backend, int(run.id), "slow")
    assert _count(backend, verdicts) == 1
    assert loop_verdicts.loop_health(backend, "FIC1")["sampling_interval_s"] == 60.0


def test_work_of_a_lost_worker_is_given_to_another(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1", "FIC2")
    run = audits.start_audit(backend)
    with backend.database.write() as connection:
        assert len(items.claim(connection, int(run.id), "dead", 2, 40.0)) == 2
    assert chunks.audit_chunk(backend, int(run.id), "w") == 0
    with backend.database.write() as connection:
        connection.execute(update(audit_items).values(lease_until_s=0.0))
    report = sweep(backend)
    assert report.reopened == 2
    work_off(backend, run.id)
    assert audits.get_audit(backend, run.id).state == "done"


def test_a_run_may_be_of_some_loops_only(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1", "FIC2", unit="U1")
    add_loops("LIC1", unit="U2", type="level")
    assert audits.start_audit(backend, LoopFilter(unit="U1")).total == 2
    assert audits.start_audit(backend, LoopFilter(tags=("FIC1", "LIC1"))).total == 2
    assert audits.start_audit(backend, LoopFilter(tags=("FIC1", "LIC1"), type="level")).total == 1
    with pytest.raises(RequestError, match="NOPE"):
        audits.start_audit(backend, LoopFilter(tags=("NOPE",)))
    assert len(audits.list_audits(backend).rows) == 3


def test_a_run_without_loops_ends_at_once(backend: Backend) -> None:
    run = audits.start_audit(backend)
    assert (run.state, run.total, run.code) == ("done", 0, "no_loops")
    assert "send an export" in (run.text or "")


def test_a_run_with_loops_has_nothing_to_say_of_that(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1")
    assert (audits.start_audit(backend).code, audits.start_audit(backend).text) == (None, None)


def test_a_run_can_be_cancelled(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1", "FIC2")
    run = audits.start_audit(backend)
    cancelled = audits.cancel_audit(backend, run.id)
    assert (cancelled.state, cancelled.failed, cancelled.cancelled) == ("cancelled", 2, 2)
    assert audits.failures(backend, run.id) == []
    assert chunks.audit_chunk(backend, int(run.id), "w") == 0
    assert audits.cancel_audit(backend, run.id) == cancelled
    with pytest.raises(NotFoundError):
        audits.cancel_audit(backend, "99")


def test_a_run_that_has_ended_is_not_cancelled(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1")
    run = audits.start_audit(backend)
    work_off(backend, run.id)
    with pytest.raises(RequestError, match="is done; nothing is left"):
        audits.cancel_audit(backend, run.id)
    assert audits.get_audit(backend, run.id).state == "done"


def test_a_chunk_under_way_ends_with_its_run_and_what_it_found_stays(
    backend: Backend, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_loops("FIC1", "FIC2", "FIC3", "FIC4", "FIC5", "FIC6")
    run, begun = audits.start_audit(backend), []

    def cancelling(recording: Recording, config: object) -> Audit:
        begun.append(recording.name)
        if len(begun) == 2:
            audits.cancel_audit(backend, run.id)
        return audit(recording)

    monkeypatch.setattr(chunks, "audit", cancelling)
    writes_each = backend.settings.model_copy(update={"lease_s": 0.004})
    assert chunks.audit_chunk(Backend(writes_each, backend.database, backend.queue), int(run.id), "w") == 2
    ended = audits.get_audit(backend, run.id)
    assert (len(begun), ended.state, ended.done, ended.failed) == (2, "cancelled", 1, 5)
    assert loop_verdicts.loop_health(backend, begun[0])["audit_id"] == run.id
    assert _count(backend, verdicts) == 1


def test_a_run_is_started_by_one_transaction_after_which_nothing_is_asked(
    backend: Backend, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise a database that goes away in between is told as `nothing was changed`, and the run is asked for
    twice."""
    add_loops("FIC1", "FIC2")
    rung, writes, write = [], [], backend.database.write

    def counted() -> AbstractContextManager[Connection]:
        writes.append(1)
        if len(writes) > 1:
            raise OperationalError("BEGIN", {}, Exception("the server is away"))
        return write()

    def away() -> AbstractContextManager[Connection]:
        raise OperationalError("SELECT 1", {}, Exception("the server is away"))

    monkeypatch.setattr(backend.database, "write", counted)
    monkeypatch.setattr(backend.database, "read", away)
    monkeypatch.setattr(backend.queue, "audit_chunks", lambda *told: rung.append(told))
    run = audits.start_audit(backend)
    assert (run.state, run.total, run.open) == ("planned", 2, 2)
    assert rung == [(int(run.id), 1)]


def test_the_broker_may_be_away(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1")
    from app.queue import Queue

    away = backend.settings.model_copy(update={"broker_url": "redis://127.0.0.1:1/0"})
    alone = Backend(away, backend.database, Queue(away))
    started = time.monotonic()
    run = audits.start_audit(alone)
    assert (run.state, run.open) == ("planned", 1)
    assert time.monotonic() - started < 5.0
    assert readiness(alone).state == "degraded"
    alone.queue.close()


def test_a_broker_that_refuses_is_a_broker_that_is_away(
    backend: Backend, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_loops("FIC1")
    from redis.exceptions import OutOfMemoryError

    from app.queue import Queue

    def full(*_: object, **__: object) -> None:
        raise OutOfMemoryError("command not allowed when used memory > 'maxmemory'")

    settings = backend.settings.model_copy(update={"broker_url": "redis://127.0.0.1:1/0"})
    alone = Backend(settings, backend.database, Queue(settings))
    monkeypatch.setattr(alone.queue._application, "send_task", full)
    assert audits.start_audit(alone).open == 1
    alone.queue.close()


def test_one_nightly_run_a_date(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1")
    first = nightly.nightly(backend, date(2026, 1, 31))
    assert nightly.nightly(backend, date(2026, 1, 31)).id == first.id
    assert nightly.nightly(backend, date(2026, 2, 1)).id != first.id
    assert first.trigger == "nightly"


def test_the_nightly_run_comes_at_its_hour_and_is_caught_up(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1")
    known_since = datetime(2026, 3, 1, 12, 0, tzinfo=UTC)
    with backend.database.write() as connection:
        connection.execute(update(loops_table).values(created_at=known_since))
    assert nightly.nightly_if_due(backend, known_since + timedelta(hours=1)) is None
    assert nightly.nightly_if_due(backend, datetime(2026, 3, 2, 1, 59, tzinfo=UTC)) is None
    late = nightly.nightly_if_due(backend, datetime(2026, 3, 2, 9, 30, tzinfo=UTC))
    assert late is not None
    assert nightly.nightly_if_due(backend, datetime(2026, 3, 2, 9, 31, tzinfo=UTC)) is None
    assert nightly.nightly_if_due(backend, datetime(2026, 3, 3, 1, 59, tzinfo=UTC)) is None
    assert nightly.nightly_if_due(backend, datetime(2026, 3, 3, 2, 0, tzinfo=UTC)) is not None


def test_of_two_sweeps_that_begin_a_night_at_once_one_tells_it(
    backend: Backend, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_loops("FIC1")
    with backend.database.write() as connection:
        connection.execute(update(loops_table).values(created_at=datetime(2026, 3, 1, tzinfo=UTC)))
    by_night, looks = stored_audits.by_night, [None, None]
    monkeypatch.setattr(stored_audits, "by_night", lambda *told: looks.pop() if looks else by_night(*told))
    runs = [nightly.nightly_if_due(backend, datetime(2026, 3, 2, 9, minute, tzinfo=UTC)) for minute in (0, 1)]
    assert {run.id for run in runs if run} == {"1"}
    assert not looks
    assert [row.action for row in list_trail(backend).rows].count("audit.start") == 1


def test_a_night_that_is_begun_by_hand_before_its_hour_is_that_date_s(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1")
    with backend.database.write() as connection:
        connection.execute(update(loops_table).values(created_at=datetime(2026, 3, 1, 1, 0, tzinfo=UTC)))
    by_hand = nightly.nightly(backend, date(2026, 3, 2))
    assert nightly.nightly_if_due(backend, datetime(2026, 3, 2, 2, 1, tzinfo=UTC)) is None
    assert nightly.nightly_if_due(backend, datetime(2026, 3, 3, 2, 1, tzinfo=UTC)) is not None
    assert by_hand.trigger == "nightly"
    told = " ".join(str(get_command(cli).commands["nightly"].help).split())
    assert "also before LOOPAUDIT_NIGHTLY_AT: the schedule then begins none on that date" in told


def test_the_hour_is_that_of_the_plant(backend: Backend) -> None:
    berlin = backend.settings.model_copy(update={"time_zone": "Europe/Berlin"})
    there = Backend(berlin, backend.database, backend.queue)
    summer = nightly.latest_hour(there, datetime(2026, 7, 1, 0, 30, tzinfo=UTC))
    assert summer.astimezone(UTC) == datetime(2026, 7, 1, 0, 0, tzinfo=UTC)


@pytest.mark.parametrize("now", ["00:31", "00:59", "01:05", "01:29", "01:31", "02:10"])
def test_an_hour_that_the_clock_shows_twice_has_come_once(backend: Backend, now: str) -> None:
    settings = backend.settings.model_copy(update={"time_zone": "Europe/Berlin", "nightly_at": clock_time(2, 30)})
    there, moment = Backend(settings, backend.database, backend.queue), datetime.fromisoformat(f"2026-10-25T{now}Z")
    latest, following = nightly.latest_hour(there, moment), nightly.next_hour(settings, moment)
    assert (latest.date(), following.date()) == (date(2026, 10, 25), date(2026, 10, 26))
    assert latest.astimezone(UTC) <= moment < following.astimezone(UTC)


@pytest.mark.parametrize(("now", "night"), [("00:59", 27), ("01:10", 27), ("01:29", 27), ("01:30", 28), ("02:10", 28)])
def test_an_hour_at_the_end_of_a_day_that_the_clock_leaves_out_comes_on_the_next(
    backend: Backend, now: str, night: int
) -> None:
    settings = backend.settings.model_copy(update={"time_zone": "America/Nuuk", "nightly_at": clock_time(23, 30)})
    there, moment = Backend(settings, backend.database, backend.queue), datetime.fromisoformat(f"2026-03-29T{now}Z")
    latest, following = nightly.latest_hour(there, moment), nightly.next_hour(settings, moment)
    assert (latest.date(), following.date()) == (date(2026, 3, night), date(2026, 3, night + 1))
    assert latest.astimezone(UTC) <= moment < following.astimezone(UTC)


def test_an_hour_that_the_clock_leaves_out_comes_a_day_after_the_last(backend: Backend) -> None:
    settings = backend.settings.model_copy(update={"time_zone": "Europe/Berlin", "nightly_at": clock_time(2, 30)})
    following = nightly.next_hour(settings, datetime(2026, 3, 28, 1, 30, tzinfo=UTC))
    assert following.astimezone(UTC) == datetime(2026, 3, 29, 1, 30, tzinfo=UTC)


def test_a_night_that_was_asked_for_before_its_hour_is_left_out_and_told_once(
    backend: Backend, add_loops: AddLoops, caplog: pytest.LogCaptureFixture
) -> None:
    add_loops("FIC1")
    caplog.set_level("INFO", "loopaudit.nightly")
    run = nightly.nightly(backend, date(2026, 3, 2), started_by="command line")
    _created(backend, audits_table, datetime(2026, 3, 2, 1, 0, tzinfo=UTC))
    _created(backend, loops_table, datetime(2026, 3, 1, 12, 0, tzinfo=UTC))
    for minute in range(3):
        assert nightly.nightly_if_due(backend, datetime(2026, 3, 2, 2, minute, tzinfo=UTC)) is None
    assert caplog.messages == [
        f"no nightly audit at 2026-03-02 02:00 UTC: run {run.id} of that date was started before, by command line"
    ]
    rows = list_trail(backend, action="audit.skip").rows
    assert [(row.who, row.subject) for row in rows] == [("schedule", f"/v1/audits/{run.id}")]


def test_a_plant_whose_first_samples_came_after_the_hour_waits_and_says_so_once(
    backend: Backend, add_loops: AddLoops, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO", "loopaudit.nightly")
    assert nightly.nightly_if_due(backend, datetime(2026, 3, 1, 9, 0, tzinfo=UTC)) is None
    assert caplog.messages == []
    add_loops("FIC1")
    _created(backend, loops_table, datetime(2026, 3, 1, 10, 0, tzinfo=UTC))
    for minute in range(3):
        assert nightly.nightly_if_due(backend, datetime(2026, 3, 1, 11, minute, tzinfo=UTC)) is None
    waits = "no nightly audit of 2026-03-01: the first samples came after its hour; the next one is at"
    assert caplog.messages == [f"{waits} 2026-03-02 02:00 UTC"]
    run = nightly.nightly_if_due(backend, datetime(2026, 3, 2, 2, 0, tzinfo=UTC))
    assert run is not None
    _created(backend, audits_table, datetime(2026, 3, 2, 1, 59, 58, tzinfo=UTC))  # by a clock that is behind
    assert nightly.nightly_if_due(backend, datetime(2026, 3, 2, 2, 1, tzinfo=UTC)) is None
    assert caplog.messages[1:] == [f"nightly audit of 2026-03-02 started, run {run.id}"]


@pytest.mark.parametrize(
    ("now", "following"),
    [("2026-11-25T22:00", "2026-11-26 02:00"), ("2026-11-26T00:59", "2026-11-26 02:00"),
     ("2026-11-26T01:00", "2026-11-27 02:00"), ("2026-10-25T01:30", "2026-10-26 02:00")],
)  # fmt: skip
def test_the_next_night_is_told_by_the_clock_of_the_plant(now: str, following: str) -> None:
    there = Settings(time_zone="Europe/Berlin")
    found = nightly.next_hour(there, datetime.fromisoformat(now).replace(tzinfo=UTC))
    assert nightly.told(found) == f"{following} Europe/Berlin"


def _created(backend: Backend, table: Table, at: datetime) -> None:
    with backend.database.write() as connection:
        connection.execute(update(table).values(created_at=at))


def _count(backend: Backend, table: object) -> int:
    with backend.database.read() as connection:
        return connection.scalar(select(func.count()).select_from(table))
