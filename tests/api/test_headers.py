"""What a browser may do with an answer is said on it, whoever made it and however it came."""

import asyncio
from typing import Any

import pytest
from starlette.types import Message, Receive, Scope, Send

from app.http.headers import HSTS, SecurityHeaders


def headers_of(scheme: str, path: str = "/", own: tuple[tuple[bytes, bytes], ...] = ()) -> dict[str, str]:
    sent: list[Message] = []

    async def answer(scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": list(own)})

    async def keep(message: Message) -> None:
        sent.append(message)

    async def nothing() -> Any:
        return {}

    scope: Scope = {"type": "http", "scheme": scheme, "path": path, "headers": []}
    asyncio.run(SecurityHeaders(answer)(scope, nothing, keep))
    return {name.decode().lower(): value.decode() for name, value in sent[0]["headers"]}


def test_over_https_alone_a_browser_is_told_to_come_back_over_it() -> None:
    assert headers_of("https")["strict-transport-security"] == HSTS
    assert "strict-transport-security" not in headers_of("http")


def test_no_page_stands_in_a_frame_of_another_site_or_tells_it_its_address() -> None:
    told = headers_of("http")
    assert "frame-ancestors 'none'" in told["content-security-policy"].split("; ")
    assert told["x-frame-options"] == "DENY"
    assert told["referrer-policy"] == "no-referrer"


@pytest.mark.parametrize(("path", "kept"), [("/", "no-store"), ("/v1/loops", "no-store"), ("/static/a.js", "no-cache")])
def test_answers_are_kept_by_nobody_and_styles_and_scripts_by_browsers(path: str, kept: str) -> None:
    assert headers_of("http", path)["cache-control"] == kept


def test_what_an_answer_says_of_itself_stays() -> None:
    assert headers_of("http", own=((b"cache-control", b"private"),))["cache-control"] == "private"
