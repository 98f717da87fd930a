"""A data folder that is away, as a share that is not mounted, is waited for: none is made in its place."""

import errno
import os
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy.exc import OperationalError

from app.errors import RequestError
from app.main import create_app
from app.services.backend import Backend
from app.services.data_folder import tell_if_away
from app.services.upkeep import backup as backups
from app.services.upkeep import doctor
from app.services.upkeep.presence import LOCK, alone, at_work
from app.services.upkeep.readiness import readiness
from app.services.upkeep.sweep import sweep
from app.services.upkeep.tables import migrate
from app.settings import Settings
from app.storage import schema
from tests.conftest import served
from tests.services.sent_uploads import send

EXPORT = b"time,FIC1.PV,FIC1.OP\n0,1,2\n60,2,3\n"


@contextmanager
def away(settings: Settings) -> Iterator[None]:
    """Its place is there, as that of a share is."""
    folder = settings.uploads_dir
    folder.rename(folder.with_name("away"))
    yield
    folder.with_name("away").rename(folder)


def test_where_the_data_base_knows_of_exports_none_is_made(backend: Backend, caplog: pytest.LogCaptureFixture) -> None:
    settings = backend.settings
    send(backend, EXPORT)
    with away(settings):
        migrate(settings)
        with at_work(settings), closing(Backend.open(settings)) as opened:
            assert not settings.uploads_dir.exists()
            assert readiness(opened).checks["data_folder"] == "gone"
        tell_if_away(settings)
        assert "mount it" in caplog.text
        with served(create_app(settings)) as client:
            assert refusal_of(client) == (503, "data_folder_away")
        told = next(check for check in doctor.examine(settings) if check.name == "exports")
        assert f"mkdir -p -m 700 {settings.uploads_dir}" in told.advice
        assert not settings.uploads_dir.exists()


def test_a_restore_that_is_refused_makes_none_either(backend: Backend, tmp_path: Path) -> None:
    send(backend, EXPORT)
    backups.backup(backend.settings, tmp_path / "kept")
    with away(backend.settings):
        with pytest.raises(RequestError) as refused:
            backups.restore(backend.settings, tmp_path / "kept")
        assert refused.value.code == "not_empty"
        assert not backend.settings.uploads_dir.exists()


@pytest.mark.parametrize("had_lock", [True, False])
def test_one_that_is_read_only_keeps_no_process_from_starting(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, had_lock: bool
) -> None:
    if had_lock:
        with at_work(backend.settings):
            pass
    opened, access = os.open, os.access

    def read_only(path: Any, flags: int, *mode: int) -> int:
        if Path(path).name == LOCK and flags & (os.O_RDWR | os.O_CREAT):
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))
        return opened(path, flags, *mode)

    monkeypatch.setattr(os, "open", read_only)
    monkeypatch.setattr(os, "access", lambda path, how: not how & os.W_OK and access(path, how))
    with at_work(backend.settings):
        tell_if_away(backend.settings)
        assert "cannot be written to" in caplog.text
        if had_lock:
            with pytest.raises(RequestError) as refused, alone(backend.settings):
                pass
            assert refused.value.code == "still_running"


def refusal_of(client: httpx.Client) -> tuple[int, str]:
    answer = client.post("/v1/uploads", content=EXPORT)
    return answer.status_code, answer.json()["code"]


def test_a_new_one_is_made(backend: Backend) -> None:
    with away(backend.settings), closing(Backend.open(backend.settings)) as opened:
        assert readiness(opened).checks["data_folder"] == "ok"
        opened.settings.uploads_dir.rmdir()


@pytest.mark.parametrize("code", [errno.ESTALE, errno.EIO, errno.ENOTCONN])
def test_so_does_one_whose_share_answers_with_an_error(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    """NFS and file systems in user space do, where their server is away."""
    send(backend, EXPORT)
    looked_at, opened = os.stat, os.open
    away = (str(backend.settings.uploads_dir), str(backend.settings.data_dir / LOCK))

    def stat(path: Any, **how: Any) -> os.stat_result:
        if str(path) in away:
            raise OSError(code, os.strerror(code), str(path))
        return looked_at(path, **how)

    with monkeypatch.context() as patched:
        patched.setattr(os, "stat", stat)
        patched.setattr(os, "open", lambda path, *how: stat(path) if str(path) in away else opened(path, *how))
        with at_work(backend.settings), closing(Backend.open(backend.settings)):
            migrate(backend.settings)


@pytest.mark.parametrize("was_there", [False, True])
def test_where_that_could_not_be_told_at_the_start_a_sweep_makes_it(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, was_there: bool
) -> None:
    """A service that started before its database takes exports without anybody's help."""

    def is_away(*_: object) -> None:
        raise OperationalError("SELECT", {}, Exception("connection refused"))

    with ExitStack() as stack:
        stack.enter_context(away(backend.settings))
        if not was_there:
            with monkeypatch.context() as patched:
                patched.setattr(schema, "current_revision", is_away)
                backend = stack.enter_context(closing(Backend.open(backend.settings)))
        assert not backend.settings.uploads_dir.exists()
        with suppress(RequestError):  # of retention, which looks into the folder
            sweep(backend)
        assert backend.settings.uploads_dir.exists() != was_there
        if not was_there:
            backend.settings.uploads_dir.rmdir()


def test_where_that_cannot_be_told_none_is_made(tmp_path: Path) -> None:
    settings = Settings(data_dir=tmp_path, database_url="postgresql://nobody@127.0.0.1:1/away")
    with at_work(settings), closing(Backend.open(settings)):
        assert not settings.uploads_dir.exists()
