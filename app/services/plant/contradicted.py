"""Verdicts that the newest explanation of their loop contradicts, of many loops at once."""

import logging
import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import Connection

from app.services.moments import iso_utc, moment_of
from app.services.telling.why_rely import contradiction
from app.services.telling.wording import STICKS
from app.storage import explanations
from app.storage.documents import told_of
from app.storage.explanations import Naming
from app.storage.notes import Standing
from app.storage.samples import DAMAGED

log = logging.getLogger("loopaudit.contradicted")


def contradicted(
    connection: Connection,
    rows: Sequence[Mapping[str, Any]],
    standing: Mapping[str, Standing],
    until: datetime | None = None,
    hold_days: float = math.inf,
) -> frozenset[str]:
    """The tags of those rows of the reliability table whose verdict is not what `contradiction` lets stand, by the
    explanations that had ended until then (None: by now). standing: what stands of loops, by tag; hold_days: as in
    `contradiction`."""
    tags = [row["loop"] for row in rows if row["verdict"] == "no_stiction"]
    found = explanations.newest_naming(connection, tags, STICKS, until) if tags else {}
    told = {tag: _told(tag, naming) for tag, naming in found.items()}
    repaired = {tag: iso_utc(one.repaired_at) for tag, one in standing.items()}
    by_tag = ((row["loop"], row) for row in rows)
    return frozenset(tag for tag, row in by_tag if contradiction(row, told.get(tag), repaired.get(tag), hold_days))


def _told(tag: str, naming: Naming) -> dict[str, Any]:
    """By the names of an explanation."""
    ended = None if naming.window_end_ns is None else moment_of(naming.window_end_ns)
    return {"state": "done", "effects": _effects(tag, naming.packed), "window_end": iso_utc(ended)}


def _effects(tag: str, packed: bytes) -> Sequence[Mapping[str, Any]]:
    """None of an answer that is damaged: a list of loops is told all the same."""
    try:
        effects: Sequence[Mapping[str, Any]] = told_of(packed)["line"]["effects"]
    except (*DAMAGED, KeyError):
        log.exception("the explanation of %r cannot be read", tag)
        return ()
    return effects
