"""What holds for every route: heads, refusals, probes, pages, a database that is away."""

import re
from urllib.parse import quote

import pytest

from app.main import create_app
from app.settings import Settings
from tests.api.routes.exports import HOSTILE


@pytest.mark.parametrize(
    "path", ["/", "/healthz", "/readyz", "/metrics", "/openapi.json", "/v1/loops", "/v1/loops/FIC101/health", "/table"]
)
def test_every_route_that_is_got_answers_head_without_a_body(client, plant, path):
    got, head = client.get(path), client.head(path)
    assert (head.status_code, head.content) == (got.status_code, b"")
    assert head.headers["content-type"] == got.headers["content-type"]


def test_head_of_a_stream_ends_and_of_what_is_not_there_is_not_found(client, plant):
    run = client.post("/v1/audits", json={"tags": ["LIC7"]}).json()
    assert client.head(f"/v1/audits/{run['id']}/events", timeout=5).status_code == 200
    assert client.head("/v1/loops/NOWHERE").status_code == 404
    assert client.head("/nowhere").status_code == 404


@pytest.mark.parametrize(
    "path",
    ["/v1/loops", "/v1/reliability", "/v1/loops/FIC101", "/v1/loops/FIC101/health", "/v1/audits/1", "/v1/uploads",
     "/v1/nights", "/readyz", "/metrics", "/table", "/runs", "/uploads", "/loops/FIC101", "/loops/FIC101/charts"],
)  # fmt: skip
def test_a_slash_at_the_end_changes_nothing(client, plant, path):
    """A redirect would lose what is sent, or be taken for the answer by those who follow none."""
    plain, with_slash = client.get(path), client.get(f"{path}/")
    assert (plain.status_code, with_slash.status_code) == (200, 200)
    assert with_slash.headers["content-type"] == plain.headers["content-type"]
    assert client.head(f"{path}/").status_code == 200


def test_a_slash_at_the_end_changes_nothing_of_what_is_sent(client, plant):
    changed = client.patch("/v1/loops/FIC101/", json={"unit": "U9"})
    assert (changed.status_code, changed.json()["unit"]) == (200, "U9")
    assert client.patch("/v1/loops/", json={"loops": [{"tag": "FIC101", "unit": None}]}).json()["changed"] == 1
    refused = client.post("/v1/audits/", json={"tags": ["NOWHERE"]})
    assert (refused.status_code, refused.json()["code"]) == (400, "unknown_loops"), refused.text
    assert client.post("/table/").status_code == 405


def test_an_encoded_slash_at_the_end_is_the_tags_own_and_two_are_no_address(client, plant):
    for path in ("/v1/loops/FIC101%2F", "/v1/loops/FIC101%2F/health", "/v1/loops//", "/v1/nights//", "/nowhere/"):
        assert client.get(path).status_code == 404, path


@pytest.mark.parametrize(
    "path",
    ["/v1/uploads/7777", "/v1/uploads/x", "/v1/loops/NOWHERE", "/v1/loops/NOWHERE/health", "/v1/loops/NOWHERE/trend",
     "/v1/loops/NOWHERE/verdicts", "/v1/audits/7777", "/v1/audits/-1", "/v1/audits/7777/events", "/loops/NOWHERE"],
)  # fmt: skip
def test_what_is_not_there(client, plant, path):
    answer = client.get(path)
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "application/problem+json"


def test_a_body_that_is_too_large_is_a_problem_too(client):
    answer = client.post("/v1/audits", content=b" " * 5_000_000, headers={"Content-Type": "application/json"})
    assert answer.status_code == 413
    assert answer.headers["content-type"] == "application/problem+json"


def test_liveness_readiness_and_metrics(client, plant):
    assert client.get("/healthz").json() == {"state": "alive"}
    checks = client.get("/readyz").json()["checks"]
    assert (checks["database"], checks["schema"], checks["writes"]) == ("ok", "current", "ok")
    text = client.get("/metrics").text
    for line in text.splitlines():
        assert re.fullmatch(r'# (HELP|TYPE) \w+ .+|\w+(\{\w+="[^"]*"(,\w+="[^"]*")*\})? [-+.\deE]+', line), line


def test_pages_carry_hostile_names_as_text(client, plant):
    page = client.get("/")
    assert page.status_code == 200
    assert HOSTILE not in page.text
    assert "&lt;b&gt;" in page.text
    loop = client.get(f"/loops/{quote(HOSTILE, safe='')}")
    assert loop.status_code == 200
    assert HOSTILE not in loop.text
    assert f"/loops/{quote(HOSTILE, safe='')}/charts" in loop.text
    assert client.get(f"/loops/{quote(HOSTILE, safe='')}/charts").status_code == 200


