"""Names every request: in its answer, in problems, in the log and in the trail; and logs those that matter."""

import logging
import re
import time
import uuid

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.http.permissions import READING
from app.logs import about
from app.services.access.identity import request_id

HEADER = "X-Request-Id"
GIVEN = re.compile(r"[A-Za-z0-9._-]{8,64}")  # what cannot break a line of a log
LONGEST_PATH = 300

log = logging.getLogger("loopaudit.requests")


class RequestIds:
    """The client's own id where it sent one that can be kept as it is, otherwise a new one."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        given = Headers(scope=scope).get(HEADER, "")
        name = given if GIVEN.fullmatch(given) else uuid.uuid4().hex
        scope.setdefault("state", {})["request_id"] = name
        started_s, status = time.perf_counter(), 500

        async def named(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                MutableHeaders(scope=message)[HEADER] = name
            await send(message)

        known = request_id.set(name)
        try:
            with about(request_id=name):
                try:
                    await self.app(scope, receive, named)
                finally:
                    tell(scope, status, time.perf_counter() - started_s)
        finally:
            request_id.reset(known)


def tell(scope: Scope, status: int, seconds: float) -> None:
    """What changes something or goes wrong at the level info, the rest for whoever looks closer. No query: it may hold
    anything that somebody pasted into an address."""
    level = logging.DEBUG if status < 400 and scope["method"] in READING else logging.INFO
    if log.isEnabledFor(level):
        told = {"method": scope["method"], "path": scope["path"][:LONGEST_PATH], "status": status}
        log.log(level, "request", extra={**told, "ms": round(1000 * seconds, 1)})
