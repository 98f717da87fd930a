"""Every error is a problem with a stable code, and tags arrive as they were meant."""

import asyncio
import errno
import json
from collections.abc import Iterator
from urllib.parse import quote

import httpx
import pytest
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel
from sqlalchemy.exc import OperationalError

from app.errors import DataError, NotFoundError, RequestError
from app.http import problems
from app.http.headers import SecurityHeaders
from app.http.paths import KeepTagsEncoded, LoopTag, decoded_tag, tag_of_loop
from app.storage.database import CommitLostError


class Body(BaseModel):
    number: int


@pytest.fixture(scope="module")
def client(serve) -> Iterator[httpx.Client]:
    app = FastAPI()
    problems.install(app)
    app.add_middleware(SecurityHeaders)
    app.add_middleware(KeepTagsEncoded)

    @app.get("/raise/{kind}")
    def fail(kind: str) -> None:
        raise {
            "data": DataError("flat_pv", "PV is flat"),
            "request": RequestError("unknown_sort", "no such column"),
            "state": RequestError("wrong_state", "it has ended"),
            "missing": NotFoundError("no_such_audit", "no audit 7"),
            "size": RequestError("upload_too_large", "too large"),
            "fault": RuntimeError("secret detail"),
            "files": OSError(errno.EMFILE, "Too many open files", "/secret"),
        }[kind]

    @app.post("/body")
    def body(body: Body) -> int:
        return body.number

    @app.get("/v1/loops/{tag:path}/health")
    def health(tag: LoopTag) -> dict[str, str]:
        return {"health": tag}

    @app.get("/v1/loops/{tag:path}")
    def loop(tag: LoopTag) -> dict[str, str]:
        return {"loop": tag}

    app.dependency_overrides[tag_of_loop] = decoded_tag  # there is no plant behind it
    with serve(app) as connection:
        yield connection


@pytest.mark.parametrize(
    ("kind", "status", "code"),
    [
        ("data", 422, "flat_pv"),
        ("request", 400, "unknown_sort"),
        ("state", 409, "wrong_state"),
        ("missing", 404, "no_such_audit"),
        ("size", 413, "upload_too_large"),
        ("fault", 500, "internal_error"),
        ("files", 503, "busy"),
    ],
)
def test_what_a_service_raises(client, kind, status, code):
    answer = client.get(f"/raise/{kind}")
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert problem["code"] == code
    assert problem["status"] == status
    assert problem["type"] == f"urn:loopaudit:problem:{code}"
    assert problem["instance"] == f"/raise/{kind}"
    assert "secret" not in answer.text


def test_no_such_route_and_wrong_method(client):
    assert client.get("/nowhere").json()["code"] == "no_such_route"
    answer = client.delete("/body")
    assert answer.json()["code"] == "method_not_allowed"
    assert answer.headers["allow"] == "POST"
    assert answer.headers["content-type"] == "application/problem+json"


def test_an_invalid_body_says_where(client):
    problem = client.post("/body", json={"number": "many"}).json()
    assert problem["code"] == "invalid_request"
    assert problem["errors"][0]["where"] == "body.number"
    assert client.post("/body", content=b"{", headers={"content-type": "application/json"}).json()["status"] == 422


TAGS = [
    "FIC101",
    "AREA 1/FIC 101",
    "a/health",
    "100%",
    "%2F",
    "..%2f..",
    "=cmd|' /C calc'!A0",
    "<script>alert(1)</script>",
    "'; DROP TABLE loops; --",
    "工場/流量?x=1#y",
    "tab\there",
    "+plus & amp",
    "a//b/",
]


@pytest.mark.parametrize("tag", TAGS)
def test_a_tag_arrives_as_it_is(client, tag):
    assert client.get(f"/v1/loops/{quote(tag, safe='')}/health").json() == {"health": tag}
    assert client.get(f"/v1/loops/{quote(tag, safe='')}").json() == {"loop": tag}


def test_slashes_that_are_not_encoded_work_too(client):
    assert client.get("/v1/loops/AREA/FIC101/health").json() == {"health": "AREA/FIC101"}


@pytest.mark.parametrize("path", ["%FF%FE", "a%00b", "x" * 501])
def test_what_no_tag_can_be_is_not_found(client, path):
    answer = client.get(f"/v1/loops/{path}")
    assert answer.status_code == 404
    assert answer.json()["code"] == "unknown_loop"


def test_security_headers_are_on_every_answer(client):
    for path in ("/v1/loops/x", "/nowhere", "/raise/fault"):
        headers = client.get(path).headers
        assert "default-src 'none'" in headers["content-security-policy"], path
        assert headers["x-content-type-options"] == "nosniff"


def test_a_commit_without_an_answer_is_in_doubt_though_the_disk_was_full():
    """As where the server of the database ended for it: what was written may stand, and is not said to be undone."""
    scope = {"type": "http", "method": "POST", "path": "/v1/audits", "headers": [], "state": {"action": "audit.start"}}
    full = Exception("PANIC: could not write to file: No space left on device")
    lost, refused = CommitLostError("COMMIT", None, full), OperationalError("COMMIT", None, full)
    answers = [asyncio.run(problems.answer_to(Request(scope), error)) for error in (lost, refused)]
    assert [json.loads(answer.body)["code"] for answer in answers] == ["outcome_unknown", "disk_full"]


def test_of_a_body_with_many_errors_the_first_are_told():
    scope = {"type": "http", "method": "POST", "path": "/v1/loops", "headers": []}
    wrong = [{"type": "missing", "loc": ("body", number), "msg": "Field required"} for number in range(50)]
    answer = asyncio.run(problems._invalid_request(Request(scope), RequestValidationError(wrong)))
    assert [item["where"] for item in json.loads(answer.body)["errors"]] == [f"body.{number}" for number in range(20)]


def test_after_a_fault_a_client_is_told_that_the_connection_ends():
    scope = {"type": "http", "method": "GET", "path": "/v1/loops", "headers": []}
    answer = asyncio.run(problems._fault(Request(scope), RuntimeError("ours")))
    assert (answer.status_code, answer.headers["connection"]) == (500, "close")
