"""Numbers and structures out of a MATLAB file of version 5 to 7. Format: MAT-File Format, MathWorks.

Read here and not by scipy.io.loadmat: that believes what a file claims, so that a damaged file of 3 kB ends the process
(an element of a kind that there is not) and one of 200 bytes takes its memory (a cell array of a billion elements).
Here every claim is compared with the bytes that are there; what is neither numbers nor a structure is passed over.
"""

import struct
import zlib
from dataclasses import dataclass
from math import prod
from pathlib import Path

import numpy as np

from app.errors import DataError
from app.ingest.model import FloatArray, IngestOptions

UNPACKED_BYTES = 256 << 20
HEADER_BYTES = 128
DEEPEST = 8
ELEMENTS = 2_000_000  # fields of structures, all together
LONGEST_NAME = 64
MATRIX, COMPRESSED = 14, 15
STRUCT, FIRST_NUMERIC, LAST_NUMERIC, OPAQUE = 2, 6, 15, 17
COMPLEX = 0x0800
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
BYTE_ORDERS = {b"IM": "<", b"MI": ">"}
VERSIONS = {b"\x00\x01IM": 5, b"\x01\x00MI": 5, b"\x00\x02IM": 7.3, b"\x02\x00MI": 7.3}


@dataclass(frozen=True, eq=False)
class Structures:
    """A structure, or an array of them: the fields of each element."""

    elements: "tuple[dict[str, Value], ...]"


Value = FloatArray | Structures | None  # a vector or scalar of real numbers as (n,), structures, anything else


def is_matlab(start: bytes) -> bool:
    """By the first 128 bytes of a file, which end with its version and its order of bytes."""
    return start[124:128] in VERSIONS


def read_variables(path: Path, options: IngestOptions) -> dict[str, Value]:
    """The variables of a file.

    Raises DataError("matlab_version") for version 7.3, ("decompressed_too_large"), ("not_an_export").
    """
    limit = min(UNPACKED_BYTES, options.max_bytes)
    with path.open("rb") as stream:
        header = stream.read(HEADER_BYTES)
        data = stream.read(limit + 1)
    if len(data) > limit:
        raise too_large(limit)
    if VERSIONS[header[124:128]] != 5:
        text = "a MATLAB file of version 7.3 (HDF5) is not read; save it in MATLAB with save(..., '-v7')"
        raise DataError("matlab_version", text)
    reader = Reader(BYTE_ORDERS[header[126:128]], limit)
    return reader.variables(data)


class Reader:
    """Walks through the elements of a file."""

    def __init__(self, order: str, limit: int) -> None:
        self._order = order
        self._limit = limit
        self._fields = 0

    def variables(self, data: bytes) -> dict[str, Value]:
        found: dict[str, Value] = {}
        taken, position = 0, 0
        while position < len(data):
            kind, body, position = self._element(memoryview(data), position, packed=True)
            if kind == COMPRESSED:
                unpacked = memoryview(inflated(body, self._limit - taken))
                taken += len(unpacked)
                kind, body, _ = self._element(unpacked, 0)
            if kind != MATRIX:
                raise broken(f"an element of kind {kind} stands where a variable is needed")
            name, value = self._matrix(body, 0)
            found[name] = value
        return found

    def _matrix(self, body: memoryview, depth: int) -> tuple[str, Value]:
        if depth > DEEPEST:
            raise broken(f"its structures nest deeper than {DEEPEST}")
        if not body:
            return "", None
        _, flags, position = self._element(body, 0)
        (word,) = self._numbers("I", flags, 1)
        kind = word & 0xFF
        if kind == OPAQUE:
            return "", None
        _, dimensions, position = self._element(body, position)
        _, named, position = self._element(body, position)
        name = bytes(named).decode("latin-1")
        sizes = self._numbers("i", dimensions, len(dimensions) // 4)
        if len(sizes) < 2 or min(sizes) < 0:
            raise broken(f"{name[:80]} has the dimensions {sizes[:8]}")
        if kind == STRUCT:
            return name, self._structures(body, position, prod(sizes), depth)
        if FIRST_NUMERIC <= kind <= LAST_NUMERIC and not word & COMPLEX:
            return name, self._vector(body, position, sizes)
        return name, None

    def _vector(self, body: memoryview, position: int, sizes: tuple[int, ...]) -> FloatArray | None:
        kind, values, _ = self._element(body, position)
        form = np.dtype(self._order + NUMBERS[kind]) if kind in NUMBERS else None
        if form is None or len(values) != prod(sizes) * form.itemsize:
            raise broken(f"an array of the dimensions {sizes[:8]} has {len(values)} bytes of kind {kind}")
        if not prod(sizes) or prod(sizes) != max(sizes):
            return None
        return np.frombuffer(values, form).astype(np.float64)

    def _structures(self, body: memoryview, position: int, count: int, depth: int) -> Structures:
        _, length, position = self._element(body, position)
        _, named, position = self._element(body, position)
        (size,) = self._numbers("i", length, 1)
        if not 0 < size <= LONGEST_NAME:
            raise broken(f"field names of {size} characters")
        starts = range(0, len(named), size)
        names = [bytes(named[at : at + size]).partition(b"\0")[0].decode("latin-1") for at in starts]
        self._fields += count * max(1, len(names))
        if self._fields > ELEMENTS:
            raise broken(f"more than {ELEMENTS} fields")
        elements = []
        for _ in range(count):
            fields: dict[str, Value] = {}
            for name in names:
                kind, inner, position = self._element(body, position)
                if kind != MATRIX:
                    raise broken(f"an element of kind {kind} stands where {name[:80]} is needed")
                fields[name] = self._matrix(inner, depth + 1)[1]
            elements.append(fields)
        return Structures(tuple(elements))

    def _element(self, data: memoryview, position: int, packed: bool = False) -> tuple[int, memoryview, int]:
        """Kind and bytes of an element, and where the next begins; up to four bytes stand in the tag itself."""
        if position + 8 > len(data):
            raise broken("it was cut inside an element")
        kind, size = struct.unpack_from(self._order + "II", data, position)
        if kind >> 16:
            size = kind >> 16
            if size > 4:
                raise broken(f"a tag with {size} bytes in it")
            return kind & 0xFFFF, data[position + 4 : position + 4 + size], position + 8
        start = position + 8
        if size > len(data) - start:
            raise broken(f"an element of {size} bytes has {len(data) - start}")
        filling = 0 if packed else -size % 8
        return kind, data[start : start + size], start + size + filling

    def _numbers(self, form: str, data: memoryview, count: int) -> tuple[int, ...]:
        if len(data) < 4 * count:
            raise broken("an array whose head is cut")
        return struct.unpack_from(f"{self._order}{count}{form}", data)


def inflated(body: memoryview, limit: int) -> bytes:
    unpacker = zlib.decompressobj()
    try:
        found = unpacker.decompress(body, limit + 1)
    except zlib.error as error:
        raise broken(str(error)) from error
    if len(found) > limit:
        raise too_large(limit)
    return found


def broken(why: str) -> DataError:
    return DataError("not_an_export", f"the MATLAB file cannot be read: {why[:200]}")


def too_large(limit: int) -> DataError:
    return DataError("decompressed_too_large", f"the MATLAB file holds more than {limit >> 20} MB; send it in parts")
