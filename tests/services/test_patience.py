"""A database that is away for a while costs time, and neither work nor attempts."""

import errno
import io
import os
import resource
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

import pytest
from psycopg.errors import DiskFull
from sqlalchemy import update
from sqlalchemy.exc import OperationalError

from app.ingest.tables import spilling
from app.services import data_folder, patience
from app.services.auditing import audits, chunks
from app.services.backend import Backend
from app.services.database_errors import no_room
from app.services.explaining import explanations, working
from app.services.intake import reading, uploads
from app.services.patience import patiently
from app.services.upkeep.readiness import readiness
from app.services.upkeep.sweep import sweep
from app.storage import explanations as stored_explanations
from app.storage import uploads as stored
from app.storage.tables import explanations as explanations_table
from app.storage.tables import uploads as uploads_table
from app.storage.types import clock_s
from tests.services.explained_loops import keep, record
from tests.services.sent_uploads import export
from tests.services.sent_uploads import send as send_export


class Away:
    """An action that finds the database away so many times."""

    def __init__(self, times: int) -> None:
        self.times = times
        self.calls = 0

    def __call__(self, *_: object) -> str:
        self.calls += 1
        if self.calls <= self.times:
            raise OperationalError("SELECT 1", {}, Exception("the server is away"))
        return "done"