def test_pages_take_nothing_from_elsewhere(client, plant):
    for path in ("/", "/loops/FIC101", "/static/plant.js", "/static/loop.js", "/static/loopaudit.css"):
        answer = client.get(path)
        assert answer.status_code == 200
        assert not re.search(r"(src|href|url|import)\s*[=(]\s*[\"']?(https?:)?//", answer.text), path
    assert len(client.get("/static/plotly.min.js").content) > 1_000_000
    assert client.get("/static/../main.py").status_code == 404


def test_a_refusal_is_no_longer_than_what_was_wrong(client):
    asked = "&".join(f"{k}{'x' * 1000}" for k in range(50))
    answer = client.get(f"/v1/reliability?{asked}")
    assert answer.json()["code"] == "invalid_request"
    assert len(answer.content) < len(asked)


def test_a_parameter_that_a_route_does_not_know_is_refused_by_each_of_the_api(client):
    taking = {
        (method, path): operation
        for path, operations in client.get("/openapi.json").json()["paths"].items()
        for method, operation in operations.items()
        if path.startswith("/v1/")
    }
    assert len(taking) > 20
    for (method, path), operation in taking.items():
        assert "422" in operation["responses"], path
        known = [one["name"] for one in operation.get("parameters", ()) if one["in"] == "query"]
        answer = client.request(method, re.sub(r"{\w+}", "x", path), params={"limt": 5})
        assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request"), path
        (error,) = (one for one in answer.json()["errors"] if one["where"].startswith("query."))
        told = f"there is {', '.join(known)}" if known else "this takes no parameters"
        assert (error["where"], error["what"].endswith(told)) == ("query.limt", True), path


def test_a_parameter_that_takes_one_value_is_not_given_two(client):
    """The first of them would be passed over in silence."""
    several, single = set(), set()
    for path, operations in client.get("/openapi.json").json()["paths"].items():
        for one in operations.get("get", {}).get("parameters", ()) if path.startswith("/v1/") else ():
            if one["in"] == "query":
                kinds = [one["schema"], *one["schema"].get("anyOf", ())]
                (several if any(kind.get("type") == "array" for kind in kinds) else single).add((path, one["name"]))
    assert "verdict" in {name for _, name in several}
    assert {"limit", "cursor", "columns", "unit", "from"} <= {name for _, name in single}
    for path, name in several | single:
        answer = client.get(re.sub(r"{\w+}", "x", path), params=[(name, "1"), (name, "1")])
        refused = {one["where"]: one["what"] for one in answer.json().get("errors", ())}
        told = refused.get(f"query.{name}", "")
        assert told.startswith("it is given 2 times") == ((path, name) in single), (path, name, told)


@pytest.mark.parametrize(
    ("path", "body", "where", "known"),
    [
        ("/v1/audits", {"tag": ["FIC101"]}, "body.tag", "tags, unit, type"),
        ("/v1/loops/FIC101/notes", {"note": "x"}, "body.note", "text, work_order, repaired_at, shelved_until"),
        ("/v1/loops/FIC101/explanations", {"start": 1, "hours": 8}, "body.hours", "from, to, window_h, trace, csv"),
        ("/v1/loops/FIC101/explanations", {"trace": {"pv": [1]}}, "body.trace.pv", "values, time"),
    ],
)
def test_a_field_that_a_body_does_not_have_is_refused_with_those_that_it_has(client, path, body, where, known):
    answer = client.post(path, json=body)
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")
    (told,) = [one["what"] for one in answer.json()["errors"] if one["where"] == where]
    assert told.startswith(f"no field is called so; there is {known}")


