"""Tags in paths as they are: /v1/loops/{tag}/health works for a tag with slashes, encoded or not."""

from typing import Annotated
from urllib.parse import unquote

from fastapi import Depends, Path
from fastapi.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from app.errors import NotFoundError
from app.http.backend import Services
from app.services.loops import spelling

TAGGED = ("/v1/loops/", "/loops/")
LONGEST_TAG = 500


class OneSlashLess:
    """Answers an address with a slash at its end as the one without, instead of saying that there is none.

    No redirect: what is sent with a request would be lost on the way, and clients that follow none, as curl and that of
    the project, would take the redirect for the answer. An encoded slash at the end is a tag's own.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["path"] != f"{scope.get('root_path', '')}/":
            scope = {**scope, **_without_slash(scope)}
        await self.app(scope, receive, send)


def _without_slash(scope: Scope) -> dict[str, str | bytes]:
    path, raw = scope["path"], scope.get("raw_path")
    if not path.endswith("/") or (raw and not raw.endswith(b"/")):
        return {}
    return {"path": path[:-1], **({"raw_path": raw[:-1]} if raw else {})}


class KeepTagsEncoded:
    """Routes paths with a tag by their raw form, so that an encoded slash of a tag is told from one of the route."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["path"].startswith(TAGGED) and scope.get("raw_path"):
            scope = {**scope, "path": scope["raw_path"].decode("latin-1")}
        await self.app(scope, receive, send)


async def decoded_tag(tag: Annotated[str, Path(description="Tag of the loop, percent-encoded.")]) -> str:
    """The tag that was meant; what no tag can be is not found rather than an error of the database."""
    try:
        decoded = unquote(tag, errors="strict")
    except UnicodeDecodeError:
        raise NotFoundError("unknown_loop", "the tag is not UTF-8, percent-encoded") from None
    if "\x00" in decoded or len(decoded) > LONGEST_TAG:
        raise NotFoundError("unknown_loop", f"no tag has a zero byte or more than {LONGEST_TAG} characters")
    return decoded


async def tag_of_loop(request: Request, backend: Services, tag: Annotated[str, Depends(decoded_tag)]) -> str:
    """As its loop is spelled: what comes of exports is told by great and small letters no more than that. A tag that no
    loop has stays as it is."""
    spelled: set[str] = request.app.state.spelled_tags
    if tag in spelled:
        return tag
    found = await run_in_threadpool(spelling, backend, tag)
    if found is None:
        return tag
    spelled.add(found)  # at most as many as there are loops, which stay
    return found


LoopTag = Annotated[str, Depends(tag_of_loop)]
