"""Answers that dashboards ask for again and again: sent only where they have changed."""

import asyncio
import hashlib
import json
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from typing import Any

from fastapi.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

NOT_MODIFIED: dict[int | str, dict[str, Any]] = {
    304: {"description": "Nothing has changed since the answer whose ETag is in If-None-Match."}
}
PART = 1 << 20  # bytes of an answer sent at once


class InParts(Response):
    """An answer of any size, sent a part at a time: the next waits until the client has taken most of the one before,
    so that one who does not read is noticed."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers})
        for start in range(0, max(len(self.body), 1), PART):
            part = bytes(self.body[start : start + PART])
            await send({"type": "http.response.body", "body": part, "more_body": start + PART < len(self.body)})


async def in_turn(parts: Iterator[bytes], places: asyncio.Semaphore) -> AsyncIterator[bytes]:
    """Each part is made when the one before is taken, and only as many at a time as there are places, of whichever
    answers: a client that reads slowly keeps none from the others."""
    while True:
        async with places:
            part = await run_in_threadpool(next, parts, None)
        if part is None:
            return
        yield part


def tagged(request: Request, body: str, media_type: str, headers: Mapping[str, str] | None = None) -> Response:
    """The body with its ETag, or 304 where the asker has it: the same until a verdict or a loop changes."""
    content = body.encode()
    return versioned(request, hashlib.sha256(content).hexdigest()[:32], lambda: content, media_type, headers)


def tag_of(fields: Mapping[str, Any]) -> str:
    return f'W/"{hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()[:32]}"'


def versioned(
    request: Request,
    version: str,
    write: Callable[[], bytes],
    media_type: str,
    headers: Mapping[str, str] | None = None,
) -> Response:
    """The same for a body that is written only where the asker does not have its `version`."""
    tag = f'W/"{version}"'
    own = {**(headers or {}), "ETag": tag}
    if known(request.headers.get("If-None-Match", ""), tag):
        return Response(status_code=304, headers=own)
    return InParts(write(), media_type=media_type, headers=own)


def known(condition: str, tag: str) -> bool:
    """Whether If-None-Match or If-Match names a tag; compared weakly (RFC 9110, 13.1.2): who waits for changes of a
    loop asks what it says, not which bytes say it."""
    given = {part.strip().removeprefix("W/") for part in condition.split(",")}
    return "*" in given or tag.removeprefix("W/") in given
