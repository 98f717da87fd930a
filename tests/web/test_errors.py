"""Whoever looks at pages is told what went wrong by a page; whoever asks as a machine by a problem."""

import re

import httpx
import pytest
from markupsafe import escape

from app.main import create_app
from app.services.access.identity import Role
from app.services.access.keys import create_key
from app.web.errors import HEADING_BY_CODE, HEADINGS, error_page, form_page
from tests.web.conftest import HOSTILE_PAGE

BROWSER = {"Accept": "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"}
HOSTILE = "<script>alert(1)</script>"


def told(answer: httpx.Response, status: int, code: str) -> str:
    """The page's text, which has the code and the request's name in it."""
    assert answer.status_code == status, answer.text[:300]
    assert answer.headers["content-type"].startswith("text/html")
    assert answer.headers["content-security-policy"]
    assert HEADING_BY_CODE.get(code, HEADINGS[status]) in answer.text
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


@pytest.mark.parametrize(
    ("detail", "shown"),
    [
        ("there is no loop 'X'", "There is no loop 'X'."),
        ("this needs the role audit; ask", "This needs the role audit; ask."),
        ("pv_low must be below pv_high", "pv_low must be below pv_high."),
        ("d = 0.3 is too small?", "d = 0.3 is too small?"),
        ("mV, pH and limit=3 are none", "mV, pH and limit=3 are none."),
        ("fic-101 is not there", "fic-101 is not there."),
        ("", ""),
    ],
)
def test_what_is_told_on_a_page_is_a_sentence_and_names_stay_as_they_are(detail, shown):
    problem = {"status": 404, "title": "Not Found", "code": "unknown_loop", "instance": "/", "detail": detail}
    page = error_page(problem).body.decode()
    assert f'<p role="alert">{escape(shown)}</p>' in page


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
        text = told(client.post("/runs", headers=BROWSER), 401, "key_needed")
        assert '<a href="/login?next=/runs">' in text
        assert "your login has ended; nothing was done" in text
        assert "Bearer" not in text  # that is for clients


def test_a_form_of_another_login_is_loaded_again(serve, web_backend):
    key = create_key(web_backend, "audits", Role.audit, lifetime=None).text
    with serve(create_app(web_backend.settings, keys_required=True)) as client:
        client.post("/login", data={"key": key})
        note = client.post("/loops/FIC101/notes", data={"text": "x", "csrf_token": "old"}, headers=BROWSER)
        text = told(note, 403, "csrf_token")
        assert '<a href="/loops/FIC101">the page of the form</a>' in text
        assert "Reload it" in text
        assert "for a key with the role" not in text
        client.post("/logout", data={"csrf_token": form_token(client)})
        text = told(client.post(f"{HOSTILE_PAGE}/notes", data={"text": "x"}, headers=BROWSER), 401, "key_needed")
        (next_page,) = re.findall(r'href="(/login\?next=[^"]*)"', text)
        assert f'value="{escape(HOSTILE_PAGE)}"' in client.get(next_page).text


def form_token(client: httpx.Client) -> str:
    return re.search(r'name="csrf-token" content="([\w-]+)"', client.get("/").text)[1]


@pytest.mark.parametrize(
    ("status", "code", "said"),
    [
        (429, "too_many_requests", "send it again unchanged"),
        (507, "disk_full", "its disk is full"),
        (409, "wrong_state", "check its current state"),
        (404, "unknown_audit", "listed under Runs"),
        (404, "unknown_upload", "listed under Uploads"),
        (404, "unknown_loop", "look it up in the table"),
        (403, "cross_site", "by its own address"),
        (403, "role", "a key with the role"),
        (400, "bad_sort", "Change it and send it again"),
    ],
)
def test_the_advice_is_that_of_the_error(status, code, said):
    text = error_page(problem(status, code, "/x")).body.decode()
    assert said in text
    assert ("Change it" in text) is (code == "bad_sort")


@pytest.mark.parametrize(
    ("sent_to", "page"),
    [
        ("/loops/a%2Fb/notes", "/loops/a%2Fb"),
        ("/loops/a/notes/7/withdraw", "/loops/a"),
        ("/uploads/5/mapping", "/uploads/5"),
        ("/uploads/kept/forget", "/uploads"),
        ("/runs/5/cancel", "/runs/5"),
        ("/runs", "/runs"),
        ("//evil.example/notes", None),
        ("/logout", None),
        ("/loops/" + "x" * 300 + "/notes", None),
    ],
)
def test_a_form_leads_back_to_its_page(sent_to, page):
    assert form_page(sent_to) == page


def problem(status: int, code: str, instance: str) -> dict[str, object]:
    return {"status": status, "code": code, "instance": instance, "title": "t", "detail": "d"}
