"""Who asks: roles, what each includes, and the identity of the request that is being served."""

from contextvars import ContextVar
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Literal


class Role(StrEnum):
    """read < upload, audit < admin: `upload` and `audit` each include `read`, neither includes the other."""

    read = "read"
    upload = "upload"
    audit = "audit"
    admin = "admin"


INCLUDES: dict[Role, frozenset[Role]] = {
    Role.read: frozenset({Role.read}),
    Role.upload: frozenset({Role.read, Role.upload}),
    Role.audit: frozenset({Role.read, Role.audit}),
    Role.admin: frozenset(Role),
}


@dataclass(frozen=True)
class Identity:
    """Whoever makes a request. `via` is how it was known; `form_token` is what its forms must carry (a session's)."""

    who: str
    role: Role
    via: Literal["key", "session", "open", "nobody", "command line", "schedule"]
    key_id: int | None = None
    requests_per_minute: int = 0
    expires_at: datetime | None = None
    form_token: str = ""

    def may(self, needed: Role) -> bool:
        return needed in INCLUDES[self.role]


ANYONE = Identity("a local user without a key", Role.admin, "open")
NOBODY = Identity("nobody", Role.read, "nobody")
COMMAND_LINE = Identity("command line", Role.admin, "command line")
SCHEDULE = Identity("schedule", Role.admin, "schedule")

# How the trail is asked, on the command line and over HTTP.
OF_WHO = f"Only what was done by who is called exactly so: a key, {COMMAND_LINE.who}, {SCHEDULE.who}, {ANYONE.who}."
OF_ACTION = "Only this action, by its whole name, such as upload.receive."

current: ContextVar[Identity | None] = ContextVar("loopaudit_identity", default=None)
request_id: ContextVar[str | None] = ContextVar("loopaudit_request_id", default=None)
