"""Whoever looks at pages is told what went wrong by a page; whoever asks as a machine by a problem."""

import re

import httpx
import pytest

from app.main import create_app
from app.services.access.identity import Role
from app.services.access.keys import create_key
from app.web.errors import HEADINGS

BROWSER = {"Accept": "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"}
HOSTILE = "<script>alert(1)</script>"


def told(answer: httpx.Response, status: int, code: str) -> str:
    """The page's text, which has the code and the request's name in it."""
    assert answer.status_code == status, answer.text[:300]
    assert answer.headers["content-type"].startswith("text/html")
    assert answer.headers["content-security-policy"]
    assert HEADINGS[status] in answer.text
    assert f"<code>{code}</code>" in answer.text
    assert f"request <code>{answer.headers['x-request-id']}</code>" in answer.text
    assert '<a href="/">' in answer.text
    return answer.text


@pytest.mark.parametrize(
    ("path", "status", "code"),
    [
        ("/nowhere", 404, "no_such_route"),
        ("/loops/nothing", 404, "unknown_loop"),
        ("/runs/99", 404, "unknown_audit"),
        ("/table?sort=nonsense", 400, "bad_sort"),
        ("/table?search=" + "x" * 300, 422, "invalid_request"),
    ],
)
def test_a_browser_is_told_by_a_page(client, path, status, code):
    told(client.get(path, headers=BROWSER), status, code)
    problem = client.get(path)
    assert (problem.status_code, problem.json()["code"]) == (status, code)
    assert problem.headers["content-type"] == "application/problem+json"


def test_a_wrong_method_and_a_form_that_cannot_be_used(client):
    told(client.post("/table", headers=BROWSER), 405, "method_not_allowed")
    span = {"importance": "1", "pv_low": "5", "pv_high": "1"}
    answer = client.post("/loops/FIC101/settings", data=span, headers=BROWSER)
    assert answer.status_code == 400
    assert "pv_low must be below pv_high" in answer.text


@pytest.mark.parametrize("path", ["/v1/loops/nothing", "/v1/nowhere", "/v1", "/static/nothing.js"])
def test_addresses_for_machines_answer_as_problems_to_browsers_too(client, path):
    answer = client.get(path, headers=BROWSER)
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "application/problem+json"


def test_what_was_asked_stays_text(client):
    text = told(client.get(f"/{HOSTILE}", headers=BROWSER), 404, "no_such_route")
    assert HOSTILE not in text
    assert re.search(r"&lt;script|%3Cscript", text)


def test_a_fault_names_the_request_and_not_its_cause(serve, web_backend, monkeypatch):
    def fails(*_):
        raise RuntimeError("secret detail")

    monkeypatch.setattr("app.services.plant.plant_sheet.overview", fails)
    with serve(create_app(web_backend.settings)) as client:
        answer = client.get("/", headers=BROWSER | {"X-Request-Id": "asked-by-a-test"})
        assert answer.headers["Connection"] == "close"  # as the server does after a fault
        text = told(answer, 500, "internal_error")
        assert "asked-by-a-test" in text
        assert "secret" not in text
        problem = client.get("/", headers={"X-Request-Id": "asked-by-a-test"})
    assert (problem.status_code, problem.json()["request_id"]) == (500, "asked-by-a-test")


def test_a_role_that_is_too_low_and_no_key_at_all(serve, web_backend):
    key = create_key(web_backend, "looks", Role.read, lifetime=None).text
    with serve(create_app(web_backend.settings, keys_required=True)) as client:
        bearer = BROWSER | {"Authorization": f"Bearer {key}"}
        told(client.post("/runs", headers=bearer), 403, "role")
        assert '<a href="/login">' in told(client.post("/runs", headers=BROWSER), 401, "key_needed")
