"""A file that is received: taken, written and fingerprinted side by side, and a fault of any of them is told."""

import errno
import hashlib
import threading
from pathlib import Path

import pytest

from app.services.intake.synced import PIECE_BYTES, SyncedFile


class Slow:
    """A file that writes a few bytes at a time, and not before it is told to."""

    def __init__(self, file: object) -> None:
        self.file, self.may_write, self.waited_in_vain = file, threading.Event(), False

    def write(self, data: memoryview) -> int:
        self.waited_in_vain |= not self.may_write.wait(5)
        return self.file.write(data[: PIECE_BYTES // 3])

    def __getattr__(self, name: str) -> object:
        return getattr(self.file, name)


def test_bytes_are_taken_while_those_before_are_written(tmp_path: Path) -> None:
    file = SyncedFile(tmp_path / "draft")
    slow = file._file = Slow(file._file)
    sent = [bytes([k]) * PIECE_BYTES for k in range(3)]
    file.write(sent[0])
    file.write(sent[1][:7])
    slow.may_write.set()
    for piece in (sent[1][7:], sent[2]):
        file.write(piece)
    fingerprint = file.sync()
    file.close()
    assert not slow.waited_in_vain
    assert (tmp_path / "draft").read_bytes() == b"".join(sent)
    assert fingerprint == hashlib.sha256(b"".join(sent)).hexdigest()


def test_what_could_not_be_written_is_told_before_the_file_counts_as_synced(tmp_path: Path) -> None:
    class Full(Slow):
        def write(self, data: memoryview) -> int:
            raise OSError(errno.ENOSPC, "No space left on device")

    file = SyncedFile(tmp_path / "draft")
    file._file = Full(file._file)
    file.write(b"x" * PIECE_BYTES)
    for _ in range(2):
        with pytest.raises(OSError, match="No space"):
            file.sync()
    file.close()
