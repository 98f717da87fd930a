"""The fingerprint of what a gzip file holds, made as it comes: the same export packed once more is the same export."""

import hashlib
import zlib

from app.errors import DataError
from app.ingest import GZIP, IngestOptions, Unpacking, is_read_packed

LARGEST_CONTENT_BYTES = 16 << 30
"""Whoever sends the file waits while it is unpacked, a minute for so much; a worker takes more."""
START_BYTES = 128


class ContentDigest:
    """Takes the bytes of an upload one after the other, as they come. `is_packed`: it began as gzip does."""

    def __init__(self) -> None:
        self._unpacking = Unpacking(IngestOptions(max_bytes=LARGEST_CONTENT_BYTES))
        self._digest = hashlib.sha256()
        self._start = b""
        self._begun = False
        self.is_packed = False

    def begin(self, data: bytes) -> None:
        """Looks at the first bytes of all."""
        if not self._begun:
            self._begun, self.is_packed = True, data.startswith(GZIP)

    def update(self, data: bytes) -> None:
        try:
            for out in self._unpacking.steps(data):
                self._start += out[: START_BYTES - len(self._start)]
                self._digest.update(out)
        except (zlib.error, DataError):
            self.is_packed = False  # damaged, or a bomb: what it holds is not known, and its bytes stand for it

    def hexdigest(self) -> str | None:
        """None where it is no whole gzip file, or one that is read otherwise than what it holds would be by itself."""
        known = self.is_packed and self._unpacking.is_whole and is_read_packed(self._start)
        return self._digest.hexdigest() if known else None
