"""An export whose file no worker sees waits with growing pauses, says so, and is read once the file is there."""

import errno
import logging
from pathlib import Path

import pytest
from sqlalchemy import select, update

from app.queue import Queue
from app.services.backend import Backend
from app.services.intake import reading, uploads
from app.services.outward import UploadOut
from app.services.upkeep import doctor
from app.services.upkeep.sweep import announce_uploads
from app.storage import uploads as stored
from app.storage.tables import uploads as table
from app.storage.types import clock_s
from tests.services.sent_uploads import export, send

STALLED_S, LEASE_S = 20.0, 40.0


@pytest.fixture
def rung(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The uploads that were rung for."""
    numbers: list[int] = []

    def ring(_: Queue, upload_id: int) -> bool:
        numbers.append(upload_id)
        return True

    monkeypatch.setattr(Queue, "read_upload", ring)
    return numbers


def hide(backend: Backend, upload: UploadOut) -> Path:
    """As where a share is not mounted on the machine of the worker."""
    path = uploads.path_of(backend, upload.fingerprint)
    return path.rename(path.with_name("hidden"))


def hear(backend: Backend, upload: UploadOut) -> UploadOut:
    reading.read_upload(backend, int(upload.id), "reader")
    return uploads.get_upload(backend, upload.id)


def announced_after(backend: Backend, seconds: float) -> bool:
    with backend.database.write() as connection:
        connection.execute(update(table).values(announced_s=clock_s() - seconds))
        return bool(stored.to_announce(connection, STALLED_S, LEASE_S))


def test_it_is_rung_for_with_pauses_that_grow_to_minutes(backend: Backend) -> None:
    upload = send(backend, export())
    hide(backend, upload)
    for pause_s in (20.0, 40.0, 80.0, 160.0, 300.0, 300.0):
        for _ in range(3):  # doorbells that heaped up while no worker ran are no further tries
            hear(backend, upload)
        assert not announced_after(backend, pause_s - 10)
        assert announced_after(backend, pause_s + 10)


def test_it_tells_why_it_waits_and_since_when(backend: Backend, caplog: pytest.LogCaptureFixture) -> None:
    upload = send(backend, export())
    hidden = hide(backend, upload)
    assert upload.waits_for_file_since is None
    with caplog.at_level(logging.WARNING):
        found = hear(backend, upload)
    assert found.state == "received"
    assert found.waits_for_file_since is not None
    (line,) = [it for it in caplog.records if getattr(it, "code", "") == "file_unseen"]
    assert upload.id in line.getMessage()
    assert str(uploads.path_of(backend, upload.fingerprint)) in line.getMessage()
    assert hear(backend, upload).waits_for_file_since == found.waits_for_file_since
    assert uploads.list_uploads(backend).rows[0].waits_for_file_since == found.waits_for_file_since
    hidden.rename(uploads.path_of(backend, upload.fingerprint))
    done = hear(backend, upload)
    assert (done.state, done.waits_for_file_since) == ("done", None)


def test_a_sweep_that_sees_the_file_ends_a_pause_that_grew(backend: Backend, rung: list[int]) -> None:
    upload = send(backend, export())
    hidden = hide(backend, upload)
    rung.clear()
    hear(backend, upload)
    assert announced_after(backend, 30)
    assert announce_uploads(backend).announced == 0
    hidden.rename(uploads.path_of(backend, upload.fingerprint))
    assert announce_uploads(backend).announced == 1
    assert rung == [int(upload.id)]
    assert uploads.get_upload(backend, upload.id).waits_for_file_since is None
    assert announce_uploads(backend).announced == 0


def test_where_one_worker_sees_it_and_another_does_not_it_is_rung_for_as_any_other(backend: Backend) -> None:
    """A worker that rings amid a sweep is busy: another takes the message. Were each sweep of the one that sees the
    file to ring, and none of the other's, the one that does not would be asked each time."""
    upload = send(backend, export())
    with backend.database.write() as connection:
        assert stored.note_unseen(connection, int(upload.id), STALLED_S, LEASE_S)
    assert announce_uploads(backend).announced == 0
    assert announced_after(backend, 30)  # by whichever sweeps


def test_a_share_that_answers_with_an_error_is_one_whose_files_are_not_seen(
    backend: Backend, rung: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stale handle, or a folder that another user may not look into: it kept every upload from being announced."""
    upload = send(backend, export())
    of_path = Path.is_file

    def is_file(path: Path) -> bool:
        if path.parent == backend.settings.uploads_dir:
            raise OSError(errno.ESTALE, "Stale file handle", str(path))
        return of_path(path)

    with monkeypatch.context() as away:
        away.setattr(Path, "is_file", is_file)
        assert hear(backend, upload).waits_for_file_since is not None
        assert announced_after(backend, 30)
        rung.clear()
        assert announce_uploads(backend).announced == 0
    assert announce_uploads(backend).announced == 1
    assert rung == [int(upload.id)]


def test_more_uploads_than_a_statement_of_sqlite_has_places_are_seen_again(backend: Backend) -> None:
    upload = send(backend, export())
    hide(backend, upload)
    hear(backend, upload)
    with backend.database.write() as connection:
        assert stored.seen_again(connection, range(1, 300_000))


def test_an_upload_that_an_older_worker_read_waits_for_nothing(backend: Backend) -> None:
    """It knows nothing of what it leaves in the row, where it is still at work during an upgrade."""
    upload = send(backend, export())
    hidden = hide(backend, upload)
    hear(backend, upload)
    hidden.rename(uploads.path_of(backend, upload.fingerprint))
    with backend.database.write() as connection:
        connection.execute(update(table).values(state="done"))
    assert uploads.get_upload(backend, upload.id).waits_for_file_since is None


def test_the_same_content_sent_again_rings_at_once(backend: Backend, rung: list[int]) -> None:
    upload = send(backend, export())
    hide(backend, upload).unlink()
    hear(backend, upload)
    rung.clear()
    assert send(backend, export()).waits_for_file_since is None
    assert rung == [int(upload.id)]


def test_a_file_that_is_lost_amid_its_reading_is_rung_for_with_growing_pauses_too(backend: Backend) -> None:
    upload = send(backend, export())
    with backend.database.write() as connection:
        assert stored.claim(connection, int(upload.id), "killed", LEASE_S, 10)
    hide(backend, upload)
    assert hear(backend, upload).waits_for_file_since is None  # its lease has not ended: somebody reads it
    with backend.database.write() as connection:
        connection.execute(update(table).values(lease_until_s=clock_s() - 1))
    assert hear(backend, upload).waits_for_file_since is not None
    assert announced_after(backend, 30)
    assert not announced_after(backend, 30)


def test_other_waits_are_not_made_longer(backend: Backend) -> None:
    upload = send(backend, export())
    with backend.database.write() as connection:
        claim = stored.claim(connection, int(upload.id), "full", LEASE_S, 10)
        assert claim is not None
        stored.wait(connection, claim, STALLED_S, for_room=True)
    assert announced_after(backend, 30)
    with backend.database.read() as connection:
        assert connection.scalar(select(table.c.pause_s)) == STALLED_S


def test_the_doctor_tells_of_files_that_it_sees_and_workers_do_not(backend: Backend) -> None:
    upload = send(backend, export())
    hidden = hide(backend, upload)
    hear(backend, upload)
    hidden.rename(uploads.path_of(backend, upload.fingerprint))
    check = doctor.exports(backend)
    assert check.state == "problem"
    assert check.found.startswith("1 export is here and no worker sees it")
    hear(backend, upload)
    assert doctor.exports(backend).state == "ok"
