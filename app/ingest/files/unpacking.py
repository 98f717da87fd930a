"""gzip in bounded steps: its members one after the other, with caps on what comes out."""

import zlib
from collections.abc import Iterator

from app.errors import DataError
from app.ingest.model import IngestOptions

GZIP = b"\x1f\x8b"
ZIP = (b"PK\x03\x04", b"PK\x05\x06", b"PK\x07\x08PK\x03\x04")  # with files, without any, in parts
STEP_BYTES = 1 << 18
TAKEN_BYTES = 1 << 15  # at a time: what is left of it is copied at each step and each member
RATIO_FREE_BYTES = 64 << 20  # below this a high ratio is a quiet plant, not a bomb


class Unpacking:
    """A gzip file that comes piece by piece. `complete`: its last member has ended; `padded`: something that is no
    member follows, which is passed over."""

    def __init__(self, options: IngestOptions) -> None:
        self._options = options
        self._unzip = zlib.decompressobj(31)
        self._between = b""
        self._packed = 0
        self.unpacked = 0
        self.complete = False
        self.padded = False

    def steps(self, piece: bytes) -> Iterator[bytes]:
        """What comes out of the next piece, a step at a time.

        Raises zlib.error where it is damaged, DataError beyond the caps of the options:
        "decompressed_too_large" where it is too much in all, "compression_ratio" where it is too much for its size.
        """
        for start in range(0, len(piece), TAKEN_BYTES):
            yield from self._steps(piece[start : start + TAKEN_BYTES])

    def _steps(self, taken: bytes) -> Iterator[bytes]:
        self._packed += len(taken)
        waiting = self._next_member(taken) if self.complete else taken
        while waiting:
            out = self._unzip.decompress(waiting, STEP_BYTES)
            self.unpacked += len(out)
            self._check_size()
            yield out
            self.complete = self._unzip.eof
            waiting = self._next_member(self._unzip.unused_data) if self.complete else self._unzip.unconsumed_tail

    def _next_member(self, data: bytes) -> bytes:
        """What another member begins with; nothing where none does, or its first byte alone is there yet."""
        self._between += data
        if self.padded or len(self._between) < len(GZIP):
            return b""
        member, self._between = self._between, b""
        self.padded = not member.startswith(GZIP)
        if self.padded:
            return b""
        self._unzip, self.complete = zlib.decompressobj(31), False
        return member

    @property
    def is_whole(self) -> bool:
        """Whether all that came were members, each to its end."""
        return self.complete and not self.padded and not self._between

    def _check_size(self) -> None:
        if self.unpacked > self._options.max_bytes:
            raise DataError(
                "decompressed_too_large", f"unpacks to more than {self._options.max_bytes:,} bytes; send it in parts"
            )
        if self.unpacked > RATIO_FREE_BYTES and self.unpacked > self._packed * self._options.max_ratio:
            raise DataError(
                "compression_ratio",
                f"unpacks to more than {self._options.max_ratio:g} times its size, as no export does; send it unpacked",
            )
