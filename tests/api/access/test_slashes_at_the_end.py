"""A slash at the end of an address changes neither who may call it nor what it does."""

import logging

import pytest

from app.http.permissions import READING, ROUTES
from app.services.access.identity import Role
from app.services.access.trail import list_trail
from tests.api.access.conftest import bearer, logged_in
from tests.api.access.test_permissions import ROLES, address

CLOSED = [(method, path) for (method, path), permission in ROUTES.items() if permission.needs is not None]


@pytest.mark.parametrize(("method", "path"), CLOSED)
@pytest.mark.parametrize("ending", ["/", "//", "/?a=/", "%2F", "/%2F", "%2F/"])
def test_nobody_gets_in_by_it(client, method, path, ending):
    answer = client.request(method, address(path) + ending)
    assert answer.status_code in (303, 401, 403, 404, 405), answer.status_code
    if answer.status_code == 303:
        assert answer.headers["location"].startswith("/login?next=%2F")


@pytest.mark.parametrize(("method", "path"), [route for route in CLOSED if route[0] not in READING])
@pytest.mark.parametrize("role", ROLES)
def test_no_role_may_more_with_it(client, texts, method, path, role):
    headers = bearer(texts[role]) if role else {}
    plain, ended = (client.request(method, address(path) + end, headers=headers, json={}) for end in ("", "/"))
    kinds = [answer.headers.get("content-type") for answer in (plain, ended)]
    assert (ended.status_code, kinds[1]) == (plain.status_code, kinds[0])


def test_a_form_needs_its_token_with_it_too(browser, texts):
    token = logged_in(browser, texts[Role.audit])
    assert browser.post("/runs/", data={"tags": "NOWHERE"}).json()["code"] == "csrf_token"
    sent = browser.post("/runs/", data={"tags": "NOWHERE", "csrf_token": token})
    assert sent.status_code != 403
    other = browser.post("/runs/", data={"csrf_token": token}, headers={"Sec-Fetch-Site": "cross-site"})
    assert other.status_code == 403


def test_the_login_leads_back_and_the_session_is_one(browser, texts):
    led = browser.get("/table/?sort=-health")
    assert (led.status_code, led.headers["location"]) == (303, "/login?next=%2Ftable%3Fsort%3D-health")
    answer = browser.post("/login/", data={"key": texts[Role.read], "next": "/"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    assert "path=/;" in answer.headers["set-cookie"].lower()
    assert browser.get("/table/").status_code == 200


def test_a_body_arrives_whole_and_the_trail_has_the_address(client, backend, texts):
    body = b"time,PV,OP\n" + b"0,3,4\n" * 100_000
    answer = client.post("/v1/uploads/?filename=ended.csv", content=body, headers=bearer(texts[Role.upload]))
    assert answer.status_code == 202, answer.text
    kept = backend.settings.uploads_dir.rglob("*")
    assert any(path.is_file() and path.read_bytes() == body for path in kept)
    row = list_trail(backend, action="upload.receive").rows[0]
    assert (row.subject, row.outcome) == (answer.headers["location"], "done")


def test_an_encoded_slash_at_the_end_is_of_the_tag(client, texts):
    problem = client.get("/v1/loops/FIC1%2F", headers=bearer(texts[Role.read])).json()
    assert problem["code"] == "unknown_loop"
    assert "'FIC1/'" in problem["detail"]


def test_files_figures_probes_and_what_is_no_address(client, texts, caplog):
    assert client.get("/static/loopaudit.css/").headers["cache-control"] == "no-cache"
    assert client.get("/static/").status_code == client.get("/static//").status_code == 404
    assert client.get("/metrics/", headers=bearer(texts[Role.read])).text.startswith("# HELP")
    assert client.get("/healthz/", headers={"Host": "10.0.0.7"}).status_code == 200
    options = client.options("/v1/loops/", headers=bearer(texts[Role.read]))
    assert (options.status_code, options.headers["allow"]) == (405, client.options("/v1/loops").headers["allow"])
    with caplog.at_level(logging.INFO, "loopaudit.requests"):
        problem = client.get("/nowhere/", headers=bearer(texts[Role.read]))
    assert problem.status_code == 404
    assert "/nowhere" in problem.json()["detail"]
