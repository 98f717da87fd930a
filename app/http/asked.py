"""A request as the guard sees it: its route, what it changes, and where a key or a session stands in it."""

from dataclasses import dataclass
from urllib.parse import quote, unquote

from starlette.datastructures import Headers
from starlette.requests import cookie_parser
from starlette.types import Scope

from app.http.permissions import READING, Permission

SESSION = "loopaudit_session"
SECURE_SESSION = f"__Host-{SESSION}"  # browsers take it over https only, and from no other host


@dataclass(frozen=True)
class Asked:
    scope: Scope
    headers: Headers
    permission: Permission

    @property
    def changes(self) -> bool:
        return self.scope["method"] not in READING

    @property
    def address(self) -> str:
        client = self.scope.get("client")
        return client[0] if client else "unknown"

    @property
    def path(self) -> str:
        """As people read it; what shows nothing stays encoded: a terminal would do what it says."""
        told = unquote(self.scope["path"], errors="replace")
        return "".join(sign if sign.isprintable() else quote(sign, errors="replace") for sign in told)


def key_of(headers: Headers) -> str | None:
    """The key of a request; an address line is never looked at, because those end up in logs."""
    scheme, _, key = headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer":
        return key.strip()
    return headers.get("x-api-key")


def session_of(headers: Headers) -> str | None:
    cookies = cookie_parser(headers.get("cookie", ""))
    return cookies.get(SECURE_SESSION) or cookies.get(SESSION)