@pytest.fixture
def pauses(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The pauses that were made, on a clock that only they move."""
    made: list[float] = []
    monkeypatch.setattr(patience.time, "sleep", made.append)
    monkeypatch.setattr(patience.time, "monotonic", lambda: sum(made))
    return made


def test_it_is_tried_again_with_growing_pauses(pauses: list[float]) -> None:
    assert patiently(Away(8), at_most_s=40.0) == "done"
    assert pauses == [0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0]


def test_its_patience_ends(pauses: list[float]) -> None:
    away = Away(100)
    with pytest.raises(OperationalError):
        patiently(away, at_most_s=10.0)
    assert sum(pauses) <= 10.0
    assert away.calls == len(pauses) + 1


def test_another_fault_is_not_tried_again(pauses: list[float]) -> None:
    with pytest.raises(ZeroDivisionError):
        patiently(lambda: 1 / 0, at_most_s=10.0)
    assert pauses == []


def breaking(action: Callable[..., object], times: int) -> Callable[..., object]:
    away = Away(times)

    def broken(*arguments: object, **named: object) -> object:
        away()
        return action(*arguments, **named)

    return broken


def send(backend: Backend, loop: str = "FIC1") -> str:
    lines = [f"time,{loop}.PV,{loop}.OP", *(f"{1_750_000_000 + 60 * i},{20 + i % 7},{50 + i % 5}" for i in range(200))]
    with uploads.receive(backend, filename="plant.csv") as receiving:
        receiving.write("\n".join(lines).encode())
        return receiving.commit().upload.id


def test_a_chunk_outlasts_an_outage_at_its_first_attempt(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, pauses: list[float], warm_kernels: None
) -> None:
    reading.read_upload(backend, int(send(backend)), "reader")
    run = audits.start_audit(backend)
    for module, name in ((chunks.items, "claim"), (chunks.series, "windows"), (chunks.verdict_writing, "add")):
        monkeypatch.setattr(module, name, breaking(getattr(module, name), 2))
    assert chunks.audit_chunk(backend, int(run.id), "worker") == 1
    assert audits.get_audit(backend, run.id).state == "done"
    assert len(pauses) == 6


def test_an_explanation_outlasts_an_outage_at_its_first_attempt(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, pauses: list[float]
) -> None:
    keep(backend, "TIC1", record())
    asked = explanations.ask(backend, "TIC1")
    for module, name in (
        (working.explanations, "claim_next"),
        (working.series, "readable"),
        (working.explanations, "end"),
    ):
        monkeypatch.setattr(module, name, breaking(getattr(module, name), 2))
    monkeypatch.setattr(working, "_explained", lambda *_: working.Ending("failed", {"error_code": "as_asked"}))
    assert working.explain_next(backend, "worker")
    found = explanations.get_explanation(backend, "TIC1", asked["id"])
    assert (found["state"], found["error_code"]) == ("failed", "as_asked")
    assert len(pauses) == 6


def test_a_data_base_away_for_long_is_no_fault_of_the_explanation(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, pauses: list[float]
) -> None:
    keep(backend, "TIC1", record())
    asked = explanations.ask(backend, "TIC1")
    monkeypatch.setattr(working.series, "readable", Away(1000))
    with pytest.raises(OperationalError):
        working.explain_next(backend, "worker")
    assert explanations.get_explanation(backend, "TIC1", asked["id"])["state"] == "open"


def test_reading_outlasts_an_outage_at_its_first_attempt(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, pauses: list[float]
) -> None:
    upload = send(backend)
    for name in ("note_loops", "end"):
        monkeypatch.setattr(reading.uploads, name, breaking(getattr(reading.uploads, name), 2))
    reading.read_upload(backend, int(upload), "reader")
    found = uploads.get_upload(backend, upload)
    assert (found.state, found.rows_kept) == ("done", 200)
    assert len(pauses) == 4


def test_a_data_base_away_for_long_is_no_fault_of_the_file(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, pauses: list[float]
) -> None:
    """It stays to be read, and is read once the lease of this attempt is over."""
    upload = send(backend)
    monkeypatch.setattr(reading.uploads, "note_loops", Away(1000))
    with pytest.raises(OperationalError):
        reading.read_upload(backend, int(upload), "reader")
    assert uploads.get_upload(backend, upload).state == "reading"


NO_ROOM = [
    OSError(errno.ENOSPC, "No space left on device"),
    OperationalError("INSERT", {}, Exception("database or disk is full")),
    OperationalError("INSERT", {}, DiskFull("konnte Datei nicht erweitern: Auf dem Gerät ist kein Platz mehr frei")),
]


@pytest.mark.parametrize(
    ("error", "at"),
    list(zip(NO_ROOM, ["_read_file", "_store", "_end_read"], strict=True)),
    ids=["spilling", "sqlite", "postgresql"],
)
def test_a_full_disk_is_no_fault_of_the_file(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, pauses: list[float], error: Exception, at: str
) -> None:
    """However often it is tried, the upload is read when there is room again."""
    upload = send(backend)

    def full(*_: object) -> None:
        raise error

    with monkeypatch.context() as spoiled:
        spoiled.setattr(reading, at, full)
        for _ in range(backend.settings.max_reading_attempts + 5):
            with pytest.raises(type(error)) as raised:
                reading.read_upload(backend, int(upload), "reader")
            assert raised.value is error
            sweep(backend)
            found = uploads.get_upload(backend, upload)
            assert (found.state, found.reason) == ("received", None)
    reading.read_upload(backend, int(upload), "reader")
    assert uploads.get_upload(backend, upload).state == "done"


def test_a_data_folder_that_takes_nothing_is_no_fault_of_the_file(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its parts are put aside there while it is read."""
    upload = send(backend)

    def refuse(*_: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    with monkeypatch.context() as spoiled:
        spoiled.setattr(reading, "_read_file", refuse)
        spoiled.setattr(data_folder.os, "access", lambda path, mode: mode == os.F_OK)
        for _ in range(backend.settings.max_reading_attempts + 5):
            with pytest.raises(OSError, match="Read-only"):
                reading.read_upload(backend, int(upload), "reader")
            found = uploads.get_upload(backend, upload)
            assert (found.state, found.waits_for_room_since) == ("received", None)  # there is room enough
    reading.read_upload(backend, int(upload), "reader")
    assert uploads.get_upload(backend, upload).state == "done"


@pytest.mark.parametrize(("spare", "state"), [(41_000, "failed"), (10_000_000, "received")])
def test_what_could_never_fit_on_the_disk_fails_and_the_rest_waits(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, spare: int, state: str
) -> None:
    """Parts of 40 000 bytes found room when a part of the file was read: the whole takes more than the disk has."""
    data = export(rows=4000)
    upload = send_export(backend, data)
    options = reading._options
    small = {"chunk_bytes": 1 << 13, "buffered_values": 2000}
    monkeypatch.setattr(reading, "_options", lambda *known: replace(options(*known), **small))
    monkeypatch.setattr(reading.shutil, "disk_usage", lambda _: Usage(len(data) + spare))
    with monkeypatch.context() as spoiled:
        spoiled.setattr(spilling.tempfile, "TemporaryFile", Disk(room=40_000).file)
        if state == "received":
            with pytest.raises(OSError, match="No space"):
                reading.read_upload(backend, int(upload.id), "reader")
        else:
            reading.read_upload(backend, int(upload.id), "reader")
    found = uploads.get_upload(backend, upload.id)
    assert found.state == state
    if state == "failed":
        assert found.error_code == "larger_than_disk"
        assert "send it in parts" in (found.reason or "")
    else:
        reading.read_upload(backend, int(upload.id), "reader")
        assert uploads.get_upload(backend, upload.id).state == "done"


def test_parts_longer_than_the_system_lets_a_file_be_are_told(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload = send_export(backend, export(rows=4000))
    options = reading._options
    small = {"chunk_bytes": 1 << 13, "buffered_values": 2000}
    monkeypatch.setattr(reading, "_options", lambda *known: replace(options(*known), **small))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    def read_on(*arguments: Any, **named: Any) -> Any:
        """Only its parts: the database goes on."""
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, before[1]))
        try:
            return write(*arguments, **named)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    write = spilling.Spill._write
    monkeypatch.setattr(spilling.Spill, "_write", read_on)
    reading.read_upload(backend, int(upload.id), "reader")
    found = uploads.get_upload(backend, upload.id)
    assert (found.state, found.error_code) == ("failed", "larger_than_disk")
    assert "ulimit -f" in (found.reason or "")


@dataclass(frozen=True)
class Usage:
    total: int


class Disk:
    """Files that have room for so many bytes together."""

    def __init__(self, room: int) -> None:
        self.room = room

    def file(self, **_: object) -> io.BytesIO:
        disk = self

        class File(io.BytesIO):
            def write(self, data: object) -> int:
                size = memoryview(data).nbytes
                if size > disk.room:
                    raise OSError(errno.ENOSPC, "No space left on device")
                disk.room -= size
                return super().write(data)

        return File()


def full(*_: object) -> None:
    raise NO_ROOM[0]


def test_an_upload_that_waits_for_room_says_so_and_since_when(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    def waiting() -> tuple[object, object]:
        checks = readiness(backend).checks
        return checks["uploads_waiting_for_room"], checks["waiting_for_room_since"]

    upload, other = send(backend), send(backend, "FIC2")
    assert (uploads.get_upload(backend, upload).waits_for_room_since, waiting()) == (None, (0, None))
    with monkeypatch.context() as spoiled:
        spoiled.setattr(reading, "_read_file", full)
        for number in (upload, other, upload):
            with pytest.raises(OSError, match="No space"):
                reading.read_upload(backend, int(number), "reader")
    since = uploads.get_upload(backend, upload).waits_for_room_since
    later = uploads.get_upload(backend, other).waits_for_room_since
    assert since is not None
    assert later is not None
    assert datetime.fromisoformat(since) < datetime.fromisoformat(later)
    assert {row.id: row.waits_for_room_since for row in uploads.list_uploads(backend).rows}[upload] == since
    assert waiting() == (2, since)
    reading.read_upload(backend, int(upload), "reader")
    assert (uploads.get_upload(backend, upload).waits_for_room_since, waiting()[0]) == (None, 1)
    monkeypatch.setattr(reading, "_read_file", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        reading.read_upload(backend, int(other), "reader")
    assert waiting() == (0, None)  # what is wrong with it now is something else


def test_what_found_no_room_is_tried_again_with_pauses_that_grow_to_minutes(backend: Backend) -> None:
    upload = int(send(backend))
    for number, pause_s in enumerate([20.0, 40.0, 80.0, 160.0, 300.0, 300.0]):
        with backend.database.write() as connection:
            claim = stored.claim(connection, upload, f"reader {number}", 40.0, max_attempts=1)
            assert claim is not None
            stored.wait(connection, claim, first_pause_s=20.0, for_room=True)
        assert not announced_after(backend, pause_s - 10)
        assert announced_after(backend, pause_s + 10)
    with backend.database.write() as connection:
        other = stored.claim(connection, upload, "other", 40.0, max_attempts=1)
        assert other is not None
        stored.wait(connection, claim, first_pause_s=20.0, for_room=True)  # who had it before has nothing to hand back
        assert stored.renew(connection, other, 40.0)


def announced_after(backend: Backend, seconds: float) -> bool:
    """Whether the upload is announced again so long after it was handed back."""
    with backend.database.write() as connection:
        connection.execute(update(uploads_table).values(announced_s=clock_s() - seconds))
        return bool(stored.to_announce(connection, 20.0, 40.0))


def test_a_full_disk_is_not_waited_for() -> None:
    calls: list[int] = []

    def action() -> None:
        calls.append(1)
        raise OperationalError("INSERT", {}, Exception("database or disk is full"))

    with pytest.raises(OperationalError):
        patiently(action, 60.0)
    assert len(calls) == 1


def test_a_full_disk_is_no_fault_of_the_explanation(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, pauses: list[float]
) -> None:
    """However often its answer finds no room, it waits, says so and since when, and is there when there is room."""
    keep(backend, "TIC1", record(step=5.0))
    asked = explanations.ask(backend, "TIC1")
    end = stored_explanations.end
    monkeypatch.setattr(working, "_explained", lambda *_: working.Ending("done", {"verdict": "consistent"}))

    def full(*_: object) -> None:
        raise NO_ROOM[1]

    def state() -> tuple[object, ...]:
        found = explanations.get_explanation(backend, "TIC1", asked["id"])
        return found["state"], found["error_code"], found["waits_for_room_since"] is not None

    monkeypatch.setattr(stored_explanations, "end", full)
    assert state() == ("open", None, False)
    for _ in range(backend.settings.max_attempts + 2):
        with pytest.raises(OperationalError, match="disk is full"):
            working.explain_next(backend, "w")
        assert sweep(backend).announced == 0, "it rests before the next try"
        rested(backend)
        assert sweep(backend).announced == 1
        assert state() == ("open", None, True)
    since = explanations.get_explanation(backend, "TIC1", asked["id"])["waits_for_room_since"]
    (listed,) = explanations.list_explanations(backend, "TIC1").rows
    assert listed["waits_for_room_since"] == since
    monkeypatch.setattr(stored_explanations, "end", end)
    assert working.explain_next(backend, "w")
    assert state() == ("done", None, False)


def rested(backend: Backend) -> None:
    with backend.database.write() as connection:
        long_ago = explanations_table.c.announced_s - explanations_table.c.pause_s - 1.0
        connection.execute(update(explanations_table).values(announced_s=long_ago))


def test_words_in_what_was_sent_tell_nothing_of_the_disk() -> None:
    lost = OperationalError("UPDATE", {"name": "No space left.csv"}, Exception("the server closed the connection"))
    assert not no_room(lost)
    assert all(map(no_room, NO_ROOM))
    assert no_room(OperationalError("INSERT", {}, Exception("could not extend file: No space left on device")))
