"""How much is answered at once: what comes above that is asked to come again, so that memory stays bounded."""

import asyncio
from collections import Counter

from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.http.problems import respond
from app.services.access.rates import counted_as
from app.settings import Settings

ALWAYS = "/healthz"
LOGIN, FILES = "/login", "/static/"  # whoever has no key may send a body or leave an answer unread here alone
SENDING = ("/uploads", "/mapping")
VISITORS = 50
OF_AN_ADDRESS = {"logins": 10, "files": 25}
"""Of one address, which may be that of a proxy: so many of these places, and no more."""
RETRY_AFTER_S = 2
SLOWEST_READER_S = 60.0


class LimitCrowd:
    """503 with Retry-After above the limits of the settings; requests, uploads, event streams, logins and
    the files of the pages count apart, so that none of them can take the places of the others."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self._limits = {
            "requests": settings.max_requests,
            "uploads": settings.max_uploads,
            "streams": settings.max_streams,
            "logins": VISITORS,
            "files": VISITORS,
        }
        self._now: Counter[str] = Counter()
        self._of_address: Counter[tuple[str, str]] = Counter()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["path"] == ALWAYS:
            await self.app(scope, receive, send)
            return
        kind = kind_of(scope)
        client = scope.get("client")
        here = (kind, counted_as(client[0]) if client and kind in OF_AN_ADDRESS else "")
        most = min(self._limits[kind], OF_AN_ADDRESS.get(kind, self._limits[kind]))
        if self._now[kind] >= self._limits[kind] or self._of_address[here] >= most:
            text = f"{most} {kind} are being served, which is the most; try again in {RETRY_AFTER_S} s"
            answer = respond(Request(scope), 503, "busy", text, headers={"Retry-After": str(RETRY_AFTER_S)})
            await answer(scope, receive, send)
            return
        self._now[kind] += 1
        self._of_address[here] += 1
        try:
            await self.app(scope, receive, read_in_time(send))
        finally:
            self._now[kind] -= 1
            self._of_address[here] -= 1
            self._of_address += Counter()  # those that are at 0 go: addresses are many


def kind_of(scope: Scope) -> str:
    if scope["path"].startswith(LOGIN):
        return "logins"
    if scope["path"].startswith(FILES):
        return "files"
    if scope["path"].endswith("/events"):
        return "streams"
    return "uploads" if scope["method"] == "POST" and scope["path"].endswith(SENDING) else "requests"


def read_in_time(send: Send) -> Send:
    """Gives up on a client that takes no part of its answer for a minute; its connection is then closed."""

    async def send_in_time(message: Message) -> None:
        async with asyncio.timeout(SLOWEST_READER_S):
            await send(message)

    return send_in_time
