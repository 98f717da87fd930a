"""Answers by gzip: where they are large, of the API, and asked for so; never what must not be."""

import gzip
import json

import pytest
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.types import Receive, Scope, Send

from app.api.etags import versioned
from app.http.compressing import FROM_BYTES, CompressApi, takes_gzip

ROWS = json.dumps([{"loop": f"FIC{k}", "verdict": "stiction"} for k in range(40_000)]).encode()
"""More than a part of an answer that is sent at once."""


async def answers(scope: Scope, receive: Receive, send: Send) -> None:
    request = Request(scope)
    name = scope["path"].rpartition("/")[2]
    made: dict[str, Response] = {
        "table": versioned(request, "v", lambda: ROWS, "application/json"),
        "csv": versioned(request, "v", lambda: ROWS, "text/csv; charset=utf-8"),
        "small": JSONResponse({"state": "done"}),
        "lines": StreamingResponse(iter([b"tag,unit\n", b"A,1\n" * 5000]), media_type="text/csv"),
        "events": StreamingResponse(iter([b"event: end\n" * 5000]), media_type="text/event-stream"),
        "packed": Response(gzip.compress(ROWS), headers={"Content-Encoding": "gzip"}),
        "report": Response(b"<p>" * FROM_BYTES, media_type="text/html"),
        "table_of_pages": PlainTextResponse("x" * FROM_BYTES),
    }
    await made[name](scope, receive, send)


@pytest.fixture(scope="module")
def get(serve):
    """Asks a real server, by default for gzip."""
    with serve(CompressApi(answers)) as client:
        yield lambda path, accepted="gzip, deflate", **headers: client.get(
            path, headers={"Accept-Encoding": accepted, **headers}
        )


@pytest.mark.parametrize("name", ["table", "csv", "lines"])
def test_large_json_and_csv_shrink_and_say_the_same(get, name):
    plain, packed = get(f"/v1/{name}", "identity"), get(f"/v1/{name}")
    assert packed.headers["content-encoding"] == "gzip"
    assert "content-encoding" not in plain.headers
    if name != "lines":
        assert plain.headers["content-length"] == str(len(ROWS))
    assert packed.content == plain.content
    # A part after the other: the length is not known before, and a wrong one would cut the answer.
    assert "content-length" not in packed.headers
    assert packed.headers["vary"] == plain.headers["vary"] == "Accept-Encoding"
    assert packed.headers.get("etag") == plain.headers.get("etag")


def test_a_small_answer_may_be_another_one_for_others_too(get):
    assert [get("/v1/small", accepted).headers["vary"] for accepted in ("gzip", "identity")] == ["Accept-Encoding"] * 2


def test_an_answer_that_is_known_is_not_sent_again(get):
    tag = get("/v1/table").headers["etag"]
    assert tag.startswith("W/")  # the same of both forms
    for accepted in ("gzip", "identity"):
        again = get("/v1/table", accepted, **{"If-None-Match": tag})
        assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
        assert "content-encoding" not in again.headers
        assert again.headers["vary"] == "Accept-Encoding"


@pytest.mark.parametrize("path", ["/v1/small", "/v1/events", "/v1/report", "/table_of_pages"])
def test_small_answers_event_streams_and_pages_go_out_as_they_are(get, path):
    answer = get(path)
    assert "content-encoding" not in answer.headers
    assert answer.content == get(path, "identity").content


def test_what_is_packed_already_is_not_packed_again(get):
    assert get("/v1/packed").headers["content-encoding"] == "gzip"
    assert get("/v1/packed").content == ROWS


@pytest.mark.parametrize(
    ("accepted", "taken"),
    [
        ("gzip", True),
        ("br, GZIP;q=0.5", True),
        ("gzip;q=0.001", True),
        ("gzip;q=0", False),
        ("br, gzip; q=0.000", False),
        ("x-gzipped", False),
        ("", False),
        ("identity", False),
    ],
)
def test_gzip_is_taken_where_it_is_named_and_not_refused(accepted, taken):
    assert takes_gzip(accepted) is taken
