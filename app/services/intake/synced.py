"""A file that is written, fingerprinted and brought to the disk all at once, so that its sync has little left to do."""

import hashlib
import os
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from app.services.intake import drafts
from app.services.intake.content import ContentDigest

PIECE_BYTES = 1 << 20
AHEAD_BYTES = 8 << 20


class SyncedFile:
    """Takes bytes one after the other; `sync` gives their SHA-256 when they are on disk, `content` then that of what
    they hold, where they are a gzip file."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("xb", buffering=0)
        drafts.hold(self._file.fileno())
        self._digest = hashlib.sha256()
        self._content = ContentDigest()
        self._waiting: list[bytes] = []
        self._waits = 0
        self._working: list[Future[None]] = []
        self._hashing = ThreadPoolExecutor(1, thread_name_prefix="fingerprint")
        self._writing = ThreadPoolExecutor(1, thread_name_prefix="writing")
        self._unpacking = ThreadPoolExecutor(1, thread_name_prefix="unpacking")
        self._started = 0
        self._written = 0
        self.size = 0

    def write(self, data: bytes) -> None:
        """Raises OSError where bytes taken before could not be written."""
        self._waiting.append(data)
        self._waits += len(data)
        self.size += len(data)
        if self._waits >= PIECE_BYTES:
            self._take()

    def sync(self) -> str:
        """The fingerprint of all that was written; it is on disk then."""
        self._take()
        self._finish()
        os.fsync(self._file.fileno())
        return self._digest.hexdigest()

    @property
    def content(self) -> str | None:
        return self._content.hexdigest()

    def close(self) -> None:
        for threads in (self._hashing, self._writing, self._unpacking):
            threads.shutdown()
        self._file.close()

    def _take(self) -> None:
        """What waits is written, hashed and unpacked in threads while more comes in: none of it needs Python's lock."""
        self._finish()
        data = b"".join(self._waiting)
        self._waiting, self._waits = [], 0
        self._working = [self._hashing.submit(self._digest.update, data), self._writing.submit(self._write, data)]
        self._content.begin(data)
        if self._content.is_packed:
            self._working.append(self._unpacking.submit(self._content.update, data))

    def _finish(self) -> None:
        for work in self._working:
            work.result()

    def _write(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) :]
        self._written += len(data)
        if self._written - self._started >= AHEAD_BYTES:
            self._start_writing_back()

    def _start_writing_back(self) -> None:
        """Linux begins to write dirty pages that are said not to be needed, and keeps them until they are written."""
        if hasattr(os, "posix_fadvise"):
            length = self._written - self._started
            os.posix_fadvise(self._file.fileno(), self._started, length, os.POSIX_FADV_DONTNEED)
        self._started = self._written
