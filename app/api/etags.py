"""Answers that dashboards ask for again and again: sent only where they have changed."""

import hashlib
from collections.abc import Callable, Mapping

from starlette.requests import Request
from starlette.responses import Response


def tagged(request: Request, body: str, media_type: str, headers: Mapping[str, str] | None = None) -> Response:
    """The body with its ETag, or 304 where the asker has it: the same until a verdict or a loop changes."""
    content = body.encode()
    return versioned(request, hashlib.sha256(content).hexdigest()[:32], lambda: content, media_type, headers)


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
    return Response(write(), media_type=media_type, headers=own)


def known(if_none_match: str, tag: str) -> bool:
    """Compared weakly (RFC 9110, 13.1.2)."""
    given = {part.strip().removeprefix("W/") for part in if_none_match.split(",")}
    return "*" in given or tag.removeprefix("W/") in given
