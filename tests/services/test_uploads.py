"""Uploads: acknowledged only when stored, read with the same effect however often."""

import threading
import time
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import Engine, delete, event, func, select, update

from app.errors import LoopauditError, NotFoundError
from app.ingest import TagMapping
from app.services import loops
from app.services.backend import Backend
from app.services.intake import reading, uploads
from app.services.intake.uploads import ReadingOptions
from app.services.stating import properties
from app.services.upkeep.sweep import sweep
from app.storage import samples
from app.storage import uploads as stored
from app.storage.tables import series as series_table
from app.storage.tables import uploads as uploads_table
from tests.services.sent_uploads import expire, export, packed, read, send


def test_samples_are_packed_before_the_transaction_that_stores_them(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    packing = []
    pack = samples.pack
    monkeypatch.setattr(samples, "pack", lambda *given: packing.append(threading.current_thread().name) or pack(*given))
    assert read(backend, send(backend, export())).samples_added == 400
    assert len(packing) == 2
    assert not any(name.startswith("storing") for name in packing)
    later = read(backend, send(backend, export(300), "later.csv"))  # of a part that is stored already
    assert later.samples_added == 200
    assert sum(name.startswith("storing") for name in packing) == 2


def test_an_export_becomes_loops_and_samples(backend: Backend) -> None:
    upload = send(backend, export(spoiled=True))
    assert (upload.state, upload.rows_kept) == ("received", 0)
    done = read(backend, upload)
    assert (done.state, done.loops, done.rows_refused) == ("done", ["FIC1", "LIC2"], 1)
    assert (done.rejects[0].line, done.rejects[0].code, done.rejects[0].tag) == (6, "not_a_number", "FIC1.PV")
    assert done.samples_added == 400
    assert loops.get_loop(backend, "LIC2").samples_to == "2025-06-15T15:09:59Z"


def test_a_new_upload_is_told_to_a_worker_at_once_and_the_same_again_is_not(backend, monkeypatch) -> None:
    told: list[int] = []
    monkeypatch.setattr(type(backend.queue), "read_upload", lambda self, upload: told.append(upload) or True)
    made = []
    for _ in range(2):
        with uploads.receive(backend, filename="a.csv") as receiving:
            receiving.write(export())
            made.append(receiving.commit().created)
    assert made == [True, False]
    assert told == [1]


def test_an_upload_that_came_damaged_says_so(backend: Backend) -> None:
    whole, cut = packed(export(2000)), packed(export(2000))[:-400]
    assert not read(backend, send(backend, whole)).damaged
    done = read(backend, send(backend, cut, name="cut.csv.gz"))
    assert (done.state, done.damaged, done.error_code) == ("done", True, None)
    assert [upload.damaged for upload in uploads.list_uploads(backend).rows] == [True, False]


def test_an_upload_that_breaks_off_leaves_nothing(backend: Backend) -> None:
    def broken_off() -> None:
        with uploads.receive(backend, filename="night.csv") as receiving:
            receiving.write(b"time,")
            raise ConnectionError

    with pytest.raises(ConnectionError):
        broken_off()
    assert list(backend.settings.uploads_dir.iterdir()) == []
    assert uploads.list_uploads(backend).rows == []


@pytest.mark.parametrize(("data", "code"), [(b"", "empty_upload"), (b"x" * 2001, "upload_too_large")])
def test_what_cannot_be_taken_is_refused(backend: Backend, data: bytes, code: str) -> None:
    small = Backend(backend.settings.model_copy(update={"max_upload_bytes": 2000}), backend.database, backend.queue)
    with pytest.raises(LoopauditError) as refused:
        send(small, data)
    assert refused.value.code == code
    assert code != "upload_too_large" or "at most 2,000 bytes;" in refused.value.message
    assert list(backend.settings.uploads_dir.iterdir()) == []


def test_a_file_that_is_no_export_fails_with_its_reason(backend: Backend) -> None:
    failed = read(backend, send(backend, b"\x00\x01\x02 nothing at all"))
    assert failed.state == "failed"
    assert failed.reason
    assert failed.error_code == "not_an_export"
    assert failed.ended_at


def test_a_mapping_names_loops_and_fills_in_what_is_not_set(backend: Backend) -> None:
    header = b"tag,loop,signal,unit,low,high,loop_type,area,description,owner\n"
    mapping = header + b"FIC1.PV,FIC-900,PV,t/h,0,120,flow,,Feed,\nFIC1.OP,FIC-900,OP,%,0,100,,U9,,crew A\n"
    done = read(backend, send(backend, export(), options=ReadingOptions(mapping=mapping)))
    assert "FIC-900" in done.loops
    loop = loops.get_loop(backend, "FIC-900")
    assert (loop.type, loop.unit, loop.pv_unit, loop.pv_high, loop.op_low) == ("flow", "U9", "t/h", 120.0, 0.0)
    assert (loop.description, loop.owner) == ("Feed", "crew A")


def test_what_a_terminal_would_obey_is_not_kept_of_a_mapping(backend: Backend) -> None:
    mapping = b"tag,loop,signal,unit,area,description\nA.PV,FIC1,PV,t\x1b/h,U\x079,a\x1b[2J\nA.OP,FIC1,OP,,,\n"
    text = b"time,A.PV,A.OP\n0,1,2\n60,2,3\n"
    read(backend, send(backend, text, options=ReadingOptions(mapping=mapping)))
    loop = loops.get_loop(backend, "FIC1")
    assert (loop.pv_unit, loop.unit, loop.description) == ("t/h", "U9", "a[2J")


def test_a_second_tag_of_a_signal_takes_nothing_of_what_the_first_says(backend: Backend) -> None:
    header = b"tag,loop,signal,low,high,unit\n"
    rows = [b"T1,FIC7,PV,0,250,m3/h\n", b"T2,FIC7,OP,4,20,mA\n", b"OLD1,FIC7,PV,,,\n", b"OLD2,FIC7,OP,,50,\n"]
    mapping = header + b"".join(rows)
    read(backend, send(backend, b"time,T1,T2\n0,1,2\n60,2,3\n", options=ReadingOptions(mapping=mapping)))
    loop = loops.get_loop(backend, "FIC7")
    assert (loop.pv_low, loop.pv_high, loop.pv_unit, loop.op_low, loop.op_high) == (0.0, 250.0, "m3/h", 4.0, 20.0)


def test_a_unit_in_the_heading_holds_where_nobody_says_another(backend: Backend) -> None:
    text = b"time,FIC900.PV (t/h),FIC900.OP (%),TIC7.PV,TIC7.OP\n0,1,2,3,4\n60,2,3,4,5\n"
    read(backend, send(backend, text))
    assert [loops.get_loop(backend, tag).pv_unit for tag in ("FIC900", "TIC7")] == ["t/h", None]
    properties.patch_loop(backend, "FIC900", {"pv_unit": "kg/s"})
    read(backend, send(backend, text.replace(b"60,", b"120,")))
    assert loops.get_loop(backend, "FIC900").pv_unit == "kg/s"


def test_a_mapping_is_gone_through_once_a_file(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    """It may have the tags of a plant, and a batch is written while other writers wait."""
    monkeypatch.setattr(reading, "BATCH_LOOPS", 1)
    attributes, calls = reading._attributes, []

    def counted(mapping: TagMapping) -> reading.Attributes:
        calls.append(mapping)
        return attributes(mapping)

    monkeypatch.setattr(reading, "_attributes", counted)
    mapping = b"tag,loop,signal,low,high\nA1,A,PV,0,100\nA2,A,OP,0,50\nB1,B,PV,0,10\nB2,B,OP,0,5\n"
    done = read(
        backend, send(backend, b"time,A1,A2,B1,B2\n0,1,2,3,4\n60,2,3,4,5\n", options=ReadingOptions(mapping=mapping))
    )
    assert done.loops == ["A", "B"]
    assert [loops.get_loop(backend, tag).pv_high for tag in done.loops] == [100.0, 10.0]
    assert len(calls) == 1


def test_a_mapping_may_spell_a_loop_in_two_ways(backend: Backend) -> None:
    mapping = b"tag,loop,signal,low,high\nA1,sic1,PV,0,100\nA2,SIC1,OP,0,50\n"
    done = read(backend, send(backend, b"time,A1,A2\n0,1,2\n60,2,3\n", options=ReadingOptions(mapping=mapping)))
    (tag,) = done.loops
    loop = loops.get_loop(backend, tag)
    assert (loop.pv_low, loop.pv_high, loop.op_low, loop.op_high) == (0.0, 100.0, 0.0, 50.0)


def test_options_that_cannot_be_used_are_refused_at_once(backend: Backend) -> None:
    for options in (ReadingOptions(mapping=b"tag,loop\na,b\n"), ReadingOptions(time_zone="Mars/Base")):
        with pytest.raises(LoopauditError):
            uploads.receive(backend, filename="x.csv", reading=options)


def test_a_list_of_uploads_counts_their_tags_and_does_not_read_them(backend: Backend) -> None:
    done = read(backend, send(backend, export()))
    assert (done.tags_found, [loop["pv"] for loop in done.tags]) == (5, ["FIC1.PV", "LIC2.PV"])
    with backend.database.write() as connection:
        assert "FIC1.PV" not in connection.scalar(select(uploads_table.c.summary_json))
        connection.execute(update(uploads_table).values(tags_json="as long as a plant"))
    (listed,) = uploads.list_uploads(backend).rows
    assert (listed.tags_found, listed.loops_found, listed.tags) == (5, 2, [])


def test_names_cannot_leave_the_folder(backend: Backend) -> None:
    assert send(backend, export(), name="../../etc/pass\x00wd").filename == "passwd"
    assert send(backend, export(7), name="a\nb\x07.csv").filename == "a\ufffdb\ufffd.csv"


def test_an_upload_is_read_by_one_and_again_after_a_crash(backend: Backend) -> None:
    upload = send(backend, export())
    expire(backend, upload, state="reading", owner="dead", attempts=1, lease_until_s=time.time() + 30)
    assert read(backend, upload).state == "reading"
    expire(backend, upload, lease_until_s=0.0)
    assert sweep(backend).announced == 1
    assert read(backend, upload).samples_added == 400


def test_a_crash_in_the_middle_has_no_double_effect(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    upload = send(backend, export())
    monkeypatch.setattr(reading, "BATCH_LOOPS", 1)
    store, calls = reading._store, []

    def crash_at_the_second(*arguments: object) -> object:
        calls.append(1)
        if len(calls) == 2:
            raise OSError("the disk is gone")
        return store(*arguments)

    monkeypatch.setattr(reading, "_store", crash_at_the_second)
    with pytest.raises(OSError, match="disk"):
        reading.read_upload(backend, int(upload.id), "w")
    done = read(backend, upload)
    assert (done.state, done.samples_added, done.loops) == ("done", 400, ["FIC1", "LIC2"])


@pytest.mark.parametrize("lost", ["end", "_end_read"])
def test_what_a_lost_worker_had_stored_is_counted_as_brought(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, lost: str
) -> None:
    """In the midst of its last step, or before it, when all samples are stored."""
    read(backend, send(backend, export()))
    corrected = send(backend, export().replace(b",50.", b",60."))
    with monkeypatch.context() as patch:
        patch.setattr(reading if lost == "_end_read" else reading.uploads, lost, killed)
        with pytest.raises(KeyboardInterrupt):
            reading.read_upload(backend, int(corrected.id), "w")
    expire(backend, corrected, lease_until_s=0.0)
    done = read(backend, corrected)
    assert (done.samples_added, done.samples_replaced > 0) == (0, True)
    assert any("replaced by other values" in note for note in done.notes)


def test_what_was_stored_before_it_failed_is_counted_when_it_is_sent_again(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else it would not be checked for damage when it comes once more, and read anew is not counted twice."""
    upload = send(backend, export())
    with monkeypatch.context() as patch:
        patch.setattr(reading, "_end_read", lambda *_: 1 / 0)
        for _ in range(reading.FAULTS_IN_ALL):
            with pytest.raises(ZeroDivisionError):
                reading.read_upload(backend, int(upload.id), "w")
    assert uploads.get_upload(backend, upload.id).state == "failed"
    assert read(backend, send(backend, export())).samples_added == 400
    with backend.database.write() as connection:
        connection.execute(delete(series_table))
    assert read(backend, send(backend, export())).samples_added == 400


def killed(*_: object) -> None:
    raise KeyboardInterrupt


def test_a_fault_of_ours_is_told_and_tried_again_when_sent_again(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload = send(backend, export())

    def fault(*arguments: object) -> int:
        raise ZeroDivisionError

    with monkeypatch.context() as patch:
        patch.setattr(reading, "_store", fault)
        for _ in range(reading.FAULTS_IN_ALL):
            assert uploads.get_upload(backend, upload.id).state in ("received", "reading")
            with pytest.raises(ZeroDivisionError):
                reading.read_upload(backend, int(upload.id), "w")
    failed = uploads.get_upload(backend, upload.id)
    assert failed.state == "failed"
    assert "ZeroDivisionError" in failed.reason
    assert read(backend, send(backend, export())).state == "done"


@pytest.mark.parametrize(("of_loops", "of_uploads", "tries"), [(1, 10, 3), (20, 2, 2), (20, 20, 3)])
def test_how_often_a_loop_is_tried_says_nothing_of_uploads(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, of_loops: int, of_uploads: int, tries: int
) -> None:
    """A fault of ours is told as one, and not as a reader that was lost."""
    settings = backend.settings.model_copy(update={"max_attempts": of_loops, "max_reading_attempts": of_uploads})
    other = Backend(settings, backend.database, backend.queue)
    upload = send(backend, export())
    monkeypatch.setattr(reading, "_store", lambda *_: 1 / 0)
    for _ in range(tries):
        assert uploads.get_upload(backend, upload.id).state in ("received", "reading")
        with pytest.raises(ZeroDivisionError):
            reading.read_upload(other, int(upload.id), "w")
        sweep(other)
    failed = uploads.get_upload(backend, upload.id)
    assert (failed.state, "ZeroDivisionError" in failed.reason) == ("failed", True)


def test_a_worker_that_does_not_see_the_file_leaves_it(backend: Backend) -> None:
    upload = send(backend, export())
    (backend.settings.uploads_dir / upload.fingerprint).rename(backend.settings.data_dir / "elsewhere")
    assert read(backend, upload).state == "received"


def test_uploads_are_listed_by_the_page(backend: Backend) -> None:
    ids = [send(backend, export(rows=10 + i)).id for i in range(5)]
    first = uploads.list_uploads(backend, limit=3)
    second = uploads.list_uploads(backend, limit=3, cursor=first.next_cursor)
    assert [u.id for u in first.rows + second.rows] == ids[::-1]
    assert second.next_cursor is None
    with pytest.raises(NotFoundError):
        uploads.get_upload(backend, "0")


def test_the_shared_exports_are_read_whole(backend: Backend, shared_dir: Path) -> None:
    paths = sorted((shared_dir / "exports").glob("*.[ct]*"))
    assert paths
    for path in paths:
        done = read(backend, uploads.receive_file(backend, path).upload)
        assert done.state == "done"
        assert done.rows_kept > 700


def test_an_upload_tells_which_of_its_loops_are_retired(backend: Backend) -> None:
    first = read(backend, send(backend, export()))
    tag = first.loops[0]
    assert not any("retired" in note for note in first.notes)
    properties.patch_loop(backend, tag, {"retired": True})
    later = read(backend, send(backend, export(start=1_750_100_000)))
    assert later.samples_added == first.samples_added
    assert f"not audited with the plant ({tag})." in later.notes[-1]


def test_an_upload_without_loops_notes_none(backend: Backend) -> None:
    with backend.database.write() as connection:
        stored.note_loops(connection, 1, [])
        assert stored.loops_of(connection, 1) == []


def test_mappings_are_left_where_they_are_while_uploads_are_listed(backend: Backend) -> None:
    """A mapping may have megabytes, and a page lists a hundred uploads."""
    mapping = b"tag,loop,signal\nT1,FIC1,PV\nT2,FIC1,OP\n"
    sent = send(backend, b"time,T1,T2\n0,1,2\n60,2,3\n", options=ReadingOptions("Europe/Madrid", mapping))
    asked: list[str] = []

    def note(_connection: object, _cursor: object, statement: str, *_: object) -> None:
        asked.append(statement)

    event.listen(Engine, "before_cursor_execute", note)
    try:
        assert [found.id for found in uploads.list_uploads(backend).rows] == [sent.id]
        assert uploads.get_upload(backend, sent.id).state == "received"
    finally:
        event.remove(Engine, "before_cursor_execute", note)
    assert any("FROM uploads" in statement for statement in asked)
    assert not [statement for statement in asked if "reading_json" in statement]
    assert read(backend, sent).loops == ["FIC1"]


def of_dates(stamp: str) -> bytes:
    return ("Time,FIC1.PV,FIC1.OP\n" + "".join(f"{stamp} 00:{i:02d}:00,{i},{i}\n" for i in range(60))).encode()


@pytest.mark.parametrize(
    ("setting", "option", "day"),
    [("auto", "month", "2026-02-03"), ("month", None, "2026-02-03"), ("month", "day", "2026-03-02")],
)
def test_the_order_of_day_and_month_is_the_plants_or_the_uploads(
    backend: Backend, setting: str, option: str | None, day: str
) -> None:
    plant = replace(backend, settings=backend.settings.model_copy(update={"date_order": setting}))
    sent = send(plant, of_dates("02/03/2026"), options=ReadingOptions(date_order=option))
    read(plant, sent)
    with plant.database.read() as connection:
        first = connection.execute(select(func.min(series_table.c.start_ns))).scalar_one()
    assert str(np.datetime64(first, "ns"))[:10] == day


def test_an_upload_is_read_by_the_clock_of_its_coming(backend: Backend) -> None:
    tomorrow = datetime.now(UTC) + timedelta(days=40)
    done = read(backend, send(backend, of_dates(f"{tomorrow:%Y-%m-%d}")))
    assert any("ahead of the clock" in note for note in done.notes)
    again = read(backend, uploads.read_again(backend, done.id, b"tag,loop,signal\nFIC1.PV,F,PV\nFIC1.OP,F,OP\n").upload)
    assert again.loops == ["F"]


def test_an_upload_read_again_keeps_the_order_of_its_dates(backend: Backend) -> None:
    done = read(backend, send(backend, of_dates("02/03/2026"), options=ReadingOptions(date_order="month")))
    again = uploads.read_again(backend, done.id, b"tag,loop,signal\nFIC1.PV,F,PV\nFIC1.OP,F,OP\n").upload
    with backend.database.read() as connection:
        assert stored.reading_of(connection, int(again.id))["date_order"] == "month"
