"""Who works on a data folder and on a database: a restore must be alone on both."""

import errno
import fcntl
import os
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path

from app.errors import RequestError
from app.services.data_folder import NewFolder
from app.services.database_errors import DATABASE_AWAY
from app.settings import Settings
from app.storage import Database
from app.storage.presence import present

LOCK = "at-work.lock"
SERVING = "serving.lock"
AWAY = (errno.ENOENT, errno.ESTALE, errno.EIO, errno.ENOTCONN, errno.EHOSTDOWN)
"""A folder that is not mounted, or is a share whose server is away."""


@contextmanager
def at_work(settings: Settings) -> Iterator[None]:
    """While a process serves, works or keeps the schedule. Ends with the process, however it ends.

    Raises RequestError("being_restored") while a backup is being brought back.
    """
    text = "a backup is being brought back into {}; start again when that is done"
    refusal = RequestError("being_restored", text.format(settings.data_dir))
    with _locked(settings, fcntl.LOCK_SH, refusal), ExitStack() as stack:
        with suppress(*DATABASE_AWAY):  # it is waited for; who brings back a backup needs it too
            if not stack.enter_context(present(settings.resolved_database_url, alone=False)):
                raise RequestError("being_restored", text.format("the database"))
        yield


@contextmanager
def only_server(settings: Settings, address: str) -> Iterator[None]:
    """While a process serves on the embedded default, with worker and schedule beside it: one such a data folder. The
    lock ends with the process, however it ends; what the file tells of it may be older than that.

    Raises RequestError("already_serving").
    """
    with _lock_file(settings, SERVING) as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise RequestError("already_serving", _already(settings, os.pread(lock, 500, 0))) from error
        except OSError:
            pass  # as below
        os.ftruncate(lock, 0)
        os.pwrite(lock, f"{address} (process {os.getpid()})".encode(), 0)
        yield


def _already(settings: Settings, told: bytes) -> str:
    where = f" on {told.decode(errors='replace')}" if told else ""
    text = "use that one or stop it first; another plant needs a LOOPAUDIT_DATA_DIR of its own"
    return f"`loopaudit serve` is running already{where}, with the data folder {settings.data_dir.absolute()}; {text}"


@contextmanager
def alone(settings: Settings) -> Iterator[None]:
    """Raises RequestError("still_running") where a process is at work on the data folder or on the database."""
    text = "`serve`, `worker`, `beat` or `nightly` is running on {}; stop it first"
    with (
        _locked(settings, fcntl.LOCK_EX, RequestError("still_running", text.format(settings.data_dir))),
        present(settings.resolved_database_url, alone=True) as nobody_else,
    ):
        if not nobody_else:
            raise RequestError("still_running", text.format("the database, from another data folder or machine"))
        yield


@contextmanager
def _locked(settings: Settings, how: int, refusal: RequestError) -> Iterator[None]:
    with _lock_file(settings, LOCK) as lock:
        try:
            fcntl.flock(lock, how | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise refusal from error
        except OSError:
            pass  # a file system without locks: the administrator's care is all there is
        yield


@contextmanager
def _lock_file(settings: Settings, name: str) -> Iterator[int]:
    with closing(Database(settings.resolved_database_url)) as database:
        NewFolder(settings, database).make()
    lock = _opened(settings.data_dir / name, to_write=name == SERVING)
    try:
        yield lock
    finally:
        with suppress(OSError):
            os.close(lock)


def _opened(file: Path, *, to_write: bool) -> int:
    """Where its folder is away, or read-only and without it, one that nobody else has."""
    try:
        return os.open(file, os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        if error.errno not in AWAY and (to_write or error.errno != errno.EROFS):
            raise
    with suppress(OSError):
        return os.open(file, os.O_RDONLY)
    return os.memfd_create(file.name)
