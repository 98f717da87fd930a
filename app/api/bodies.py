"""How large a body may be: small for questions, as the settings say for uploads."""

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.problems import respond

UPLOADS = "/v1/uploads"
LIMIT_BYTES = 4 << 20
MULTIPART_OVERHEAD_BYTES = 1 << 20


class LimitBodies:
    """413 as a problem: at once where the length is told, otherwise as soon as it is passed."""

    def __init__(self, app: ASGIApp, max_upload_bytes: int) -> None:
        self.app = app
        self._max_upload_bytes = max_upload_bytes + MULTIPART_OVERHEAD_BYTES

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        limit = self._max_upload_bytes if scope["path"] == UPLOADS else LIMIT_BYTES
        told = Request(scope).headers.get("content-length", "")
        if told.isdigit() and int(told) > limit:
            answer = respond(
                Request(scope), 413, "body_too_large", f"the body has {told} bytes, at most {limit} are taken"
            )
            await answer(scope, receive, send)
            return
        await self.app(scope, counted(receive, limit), send)


def counted(receive: Receive, limit: int) -> Receive:
    got = 0

    async def receive_within_limit() -> Message:
        nonlocal got
        message = await receive()
        got += len(message.get("body", b""))
        if got > limit:
            raise HTTPException(413, f"the body has more than {limit} bytes")
        return message

    return receive_within_limit
