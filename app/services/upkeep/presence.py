"""Who works on a data folder: a restore must be alone there, and nobody else is told by the data base alone."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from app.errors import RequestError
from app.settings import Settings

LOCK = "at-work.lock"


@contextmanager
def at_work(settings: Settings) -> Iterator[None]:
    """While a process serves, works or keeps the schedule. Ends with the process, however it ends.

    Raises RequestError("being_restored") while a backup is being brought back.
    """
    text = f"a backup is being brought back into {settings.data_dir}; start again when that is done"
    with _locked(settings, fcntl.LOCK_SH, RequestError("being_restored", text)):
        yield


@contextmanager
def alone(settings: Settings) -> Iterator[None]:
    """Raises RequestError("still_running") where a process is at work on the data folder."""
    text = f"`serve`, `worker`, `beat` or `nightly` is running on {settings.data_dir}; stop it first"
    with _locked(settings, fcntl.LOCK_EX, RequestError("still_running", text)):
        yield


@contextmanager
def _locked(settings: Settings, how: int, refusal: RequestError) -> Iterator[None]:
    with _lock_file(settings) as lock:
        try:
            fcntl.flock(lock, how | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise refusal from error
        except OSError:
            pass  # a file system without locks: the administrator's care is all there is
        yield


@contextmanager
def _lock_file(settings: Settings) -> Iterator[int]:
    settings.prepare_folders()
    lock = os.open(settings.data_dir / LOCK, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        yield lock
    finally:
        with suppress(OSError):
            os.close(lock)
