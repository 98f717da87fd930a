"""The trail of who did what, for those who have to account for it."""

import json
from typing import Any

from sqlalchemy import Connection

from app.logs import without_keys
from app.services.access.identity import Identity, request_id
from app.services.backend import Backend
from app.services.cursors import decode, page_of
from app.services.moments import iso_utc
from app.services.outward import TrailOutcome, TrailRowOut
from app.services.results import Page
from app.storage import trail
from app.storage.types import storable

LONGEST_SUBJECT = 500


def record(
    backend: Backend, identity: Identity, action: str, subject: str, outcome: TrailOutcome, **detail: Any
) -> None:
    """Adds a row, in a transaction of its own."""
    with backend.database.write() as connection:
        add(connection, identity, action, subject, outcome, **detail)


def add(
    connection: Connection, identity: Identity, action: str, subject: str, outcome: TrailOutcome, **detail: Any
) -> None:
    """Adds a row, in the transaction of what it tells. `detail` holds nothing secret."""
    values = {
        "who": identity.who,
        "key_id": identity.key_id,
        "action": action,
        "subject": storable(without_keys(subject)[:LONGEST_SUBJECT]),  # an address holds whatever somebody typed
        "outcome": outcome,
        "request_id": request_id.get(),
    }
    trail.add(connection, values, {"via": identity.via, **detail})


def list_trail(
    backend: Backend, limit: int = 100, cursor: str | None = None, *, who: str | None = None, action: str | None = None
) -> Page[TrailRowOut]:
    """What was done, the newest first."""
    before = decode(cursor, (int,))
    with backend.database.read() as connection:
        rows = trail.page(connection, limit + 1, before[0] if before else None, who=who, action=action)
    return page_of(rows, limit, _view, lambda row: (row.id,))


def _view(row: trail.TrailRow) -> TrailRowOut:
    return TrailRowOut(
        id=str(row.id),
        at=iso_utc(row.at) or "",
        who=row.who,
        action=row.action,
        subject=row.subject,
        outcome=row.outcome,  # type: ignore[arg-type]  # `add` writes no other
        request_id=row.request_id,
        detail=json.loads(row.detail_json),
    )
