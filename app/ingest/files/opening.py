"""From a file to chunks of whole UTF-8 lines: gzip in bounded steps, the encoding found, line ends made one."""

import codecs
import os
import re
import zlib
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from app.errors import DataError
from app.ingest.files.heading import after_lines, whole_heading
from app.ingest.files.unpacking import GZIP, STEP_BYTES, ZIP, Unpacking
from app.ingest.model import IngestOptions

HEAD_BYTES = 1 << 18
HEAD_LINES = 12  # a row of 50,000 columns is half a megabyte
HEAD_LIMIT = 1 << 24
TAIL_BYTES = 1 << 16
SAMPLES, SAMPLE_BYTES = 16, 1 << 14
MOST_ROWS = 2_000_000  # that are asked one by one for what samples leave open
PROBED_BYTES = 1 << 18
COUNTED_BYTES = 1 << 18
_BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),  # it begins with that of UTF-16
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_DOUBLE_BYTES = re.compile(rb"[\x80-\xff]{2,}")
_CHINESE = re.compile(r"[\u4e00-\u9fff]+")
_INSIDE_A_WORD = re.compile(r"(?<=[a-z])[\u4e00-\u9fff](?=[a-z])")  # two accented letters, as in Stellgröße
_INSIDE_CAPITALS = re.compile(rb"(?<=[A-Z])[\xc0-\xdf]{2}(?=[A-Z])")  # capitals and ß alone: a tag may be A泵PV
_LEAST_WHOLE = 2  # letters to a byte that is none, in UTF-8 with some damage
_LEAST_TEXT = 0.1  # of a file of text with holes
_ZEROS = re.compile(rb"\0+")
_OLD_OFFICE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_DBASE = (b"\x03", b"\x30", b"\x83", b"\x8b", b"\xf5")
_CONTROL = bytes(set(range(32)) - set(b"\t\n\r\f\x1a"))


@dataclass(frozen=True)
class Lines:
    """Whole lines of UTF-8 text, each ended by a line feed: `count` of them; `first` is the number of the first, from
    1."""

    data: bytes
    first: int
    count: int


