"""Keys: made, listed, revoked, rotated. The text of a key is told once, when it is made; only its hash is kept."""

from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy import Connection

from app.errors import NotFoundError, RequestError
from app.services.access import key_text, trail
from app.services.access.identity import COMMAND_LINE, Identity, Role
from app.services.backend import Backend
from app.services.moments import iso_utc
from app.services.results import KeyView
from app.storage import keys
from app.storage.types import now

REQUESTS_PER_MINUTE = 1200
LONGEST_NAME = 100


@dataclass(frozen=True)
class NewKey:
    """`text` is the key itself, which nothing can tell again."""

    text: str
    key: KeyView


def create_key(
    backend: Backend,
    name: str,
    role: Role,
    *,
    lifetime: timedelta | None,
    requests_per_minute: int = REQUESTS_PER_MINUTE,
    by: Identity = COMMAND_LINE,
) -> NewKey:
    """A key for `name` (a person or a system); `lifetime` None: it ends only when it is revoked."""
    if not name.strip() or len(name) > LONGEST_NAME or not name.isprintable():
        raise RequestError("key_name", f"a key needs a printable name of at most {LONGEST_NAME} characters")
    with backend.database.write() as connection:
        return _added(connection, name, role, lifetime, requests_per_minute, by)


def _added(
    connection: Connection, name: str, role: Role, lifetime: timedelta | None, requests_per_minute: int, by: Identity
) -> NewKey:
    """With its row in the trail."""
    made = key_text.make(role)
    values = {
        "public_id": made.public_id,
        "secret_hash": made.digest,
        "name": name,
        "role": role.value,
        "requests_per_minute": requests_per_minute,
        "expires_at": None if lifetime is None else now() + lifetime,
    }
    row = keys.add(connection, values)
    trail.add(connection, by, "key.create", row.public_id, "done", name=name, role=role.value)
    return NewKey(made.text, _view(row, now()))


def list_keys(backend: Backend) -> list[KeyView]:
    with backend.database.read() as connection:
        rows = keys.every(connection)
    moment = now()
    return [_view(row, moment) for row in rows]


def revoke_key(backend: Backend, public_id: str, *, by: Identity = COMMAND_LINE) -> KeyView:
    """The key and its sessions end now; a running service knows it a few seconds later (its key_recheck_s)."""
    with backend.database.write() as connection:
        row = _existing(connection, public_id)
        keys.end(connection, row.id, revoked_at=now())
        trail.add(connection, by, "key.revoke", public_id, "done", name=row.name)
        return _view(_existing(connection, public_id), now())


def rotate_key(backend: Backend, public_id: str, overlap: timedelta, *, by: Identity = COMMAND_LINE) -> NewKey:
    """A new key like the old one, which goes on working for `overlap`, so that its users can change over. All or
    nothing: no key is left active whose text nobody was told."""
    with backend.database.write() as connection:
        row = _existing(connection, public_id)
        if state_of(row, now()) != "active":
            raise RequestError("wrong_state", f"key {public_id} is {state_of(row, now())}; make a new one instead")
        lifetime = None if row.expires_at is None else row.expires_at - row.created_at
        made = _added(connection, row.name, Role(row.role), lifetime, row.requests_per_minute, by)
        if not keys.give_way(connection, row.id, now() + overlap, made.key.id):
            follower = _existing(connection, public_id).followed_by  # somebody may have rotated it just now
            advice = "rotate that one, or make a new one if it has ended"
            raise RequestError("wrong_state", f"key {public_id} was rotated, and {follower} follows it; {advice}")
        trail.add(connection, by, "key.rotate", public_id, "done", followed_by=made.key.id)
    return made


def any_active(backend: Backend) -> bool:
    return any(key.state == "active" for key in list_keys(backend))


def state_of(row: keys.KeyRow, moment: datetime) -> str:
    if row.revoked_at is not None:
        return "revoked"
    return "expired" if row.expires_at is not None and row.expires_at <= moment else "active"


def _existing(connection: Connection, public_id: str) -> keys.KeyRow:
    row = keys.by_public_id(connection, public_id)
    if row is None:
        raise NotFoundError(
            "unknown_key", f"there is no key with the id {public_id[:40]!r}; `loopaudit keys list` has all"
        )
    return row


def _view(row: keys.KeyRow, moment: datetime) -> KeyView:
    return KeyView(
        id=row.public_id,
        name=row.name,
        role=row.role,
        state=state_of(row, moment),
        requests_per_minute=row.requests_per_minute,
        created_at=iso_utc(row.created_at) or "",
        expires_at=iso_utc(row.expires_at),
        revoked_at=iso_utc(row.revoked_at),
        last_used_at=iso_utc(row.last_used_at),
        followed_by=row.followed_by,
    )
