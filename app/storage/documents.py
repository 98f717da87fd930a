"""A JSON document with the signals that belong to it, packed into the bytes of a row and back."""

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import zstandard

from app.storage.samples import Samples, compressor, pack, unpack

FORMAT = 1
HEADER = struct.Struct("<BI")  # format, length of the packed JSON
LONGEST_JSON = 64 << 20


@dataclass(frozen=True, eq=False)
class Document:
    """What was told, in words and numbers, and the signals of it (None: there are none)."""

    told: Mapping[str, Any] = field(default_factory=dict)
    signals: Samples | None = None


def pack_document(document: Document) -> bytes:
    text = json.dumps(document.told, separators=(",", ":"), allow_nan=False).encode()
    told = compressor().compress(text)
    signals = b"" if document.signals is None else pack(document.signals)
    return HEADER.pack(FORMAT, len(told)) + told + signals


def told_of(packed: bytes) -> Mapping[str, Any]:
    """What a packed document tells, its signals left packed. Raises as `unpack_document` does."""
    told: Mapping[str, Any] = json.loads(_told(packed)[0])
    return told


def unpack_document(packed: bytes) -> Document:
    """What `pack_document` was given. Raises ValueError where the bytes are not of a format this version knows."""
    text, start = _told(packed)
    return Document(json.loads(text), unpack(packed[start:]) if len(packed) > start else None)


def _told(packed: bytes) -> tuple[bytes, int]:
    """The JSON, and where the signals begin."""
    version, length = HEADER.unpack_from(packed)
    if version != FORMAT:
        raise ValueError(f"packed document of format {version}, this version knows {FORMAT}")
    start = HEADER.size + length
    return zstandard.ZstdDecompressor().decompress(packed[HEADER.size : start], max_output_size=LONGEST_JSON), start
