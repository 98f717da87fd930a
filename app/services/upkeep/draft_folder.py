"""A folder that is written apart and appears whole; what killed processes left of such folders goes."""

import fcntl
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

PART, KILLED_S = ".part", 24 * 3600
NAMED = re.compile(r"\.(?P<of>.+)\.[a-z0-9_]{8}\.part", re.DOTALL)
"""As `mkdtemp` names a part: any other name is somebody's own."""
BEING_WRITTEN = "loopaudit-backup.lock"
"""In each part, and locked as long as the process lives that writes it."""


@dataclass(frozen=True)
class Draft:
    """`left`: the parts beside it that no living process wrote, which were removed."""

    folder: Path
    left: tuple[Path, ...]


@contextmanager
def draft_of(folder: Path) -> Iterator[Draft]:
    """A new place for what becomes `folder`; it goes where the block does not end well. What does becomes `folder` by
    its new name."""
    left = tuple(part for part in sorted(folder.parent.glob(f".*{PART}")) if _is_left(part, folder) and _removed(part))
    draft = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", suffix=PART, dir=folder.parent))
    lock = None
    try:
        lock = _locked_in(draft)
        yield Draft(draft, left)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise
    finally:
        if lock is not None:
            os.close(lock)


def settle(draft: Draft, folder: Path) -> None:
    """Whole, it takes its name; a lock that a kill leaves in it then is none of its files."""
    draft.folder.rename(folder)
    (folder / BEING_WRITTEN).unlink(missing_ok=True)


def _locked_in(draft: Path) -> int:
    """Under its name the file is never there without its lock."""
    unlocked = draft / f"{BEING_WRITTEN}.new"
    lock = os.open(unlocked, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    with suppress(OSError):  # a file system without locks: its age is all that tells whether it is left
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    unlocked.rename(draft / BEING_WRITTEN)
    return lock


def _is_left(part: Path, folder: Path) -> bool:
    """Whether it is a folder that was begun here. One without a lock, as older versions made them, is known by
    `folder`'s name and by its age. One that another user may not let us look into is not ours."""
    named = NAMED.fullmatch(part.name)
    with suppress(OSError):
        if named is not None and not part.is_symlink() and part.is_dir():
            return (part / BEING_WRITTEN).is_file() or (named["of"] == folder.name and _is_old(part))
    return False


def _is_old(part: Path) -> bool:
    return part.stat().st_mtime < time.time() - KILLED_S


def _removed(part: Path) -> bool:
    """False where somebody writes it still, or where it is not ours to remove."""
    with suppress(OSError):
        if not (part / BEING_WRITTEN).is_file():
            shutil.rmtree(part)
            return True
        lock = os.open(part / BEING_WRITTEN, os.O_RDWR)
        try:
            return _is_free(lock, part) and _emptied(part)
        finally:
            os.close(lock)
    return False


def _is_free(lock: int, part: Path) -> bool:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return _is_old(part)
    return True


def _emptied(part: Path) -> bool:
    """The lock goes last: what is left of a removal that was killed is still known."""
    for inside in part.iterdir():
        if inside.is_dir() and not inside.is_symlink():
            shutil.rmtree(inside)
        elif inside.name != BEING_WRITTEN:
            inside.unlink()
    shutil.rmtree(part)
    return True
