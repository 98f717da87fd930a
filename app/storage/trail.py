"""Who did what: rows are added, listed, and dropped when they are old; none is ever changed."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, insert, select

from app.storage.tables import trail
from app.storage.types import now


@dataclass(frozen=True)
class TrailRow:
    id: int
    at: datetime
    who: str
    key_id: int | None
    action: str
    subject: str
    outcome: str
    request_id: str | None
    detail_json: str


COLUMNS = [trail.c[name] for name in TrailRow.__dataclass_fields__]


def add(connection: Connection, values: Mapping[str, Any], detail: Mapping[str, Any]) -> None:
    connection.execute(insert(trail).values(**values, at=now(), detail_json=json.dumps(dict(detail), sort_keys=True)))


def page(
    connection: Connection, limit: int, before_id: int | None, *, who: str | None = None, action: str | None = None
) -> list[TrailRow]:
    """The newest first."""
    query = select(*COLUMNS).order_by(trail.c.id.desc()).limit(limit)
    if before_id is not None:
        query = query.where(trail.c.id < before_id)
    if who is not None:
        query = query.where(trail.c.who == who)
    if action is not None:
        query = query.where(trail.c.action == action)
    return [TrailRow(*row) for row in connection.execute(query)]