class TextFile:
    """A text file as lines of UTF-8; `encoding` is what was found, `notes` what was odd."""

    def __init__(self, path: Path, options: IngestOptions) -> None:
        self._path = path
        self._options = options
        self.notes: list[str] = []
        self._size = max(path.stat().st_size, 1)
        self._taken = 0
        first = self._first_bytes()
        _refuse_archive(first)
        self.encoding = detect_encoding(first)
        self._bare_returns = self._doubled_returns = False
        head = self._decode_head(first)
        if not head.strip():
            raise DataError("empty_file", "the file holds nothing; an export with a time column and signals is needed")
        self._heading = whole_heading(head)
        self.head = self._heading.text + after_lines(head, self._heading.count)
        _refuse_binary(self.head)

    @property
    def compressed(self) -> bool:
        with self._path.open("rb") as stream:
            return stream.read(2) == GZIP

    @property
    def share_taken(self) -> float:
        """How much of the file, 0 to 1, has been taken from the disk; its rows may be read a little later."""
        return min(self._taken / self._size, 1.0)

    def _first_bytes(self) -> bytes:
        taken = bytearray()
        for piece in self._bytes():
            taken += piece
            if len(taken) >= HEAD_BYTES and (len(taken) >= HEAD_LIMIT or taken.count(b"\n") >= HEAD_LINES):
                break
        return bytes(taken)

    def _decode_head(self, first: bytes) -> str:
        text = codecs.getincrementaldecoder(self.encoding)("replace").decode(first)
        self._bare_returns = "\r" in text and "\n" not in text
        self._doubled_returns = "\r\r\n" in text
        return _with_line_feeds(text).replace("\r", "\n" if self._bare_returns else " ")

    def tail(self) -> str:
        """Whole lines from the file's end; nothing where it is in another encoding than UTF-8 or short. A packed file
        is unpacked for it, to its end."""
        if self._bare_returns or not self.encoding.startswith("utf-8"):
            return ""
        size, last = self._last_unpacked() if self.compressed else self._last_bytes()
        if size < 2 * TAIL_BYTES:
            return ""
        return _with_line_feeds(last.decode("utf-8", "replace")).partition("\n")[2]

    def _last_bytes(self) -> tuple[int, bytes]:
        """The size of the file, and the last `TAIL_BYTES` of it."""
        size = self._path.stat().st_size
        with self._path.open("rb") as stream:
            stream.seek(max(0, size - TAIL_BYTES))
            return size, stream.read(TAIL_BYTES)

    def _last_unpacked(self) -> tuple[int, bytes]:
        """The same of what is packed: no more than a step of it is in memory at once."""
        size, last = 0, b""
        for piece in self._bytes():
            size += len(piece)
            last = (last + piece)[-TAIL_BYTES:]
        return size, last

    def samples(self, start: int) -> list[str]:
        """Whole lines from places all over the file from byte `start` on, in their order; nothing where it is in
        another encoding than UTF-8. A packed file is unpacked for it, to its end."""
        if self._bare_returns or not self.encoding.startswith("utf-8"):
            return []
        size = sum(map(len, self._bytes())) if self.compressed else self._path.stat().st_size
        places = [*range(start, size, max(SAMPLE_BYTES, (size - start) // SAMPLES))]
        if places and size - places[-1] > 2 * SAMPLE_BYTES:
            places.append(size - SAMPLE_BYTES)  # what was appended last
        taken = self._unpacked_at(places) if self.compressed else self._bytes_at(places)
        texts = (_with_line_feeds(data.decode("utf-8", "replace")) for data in taken)
        return [text.partition("\n")[2].rpartition("\n")[0] for text in texts]

    def _bytes_at(self, places: Iterable[int]) -> Iterator[bytes]:
        with self._path.open("rb") as stream:
            yield from (os.pread(stream.fileno(), SAMPLE_BYTES, place) for place in places)

    def _unpacked_at(self, places: Iterable[int]) -> Iterator[bytes]:
        """The same of what is packed, each as far as it is in one step of it."""
        begun, left = 0, deque(places)
        for piece in self._bytes():
            while left and left[0] < begun + len(piece):
                at = left.popleft() - begun
                yield piece[at : at + SAMPLE_BYTES]
            begun += len(piece)

    def chunks(self) -> Iterator[Lines]:
        """The whole file; memory is bounded by the chunk size and the longest line allowed."""
        number, carry = 1, b""
        for piece in self._with_heading(self._utf8()):
            end = piece.rfind(b"\n")
            if end < 0:
                carry += piece
                self._check_line(carry)
                continue
            whole = not carry and end + 1 == len(piece)
            data = piece if whole else b"".join((carry, memoryview(piece)[: end + 1]))
            carry = piece[end + 1 :]
            data = self._mended(data)
            lines = Lines(data, number, count_lines(data))
            yield lines
            number += lines.count
        if carry:
            yield Lines(self._mended(carry + b"\n"), number, 1)

    def _mended(self, data: bytes) -> bytes:
        """Without doubled returns, and without byte order marks: each of several files put in one begins with its
        own."""
        if self._doubled_returns:
            data = data.replace(b"\r\r\n", b"\r\n")
        return data.replace(codecs.BOM_UTF8, b"") if codecs.BOM_UTF8[:1] in data else data

    def _with_heading(self, pieces: Iterator[bytes]) -> Iterator[bytes]:
        """The same text with its heading as it was made whole."""
        taken, count = b"", self._heading.count
        for piece in pieces:
            taken += piece
            if taken.count(b"\n") >= count:
                yield self._heading.text.encode("utf-8", "replace") + after_lines(taken, count)
                yield from pieces
                return
        yield taken

    def _check_line(self, carry: bytes) -> None:
        if len(carry) > self._options.max_line_bytes:
            limit = self._options.max_line_bytes
            raise DataError(
                "line_too_long", f"a line is longer than {limit:,} bytes; an export has one row of samples a line"
            )

    def _utf8(self) -> Iterator[bytes]:
        if self.encoding in ("utf-8", "utf-8-sig") and not self._bare_returns:
            yield from self._large_pieces()
            return
        decoder = codecs.getincrementaldecoder(self.encoding)("replace")
        for piece in self._large_pieces():
            yield self._one_line_end(decoder.decode(piece)).encode("utf-8", "replace")
        yield self._one_line_end(decoder.decode(b"", final=True)).encode("utf-8", "replace")

    def _one_line_end(self, text: str) -> str:
        return text.replace("\r", "\n") if self._bare_returns else text

    def _large_pieces(self) -> Iterator[bytes]:
        taken: list[bytes] = []
        size = 0
        for piece in self._bytes(self._options.chunk_bytes):
            taken.append(piece)
            size += len(piece)
            if size >= self._options.chunk_bytes:
                yield b"".join(taken)
                taken, size = [], 0
        if taken:
            yield b"".join(taken)

    def _bytes(self, step: int = STEP_BYTES) -> Iterator[bytes]:
        with self._path.open("rb") as stream:
            packed = stream.read(2) == GZIP
            stream.seek(0)
            if packed:
                yield from self._unpacked(self._noted(stream, iter(lambda: stream.read(STEP_BYTES), b"")))
            else:
                yield from self._noted(stream, iter(lambda: stream.read(_to_line_end(stream, step)), b""))

    def _noted(self, stream: IO[bytes], pieces: Iterator[bytes]) -> Iterator[bytes]:
        for piece in pieces:
            self._taken = stream.tell()
            yield piece

    def _unpacked(self, raw: Iterator[bytes]) -> Iterator[bytes]:
        """Members of a gzip file one after the other; a damaged end keeps what came before it."""
        unpacking = Unpacking(self._options)
        try:
            for piece in raw:
                yield from unpacking.steps(piece)
        except zlib.error:
            self._damaged(unpacking.unpacked)
            return
        if not unpacking.complete:
            self._damaged(unpacking.unpacked)

    def _damaged(self, unpacked: int) -> None:
        if unpacked == 0:
            raise DataError("not_an_export", "the gzip file is damaged from its start; export it again")
        note = f"the gzip file is damaged after {unpacked:,} bytes; what came before is kept"
        if note not in self.notes:
            self.notes.append(note)


def _with_line_feeds(text: str) -> str:
    """With one kind of line end, and without byte order marks."""
    return text.replace("\r\r\n", "\n").replace("\r\n", "\n").replace("\ufeff", "")


def count_lines(data: bytes) -> int:
    """Line feeds, counted without Python's lock: several times as fast as `bytes.count`."""
    text = np.frombuffer(data, np.uint8)
    pieces = (text[start : start + COUNTED_BYTES] for start in range(0, len(text), COUNTED_BYTES))
    return sum(int(np.count_nonzero(piece == ord("\n"))) for piece in pieces)


def _to_line_end(stream: IO[bytes], step: int) -> int:
    """How many bytes to read, `step` or some more, so that they end where a line does: what is read so needs no
    joining."""
    return step + os.pread(stream.fileno(), PROBED_BYTES, stream.tell() + step).find(b"\n") + 1


def detect_encoding(first: bytes) -> str:
    """A byte order mark, then zeros in every other byte, then UTF-8, then GB 18030 where it gives Chinese, else
    Windows-1252."""
    for mark, name in _BOMS:
        if first.startswith(mark):
            return name
    even, odd = first[0:4096:2].count(0), first[1:4096:2].count(0)
    half = max(1, min(len(first), 4096) // 2)
    if odd > 0.4 * half and even < 0.1 * half:
        return "utf-16-le"
    if even > 0.4 * half and odd < 0.1 * half:
        return "utf-16-be"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(first)
    except UnicodeDecodeError:
        if _is_damaged_utf8(first):
            return "utf-8"
        return "gb18030" if _reads_as_chinese(first) else "cp1252"
    return "utf-8"


def _is_damaged_utf8(first: bytes) -> bool:
    """Whether far more letters beyond ASCII are whole than bytes are none: in another encoding they seldom are."""
    text = codecs.getincrementaldecoder("utf-8")("replace").decode(first)
    beyond, damaged = sum(character > "\x7f" for character in text), text.count("\N{REPLACEMENT CHARACTER}")
    return beyond > _LEAST_WHOLE * damaged


def _reads_as_chinese(first: bytes) -> bool:
    strange_bytes = sum(byte > 127 for byte in first)
    if sum(map(len, _DOUBLE_BYTES.findall(first))) < 0.8 * strange_bytes:
        return False  # an accented letter stands alone between ASCII ones
    try:
        text = codecs.getincrementaldecoder("gb18030")().decode(first)
    except UnicodeDecodeError:
        return False
    strange = [character for character in text if ord(character) > 127]
    common = sum("\u4e00" <= character <= "\u9fff" or "\u3000" <= character <= "\u303f" for character in strange)
    words = len(_CHINESE.findall(text))
    accented = len(_INSIDE_A_WORD.findall(text)) + len(_INSIDE_CAPITALS.findall(first))
    return bool(strange) and common >= 0.8 * len(strange) and 2 * accented < words


def _refuse_archive(first: bytes) -> None:
    """A workbook is such an archive as well, and was opened before. One that stores its files as they are would be read
    as text."""
    if first.startswith(ZIP):
        raise DataError(
            "not_an_export",
            "this is a zip archive, and no xlsx that can be read: unpack it and send its files, or send them as .gz",
        )
    if first.startswith(_OLD_OFFICE):
        raise DataError("not_an_export", "this is a workbook of the old form (.xls): save it as .xlsx or CSV")
    if _is_dbase(first):
        raise DataError(
            "not_an_export",
            "this is a dBase table (.dbf), as recorders and RSTrendX write it: save it as CSV with the names of the "
            "tags above their columns, which may stand in another file beside it",
        )


def _is_dbase(first: bytes) -> bool:
    """A day in this century or the last, and descriptions of columns, 32 bytes each, that end with a return."""
    month, day, width = first[2:3], first[3:4], int.from_bytes(first[8:10], "little")
    dated = first[:1] in _DBASE and b"\1" <= month <= b"\x0c" and b"\1" <= day <= b"\x1f"
    return dated and width > 32 and width % 32 in (1, 8) and first[width - 1 : width] in (b"\r", b"\0")


def _refuse_binary(head: str) -> None:
    """Zeros one behind the other count once, unless they are most of it: a machine that lost its power leaves a block
    of them in a file of text."""
    whole = head.encode("utf-8", "replace")
    sample = _ZEROS.sub(b"\0", whole)
    sample = sample if len(sample) > _LEAST_TEXT * len(whole) else whole
    controls = len(sample) - len(sample.translate(None, _CONTROL))
    doubtful = head.count("\N{REPLACEMENT CHARACTER}")
    if controls > 0.001 * len(sample) + 1 or doubtful > 0.1 * len(head):
        raise DataError(
            "not_an_export",
            "this is binary, not an export; CSV or TSV text, gzip, parquet, xlsx or mat is needed",
        )
