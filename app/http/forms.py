"""The token that a form of a session must carry, so that no other site can send it in the user's name."""

import hmac
import re
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.types import Message, Receive

FIELD = "csrf_token"
HEADER = "x-csrf-token"
LOOKED_AT_BYTES = 64 << 10
IN_MULTIPART = re.compile(rb'name="csrf_token"\r\n\r\n([A-Za-z0-9_-]{1,100})\r\n')


async def carries_token(headers: Headers, receive: Receive, token: str) -> tuple[bool, Receive]:
    """Whether the request carries the token, in the header or in the form, and a `receive` that gives the body again.

    In a multipart form the field must come before the files: only the first 64 KiB are looked at.
    """
    given = headers.get(HEADER)
    if given is not None:
        return same(given, token), receive
    kind = headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind not in ("application/x-www-form-urlencoded", "multipart/form-data"):
        return False, receive
    messages = await beginning(receive)
    body = b"".join(message.get("body", b"") for message in messages)
    given = in_multipart(body) if kind.startswith("multipart") else in_form(body)
    return same(given, token), replayed(messages, receive)


def same(given: str, token: str) -> bool:
    return bool(token) and hmac.compare_digest(given.encode(), token.encode())


def in_form(body: bytes) -> str:
    try:
        return parse_qs(body.decode("utf-8"), max_num_fields=200).get(FIELD, [""])[0]
    except ValueError:
        return ""


def in_multipart(body: bytes) -> str:
    found = IN_MULTIPART.search(body)
    return found[1].decode() if found else ""


async def beginning(receive: Receive) -> list[Message]:
    """The messages of the body's first part, or of all of it where it is short."""
    messages: list[Message] = []
    size = 0
    while size < LOOKED_AT_BYTES:
        message = await receive()
        messages.append(message)
        size += len(message.get("body", b""))
        if message["type"] != "http.request" or not message.get("more_body"):
            break
    return messages


def replayed(messages: list[Message], receive: Receive) -> Receive:
    waiting = list(messages)

    async def again() -> Message:
        return waiting.pop(0) if waiting else await receive()

    return again
