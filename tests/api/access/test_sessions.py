"""Sessions of people: login, cookies, the token of their forms, and when they end."""

import asyncio
from datetime import timedelta

import pytest

from app.http import forms
from app.services.access import authentication, keys
from app.services.access.identity import Role
from app.storage import keys as stored_keys
from app.storage.types import now
from tests.api.access.conftest import logged_in


def test_pages_lead_to_the_login_and_back(browser, texts):
    led = browser.get("/loops/FIC1?x=1")
    assert led.headers["location"] == "/login?next=%2Floops%2FFIC1%3Fx%3D1"
    assert 'value="/loops/FIC1?x=1"' in browser.get(led.headers["location"]).text
    answer = browser.post("/login", data={"key": texts[Role.read], "next": "/loops/FIC1?x=1"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/loops/FIC1?x=1")
    assert browser.get("/").status_code == 200
    assert browser.get("/v1/loops").status_code == 200


def test_the_cookie_is_for_this_site_and_no_script(browser, texts):
    answer = browser.post("/login", data={"key": texts[Role.read]})
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "samesite=strict" in cookie.lower()
    assert "Path=/" in cookie
    assert texts[Role.read][-49:] not in cookie


def test_over_https_the_cookie_is_secure_and_bound_to_the_host(browser, texts):
    answer = browser.post("/login", data={"key": texts[Role.read]}, headers={"X-Forwarded-Proto": "https"})
    assert answer.headers["set-cookie"].startswith("__Host-loopaudit_session=")
    assert "Secure" in answer.headers["set-cookie"]
    assert "max-age" in answer.headers["strict-transport-security"]


@pytest.mark.parametrize(
    "wanted", ["https://evil.example/", "//evil.example", "/\\evil.example", "javascript:alert(1)", "/a\nb"]
)
def test_the_login_leads_nowhere_else(browser, texts, wanted):
    answer = browser.post("/login", data={"key": texts[Role.read], "next": wanted})
    assert answer.headers["location"] == "/"


def test_a_wrong_key_opens_no_session(browser):
    answer = browser.post("/login", data={"key": "la_read_wrong"})
    assert answer.status_code == 401
    assert "set-cookie" not in answer.headers
    assert "not known" in answer.text


def test_a_session_changes_nothing_without_the_token_of_its_forms(browser, texts):
    token = logged_in(browser, texts[Role.audit])
    assert browser.post("/v1/audits", json={}).json()["code"] == "csrf_token"
    assert browser.post("/v1/audits", json={}, headers={"X-CSRF-Token": "x" * 43}).json()["code"] == "csrf_token"
    assert browser.post("/v1/audits", json={}, headers={"X-CSRF-Token": token}).status_code == 202


def test_a_form_carries_the_token_and_its_body_arrives_whole(browser, texts):
    token = logged_in(browser, texts[Role.upload])
    file = {"file": ("a.csv", b"time,PV,OP\n" + b"0,1,2\n" * 20_000, "text/csv")}
    assert browser.post("/v1/uploads", files=file).json()["code"] == "csrf_token"
    answer = browser.post("/v1/uploads", data={"csrf_token": token}, files=file)
    assert answer.status_code == 202, answer.text
    assert answer.json()["size_bytes"] == 11 + 6 * 20_000


def test_of_a_long_body_no_more_than_its_beginning_is_held():
    parts = iter(range(100))

    async def receive():
        return {"type": "http.request", "body": bytes(forms.LOOKED_AT_BYTES // 4), "more_body": next(parts) < 99}

    messages = asyncio.run(forms.beginning(receive))
    assert (len(messages), next(parts)) == (4, 4)


@pytest.mark.parametrize("token", ["", "x", "a" * 44, "é" * 43, "a" * 42 + "!"])
def test_a_cookie_that_no_session_has_is_not_looked_up(browser, texts, monkeypatch, token):
    monkeypatch.setattr(stored_keys, "session", None)
    sent = {"Cookie": f"loopaudit_session={token}".encode()}
    assert browser.get("/v1/loops", headers=sent).status_code == 401


def test_logging_out_ends_the_session(browser, texts):
    token = logged_in(browser, texts[Role.read])
    cookies = dict(browser.cookies)
    assert browser.post("/logout").json()["code"] == "csrf_token"
    assert browser.post("/logout", data={"csrf_token": token}).status_code == 303
    assert (
        browser.get("/v1/loops", headers={"Cookie": f"loopaudit_session={cookies['loopaudit_session']}"}).status_code
        == 401
    )


def test_a_session_ends_with_its_key(browser, backend):
    made = keys.create_key(backend, "visitor", Role.read, lifetime=None)
    logged_in(browser, made.text)
    keys.revoke_key(backend, made.key.id)
    assert browser.get("/v1/loops").status_code == 401
    assert browser.get("/").status_code == 303


def test_a_session_that_is_used_goes_on_and_an_idle_one_ends(browser, texts, backend, monkeypatch):
    browser.post("/login", data={"key": texts[Role.read]})
    idle = timedelta(minutes=backend.settings.session_idle_min)
    for later in (0.9, 1.8, 2.7):
        at(monkeypatch, now() + later * idle)
        assert browser.get("/v1/loops").status_code == 200
    at(monkeypatch, now() + 3.8 * idle)
    assert browser.get("/v1/loops").status_code == 401


def test_use_makes_no_session_older_than_it_may_become(browser, texts, backend, monkeypatch):
    browser.post("/login", data={"key": texts[Role.read]})
    settings = backend.settings
    steps = int(settings.session_h * 60 / settings.session_idle_min * 2)
    answers = []
    for step in range(1, steps + 2):
        at(monkeypatch, now() + step * timedelta(minutes=settings.session_idle_min / 2))
        answers.append(browser.get("/v1/loops").status_code)
    assert answers[: steps - 1] == [200] * (steps - 1)
    assert answers[-1] == 401


def at(monkeypatch, moment) -> None:
    """The service's clock stands at `moment`; that of the test goes on."""
    for module in (authentication, stored_keys):
        monkeypatch.setattr(module, "now", lambda: moment)


def test_a_session_that_a_clock_ahead_opened_ends_when_that_is_put_right(browser, texts, monkeypatch):
    """By its own times it would go on, used or not, until the clock comes there again."""
    at(monkeypatch, now() + timedelta(hours=20))
    logged_in(browser, texts[Role.read])
    monkeypatch.undo()
    assert browser.get("/").status_code == 303


def test_a_session_has_the_role_of_its_key(browser, texts):
    token = logged_in(browser, texts[Role.read])
    answer = browser.post("/v1/audits", json={}, headers={"X-CSRF-Token": token})
    assert (answer.status_code, answer.json()["code"]) == (403, "role")


@pytest.mark.parametrize(("page", "needed"), [("/uploads", Role.upload), ("/loop-list", Role.audit)])
def test_a_page_without_its_form_says_which_role_has_it(browser, texts, page, needed):
    told = f"needs a key with the role {needed} or admin"
    logged_in(browser, texts[Role.read])
    assert told in browser.get(page).text
    logged_in(browser, texts[needed])
    assert told not in browser.get(page).text