@pytest.mark.parametrize(
    ("method", "path", "body", "name"),
    [
        ("POST", "/v1/audits", '{"tags": ["FIC101"], "tags": ["LIC7"]}', "tags"),
        ("PATCH", "/v1/loops/FIC101", '{"unit": "a", "unit": "a"}', "unit"),
        ("POST", "/v1/loops/FIC101/notes", '{"text": "x", "work_order": "1", "text": "y"}', "text"),
        ("POST", "/v1/loops/FIC101/explanations", '{"model": {"gain": 1, "gain": 2}}', "gain"),
    ],
)
def test_a_field_that_a_body_has_twice_is_refused_as_a_parameter_is(client, plant, method, path, body, name):
    """The first of them would be passed over in silence."""
    answer = client.request(method, path, content=body, headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request"), answer.text
    assert answer.json()["errors"] == [{"where": f"body.{name}", "what": "it is given 2 times and takes one value"}]


NOTES = "/v1/loops/FIC101/notes"
JSON = {"Content-Type": "application/json"}


def test_a_field_whose_name_is_no_text_and_that_a_body_has_twice_is_refused_in_short(client, plant):
    """Half of a letter has no UTF-8, in which the refusal is written."""
    for name, told in (("\\ud800", "\\ud800"), ("x" * 3000, "x" * 60)):
        answer = client.post(NOTES, content=f'{{"{name}": 1, "{name}": 2}}', headers=JSON)
        assert (answer.status_code, answer.json()["errors"][0]["where"]) == (422, f"body.{told}"), answer.text


@pytest.mark.parametrize("body", [b"pump repaired", b"\xff", b"[" * 100_000])
def test_a_body_of_no_kind_that_is_no_json_is_refused_as_ever(client, plant, body):
    answer = client.post(NOTES, content=body)
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request"), answer.text


def test_no_depth_of_a_body_is_a_fault(client, plant):
    """Python reads some hundred levels, and fewer the deeper it stands itself."""
    codes = {client.post(NOTES, content=b"[" * n + b"]" * n, headers=JSON).status_code for n in range(850, 1000, 2)}
    assert codes == {400, 422}


@pytest.mark.parametrize(
    ("method", "path", "asked", "told"),
    [
        ("POST", "/v1/audits", {"json": {"loops": ["FIC101"]}}, "body: loops are named in `tags`"),
        (
            "POST",
            "/v1/audits",
            {"content": '{"tags": ["FIC101"', "headers": {"Content-Type": "application/json"}},
            "body.18: from this character on it is no JSON: Expecting ',' delimiter",
        ),
        ("GET", "/v1/loops/FIC101/trend", {"params": {"from": "2026"}}, "query.from: a time is written in ISO 8601"),
    ],
)
def test_a_refusal_in_our_own_words_begins_with_them(client, plant, method, path, asked, told):
    assert client.request(method, path, **asked).json()["detail"].startswith(told)


@pytest.mark.parametrize("path", ["/healthz", "/readyz", "/metrics"])
def test_probes_may_add_parameters(client, path):
    assert client.get(path, params={"target": "plant"}).status_code == 200


def test_a_data_base_that_is_away_is_503_and_nothing_of_it_is_told(serve, tmp_path):
    settings = Settings(data_dir=tmp_path, database_url="postgresql+psycopg://who:secret@127.0.0.1:1/none")
    with serve(create_app(settings)) as client:
        answer = client.get("/v1/loops")
        assert (answer.status_code, answer.json()["code"]) == (503, "database_away")
        assert answer.headers["retry-after"]
        assert "secret" not in answer.text
        ready = client.get("/readyz")
        assert (ready.status_code, ready.json()["state"]) == (503, "not_ready")
        assert ready.json()["checks"]["schema"] == "not known"
        assert client.get("/healthz").status_code == 200


def test_a_wrong_method_is_told_every_method_of_the_path(client):
    answer = client.delete("/v1/loops/FIC101")
    assert (answer.status_code, answer.json()["code"]) == (405, "method_not_allowed")
    assert {"GET", "HEAD", "PATCH"} <= set(answer.headers["allow"].split(", "))
    assert client.head("/v1/loops").status_code == 200


def test_a_part_of_a_file_is_not_asked_for_in_bare_text(client):
    answer = client.get("/static/loopaudit.css", headers={"Range": "bytes=9-1"})
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/css")


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("/v1/loops/AREA/FIC101/notes/1", "a note is kept for ever; DELETE .../{id}/repair withdraws the repair"),
        ("/v1/loops/AREA/FIC101", 'a loop is kept with its history; PATCH it with {"retired": true}'),
        ("/v1/audits/1", "a run is kept; POST .../{id}/cancel stops it"),
    ],
)
def test_what_is_never_deleted_says_what_to_do_instead(client, path, words):
    answer = client.delete(path)
    assert (answer.status_code, answer.json()["code"]) == (405, "method_not_allowed")
    assert words in answer.json()["detail"]


@pytest.mark.parametrize("path", ["explanations/3", "verdicts", "notes"])
def test_of_what_a_loop_has_it_is_not_said_to_patch_it(client, path):
    answer = client.delete(f"/v1/loops/FIC101/{path}")
    assert (answer.status_code, answer.json()["code"]) == (405, "method_not_allowed")
    assert "retired" not in answer.json()["detail"]
