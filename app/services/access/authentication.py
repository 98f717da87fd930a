"""Whether a key or a session is good, and whose it is; what was found is believed for a few seconds.

That is the delay with which a running service learns of a revocation: `key_recheck_s` of the settings.
"""

import base64
import hashlib
import hmac
import re
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from threading import Lock
from typing import Literal

from app.services.access import key_text
from app.services.access.identity import Identity, Role
from app.services.access.keys import state_of
from app.services.backend import Backend
from app.storage import keys
from app.storage.types import now

LARGEST_CACHE = 10_000
USE_NOTED_EVERY_S = 60.0
TOKEN_BYTES = 32
TOKEN = re.compile(r"[\w-]{43}", re.ASCII)
"""So many bytes in base64, as `secrets` writes them."""

Via = Literal["key", "session"]


@dataclass(frozen=True)
class Believed:
    """What the database said of a secret, and for how long that is believed."""

    identity: Identity | None
    until_s: float


@dataclass(frozen=True)
class Session:
    """A session that was opened; the token is known to the browser alone, which forgets it at `expires_at`."""

    token: str
    expires_at: datetime
    identity: Identity


class Authenticator:
    """One a process; safe to use from several threads."""

    def __init__(self, backend: Backend, clock: Callable[[], float] = time.monotonic) -> None:
        self._backend = backend
        self._clock = clock
        self._good: dict[str, Believed] = {}
        self._wrong: dict[str, Believed] = {}
        self._noted_s: dict[int, float] = {}
        self._lock = Lock()

    def remembered(self, secret: str, via: Via = "key") -> Believed | None:
        """What is known of a key or a session's token without asking the database; None: it has to be asked. What
        stands in the place of the other is neither."""
        hash_ = kept_as(secret, via)
        found = self._good.get(hash_) or self._wrong.get(hash_)
        if found is None or found.until_s < self._clock():
            return None
        if found.identity and found.identity.expires_at and found.identity.expires_at <= now():
            return Believed(None, found.until_s)
        return found

    def was_good(self, secret: str, via: Via = "key") -> bool:
        """Whether it was, when the database was last asked, however long ago."""
        return kept_as(secret, via) in self._good

    def key(self, text: str) -> Identity | None:
        """Whose key this is; None where it is none, or has ended."""
        parsed = key_text.parse(text)
        if parsed is None:
            return None
        with self._backend.database.read() as connection:
            row = keys.by_public_id(connection, parsed.public_id)
        good = row is not None and parsed.matches(row.secret_hash) and state_of(row, now()) == "active"
        return self._remember(text, "key", _identity(row) if good and row is not None else None)

    def session(self, token: str) -> Identity | None:
        """Whose session this is; it ends with its key, by its age, or where it was not used for a while."""
        with self._backend.database.read() as connection:
            found = keys.session(connection, hashed(token))
        if found is None or state_of(found.key, now()) != "active":
            return self._remember(token, "session", None)
        ends = self._session_ends(found.created_at)
        if ends - found.expires_at > timedelta(seconds=USE_NOTED_EVERY_S):
            with self._backend.database.write() as connection:
                keys.extend_session(connection, hashed(token), ends)
        return self._remember(token, "session", _identity(found.key, token, ends))

    def _session_ends(self, created_at: datetime) -> datetime:
        """When a session that is used now ends, unless it is used again."""
        settings = self._backend.settings
        idle, age = timedelta(minutes=settings.session_idle_min), timedelta(hours=settings.session_h)
        return min(now() + idle, created_at + age)

    def open_session(self, owner: Identity) -> Session | None:
        """A session for the owner of a key that was found good; None where it has ended in the meantime."""
        if owner.key_id is None:
            return None
        token = secrets.token_urlsafe(TOKEN_BYTES)
        opened_at = now()
        with self._backend.database.write() as connection:
            keys.open_session(connection, hashed(token), owner.key_id, self._session_ends(opened_at))
        identity = self.session(token)
        expires_at = opened_at + timedelta(hours=self._backend.settings.session_h)
        return None if identity is None else Session(token, expires_at, identity)

    def close_session(self, token: str) -> None:
        with self._backend.database.write() as connection:
            keys.close_session(connection, hashed(token))
        self._good.pop(kept_as(token, "session"), None)

    def due_to_note(self, identity: Identity) -> bool:
        """Whether the use of this key is to be written now; at most once a minute."""
        if identity.key_id is None:
            return False
        moment = self._clock()
        with self._lock:
            if moment - self._noted_s.get(identity.key_id, -USE_NOTED_EVERY_S) < USE_NOTED_EVERY_S:
                return False
            self._noted_s[identity.key_id] = moment
        return True

    def note_use(self, key_id: int) -> None:
        with self._backend.database.write() as connection:
            keys.note_use(connection, key_id, USE_NOTED_EVERY_S)

    def _remember(self, secret: str, via: Via, identity: Identity | None) -> Identity | None:
        believed = Believed(identity, self._clock() + self._backend.settings.key_recheck_s)
        kept, other = (self._wrong, self._good) if identity is None else (self._good, self._wrong)
        with self._lock:
            if len(kept) >= LARGEST_CACHE:  # of wrong ones there may be any number, and they push out no good one
                kept.clear()
            kept[kept_as(secret, via)] = believed
            other.pop(kept_as(secret, via), None)
        return identity


def kept_as(secret: str, via: Via) -> str:
    return f"{via} {hashed(secret)}"


def hashed(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()


def may_be_token(text: str) -> bool:
    """Whether a session's token is written so."""
    return TOKEN.fullmatch(text) is not None


def form_token(session_token: str) -> str:
    """What the forms of a session must carry: follows from its token, which no other site knows."""
    made = hmac.digest(session_token.encode("utf-8", "surrogatepass"), b"loopaudit form", "sha256")
    return base64.urlsafe_b64encode(made).decode().rstrip("=")


def _identity(row: keys.KeyRow, session_token: str = "", session_ends: datetime | None = None) -> Identity:
    ends = [moment for moment in (row.expires_at, session_ends) if moment is not None]
    return Identity(
        who=row.name,
        role=Role(row.role),
        via="session" if session_token else "key",
        key_id=row.id,
        requests_per_minute=row.requests_per_minute,
        expires_at=min(ends, default=None),
        form_token=form_token(session_token) if session_token else "",
    )
