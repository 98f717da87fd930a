"""The draft of an upload: locked for as long as it comes in, so that what a process left half done is known from it,
whatever the clock says of their ages."""

import fcntl
import os
import uuid
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from app.settings import Settings

PREFIX = ".part-"


def new_draft(settings: Settings) -> Path:
    """Where an upload that begins is written."""
    return settings.uploads_dir / f"{PREFIX}{uuid.uuid4().hex}"


def hold(descriptor: int) -> None:
    """Until the file is closed, however its process ends."""
    with suppress(OSError):  # a file system without locks: its age is all that tells whether it is left
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def drafts(settings: Settings) -> Iterator[Path]:
    return settings.uploads_dir.glob(f"{PREFIX}*")


def is_held(draft: Path) -> bool:
    """Whether its upload comes in. Ask it of old ones alone: this tries the lock for a moment, and one that begins just
    then would not get it."""
    try:
        descriptor = os.open(draft, os.O_RDWR)
    except (FileNotFoundError, PermissionError):  # it has ended meanwhile, or is of another user: its age is what tells
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # as in `hold`
        return False
    finally:
        os.close(descriptor)
    return False
