"""What a verdict rests on, packed beside its row: its whole JSON."""

import json
from collections.abc import Collection
from typing import Any

import zstandard
from sqlalchemy import Connection, select

from app.json_texts import short_json
from app.storage.bulk import among
from app.storage.samples import compressor
from app.storage.tables import verdict_details

LONGEST_DETAIL = 64 << 20


def pack_detail(detail: dict[str, Any]) -> bytes:
    return compressor().compress(short_json(detail))


def detail_of(connection: Connection, loop_id: int, audit_id: int) -> dict[str, Any] | None:
    query = select(verdict_details.c.packed)
    packed = connection.scalar(
        query.where(verdict_details.c.loop_id == loop_id, verdict_details.c.audit_id == audit_id)
    )
    return None if packed is None else _unpacked(packed)


def details_of(connection: Connection, loop_ids: Collection[int], audit_id: int) -> dict[int, dict[str, Any]]:
    """Of one run, by loop; a loop without one is left out."""
    query = select(verdict_details.c.loop_id, verdict_details.c.packed)
    mine = (among(connection, verdict_details.c.loop_id, loop_ids), verdict_details.c.audit_id == audit_id)
    return {loop_id: _unpacked(packed) for loop_id, packed in connection.execute(query.where(*mine))}


def _unpacked(packed: bytes) -> dict[str, Any]:
    return json.loads(zstandard.ZstdDecompressor().decompress(packed, max_output_size=LONGEST_DETAIL))
