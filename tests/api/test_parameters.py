"""What no route takes is refused before a database is asked with it, and what is JSON by any of its names is read."""

import asyncio
from typing import Annotated, Any

import httpx
import pytest
from fastapi import Depends, FastAPI, Query
from pydantic import BaseModel

from app.http import problems
from app.http.parameters import json_alone, no_zero_bytes


class Body(BaseModel):
    number: int


@pytest.fixture(scope="module")
def app() -> FastAPI:
    made = FastAPI(dependencies=[Depends(no_zero_bytes)])
    problems.install(made)

    @made.get("/found")
    def found(words: Annotated[list[str] | None, Query()] = None) -> list[str]:
        return words or []

    @made.post("/set", dependencies=[Depends(json_alone)])
    def set_to(body: Body | None = None) -> int:
        return body.number if body else 0

    return made


def answer(app: FastAPI, method: str, path: str, **sent: Any) -> httpx.Response:
    async def asked() -> httpx.Response:
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://test") as client:
            return await client.request(method, path, **sent)

    return asyncio.run(asked())


@pytest.mark.parametrize("query", ["words=a%00b", "words=a%00b&words=c", "words=%00", "other=%00"])
def test_a_zero_byte_in_any_value_is_refused(app: FastAPI, query: str) -> None:
    got = answer(app, "GET", f"/found?{query}")
    assert (got.status_code, got.json()["code"]) == (422, "invalid_request")
    assert got.json()["errors"] == [
        {"where": f"query.{query.split('=')[0]}", "what": "no text of this service has a zero byte"}
    ]
    assert answer(app, "GET", f"/found?{query.replace('%00', '%01')}").status_code == 200


@pytest.mark.parametrize(
    "kind", ["application/json", "application/json; charset=utf-8", "Application/JSON", "application/merge-patch+json"]
)
def test_json_is_read_by_any_of_its_names(app: FastAPI, kind: str) -> None:
    got = answer(app, "POST", "/set", content=b'{"number": 7}', headers={"Content-Type": kind})
    assert (got.status_code, got.json()) == (200, 7)


@pytest.mark.parametrize("kind", ["text/plain", "application/jsonl", "application/x-www-form-urlencoded"])
def test_what_says_it_is_no_json_is_refused_and_an_empty_body_is_none(app: FastAPI, kind: str) -> None:
    async def in_parts() -> Any:
        yield b'{"number": 7}'

    for content in (b'{"number": 7}', in_parts()):
        got = answer(app, "POST", "/set", content=content, headers={"Content-Type": kind})
        assert (got.status_code, got.json()["code"]) == (415, "media_type")
    got = answer(app, "POST", "/set", headers={"Content-Type": kind})
    assert (got.status_code, got.json()) == (200, 0)
