"""How large a body may be and how long it may take: little for questions, as the settings say for uploads."""

import asyncio
import re
import shutil
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.http.problems import respond
from app.http.receiving import LARGEST_MAPPING
from app.http.spooling import FORM_OVERHEAD_BYTES
from app.services.explaining.simulations import LARGEST_TRACE
from app.services.stating.loop_list import MOST_LOOPS
from app.settings import Settings

UPLOADS = ("/v1/uploads", "/uploads")
MAPPING = re.compile(r"/uploads/[^/]+/mapping")
LIMIT_BYTES = 4 << 20
DEADLINE_S = 30.0
LOGIN, LOGIN_BYTES, LOGIN_DEADLINE_S = "/login", 16 << 10, 5.0
LOOP_BYTES = 800
"""Of a line of the loop list with every column, as JSON: 320 where its texts are as long as a plant's usually are."""
VALUE_BYTES = 48
"""Of a value of a trace and its time, as JSON with digits to spare."""
LARGE = (
    (re.compile(r"/v1/loops|/loop-list"), LOOP_BYTES * MOST_LOOPS + FORM_OVERHEAD_BYTES),
    (re.compile(r"/v1/loops/.+/explanations"), VALUE_BYTES * LARGEST_TRACE),
    (MAPPING, LARGEST_MAPPING + FORM_OVERHEAD_BYTES),
)
"""Routes that take as much as they say of a whole plant, or of a long record, and how many bytes that is."""


class LimitBodies:
    """413 as a problem: at once where the length is told, otherwise as soon as it is passed. 408 for a slow sender."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self._max_upload_bytes = settings.max_upload_bytes + FORM_OVERHEAD_BYTES
        self._folder = settings.uploads_dir
        self._idle_s = settings.idle_timeout_s
        self._upload_deadline_s = settings.upload_deadline_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        limit, deadline_s = self._limits(scope["path"])
        told = Request(scope).headers.get("content-length", "")
        if told.isdigit() and (refusal := self._refusal(scope["path"], int(told), limit)):
            await respond(Request(scope), 413, "body_too_large", refusal)(scope, receive, send)
            return
        await self.app(scope, timely(counted(receive, limit), min(self._idle_s, deadline_s), deadline_s), send)

    def _refusal(self, path: str, told: int, limit: int) -> str:
        """Why a body of this length is not taken; empty: it is. One that is larger than the disk could wait for room
        for ever."""
        if told > limit:
            return f"the body has {told:,} bytes, at most {limit:,} are taken"
        if path in UPLOADS and (whole := _whole(self._folder)) and told > whole:
            return f"the body has {told:,} bytes, and the disk of the service {whole:,} in all; send it in parts"
        return ""

    def _limits(self, path: str) -> tuple[int, float]:
        """Bytes and seconds."""
        if path in UPLOADS:
            return self._max_upload_bytes, self._upload_deadline_s
        if path == LOGIN:
            return LOGIN_BYTES, min(LOGIN_DEADLINE_S, self._upload_deadline_s)
        for route, limit in LARGE:
            if route.fullmatch(path):
                return limit, self._upload_deadline_s
        return LIMIT_BYTES, min(DEADLINE_S, self._upload_deadline_s)


def _whole(folder: Path) -> int:
    """Bytes of its disk; 0 where it is gone, which whoever writes there tells."""
    try:
        return shutil.disk_usage(folder).total
    except OSError:
        return 0


def counted(receive: Receive, limit: int) -> Receive:
    got = 0

    async def receive_within_limit() -> Message:
        nonlocal got
        message = await receive()
        got += len(message.get("body", b""))
        if got > limit:
            raise HTTPException(413, f"the body has more than {limit:,} bytes")
        return message

    return receive_within_limit


def timely(receive: Receive, idle_s: float, deadline_s: float) -> Receive:
    """Waits at most `idle_s` for the next part of the body, and `deadline_s` for all of it; then for nothing more."""
    ends_s: float | None = None
    complete = False

    async def receive_in_time() -> Message:
        nonlocal ends_s, complete
        if complete:
            return await receive()
        now_s = asyncio.get_running_loop().time()
        ends_s = now_s + deadline_s if ends_s is None else ends_s
        try:
            async with asyncio.timeout(min(idle_s, ends_s - now_s)):
                message = await receive()
        except TimeoutError:
            text = f"the body must come within {deadline_s:g} s, with no pause above {idle_s:g} s"
            raise HTTPException(408, text, headers={"Connection": "close"}) from None
        complete = not message.get("more_body", False)
        return message

    return receive_in_time
