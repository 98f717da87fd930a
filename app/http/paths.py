"""Tags in paths as they are: /v1/loops/{tag}/health works for a tag with slashes, encoded or not."""

from typing import Annotated
from urllib.parse import unquote

from fastapi import Depends, Path
from starlette.types import ASGIApp, Receive, Scope, Send

from app.errors import NotFoundError

TAGGED = ("/v1/loops/", "/loops/")
LONGEST_TAG = 500


class KeepTagsEncoded:
    """Routes paths with a tag by their raw form, so that an encoded slash of a tag is told from one of the route."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["path"].startswith(TAGGED) and scope.get("raw_path"):
            scope = {**scope, "path": scope["raw_path"].decode("latin-1")}
        await self.app(scope, receive, send)


async def decoded_tag(tag: Annotated[str, Path(description="Tag of the loop, percent-encoded.")]) -> str:
    """The tag that was meant; what no tag can be is not found rather than an error of the data base."""
    try:
        decoded = unquote(tag, errors="strict")
    except UnicodeDecodeError:
        raise NotFoundError("unknown_loop", "the tag is not UTF-8, percent-encoded") from None
    if "\x00" in decoded or len(decoded) > LONGEST_TAG:
        raise NotFoundError("unknown_loop", f"no tag has a zero byte or more than {LONGEST_TAG} characters")
    return decoded


LoopTag = Annotated[str, Depends(decoded_tag)]
