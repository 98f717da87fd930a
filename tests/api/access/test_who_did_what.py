"""The trail: who did what, without secrets, for administrators."""

import time

import pytest

from app.main import create_app
from app.services.access import key_text
from app.services.access.identity import Role
from app.services.access.trail import list_trail
from tests.api.access.conftest import bearer, logged_in


def test_the_trail_tells_who_did_what(client, backend, texts):
    answer = client.post(
        "/v1/uploads?filename=t.csv", content=b"time,PV,OP\n0,3,4\n", headers=bearer(texts[Role.upload])
    )
    rows = list_trail(backend, who="the upload", action="upload.receive").rows
    assert (rows[0].subject, rows[0].outcome) == (answer.headers["location"], "done")
    assert rows[0].request_id == answer.headers["x-request-id"]
    refused = client.post("/v1/audits", json={"tags": ["NOWHERE"]}, headers=bearer(texts[Role.audit]))
    assert refused.status_code == 400
    assert client.post("/v1/audits", json={}, headers=bearer(texts[Role.read])).status_code == 403
    assert list_trail(backend, who="the read", action="audit.start").rows[0].detail["status"] == 403
    assert list_trail(backend, who="the audit", action="audit.start").rows[0].outcome == "refused"


def test_what_was_asked_for_without_the_right_stands_in_the_trail(client, backend, texts):
    assert client.get("/v1/trail", headers=bearer(texts[Role.read])).status_code == 403
    assert client.get("/v1/groups", headers=bearer("wrong")).status_code == 401
    rows = list_trail(backend, action="access").rows[:2]
    assert [(row.who, row.subject, row.outcome, row.detail["status"]) for row in rows] == [
        ("nobody", "/v1/groups", "refused", 401),
        ("the read", "/v1/trail", "refused", 403),
    ]


def test_who_cancelled_a_run_stands_in_the_trail(client, backend, texts):
    run = client.post("/v1/audits", json={}, headers=bearer(texts[Role.audit]))
    client.post(f"{run.headers['location']}/cancel", headers=bearer(texts[Role.audit]))
    row = list_trail(backend, action="audit.cancel").rows[0]
    assert (row.who, row.subject) == ("the audit", f"{run.headers['location']}/cancel")


def test_the_trail_keeps_logins_and_wrong_keys_without_their_secrets(client, browser, backend, texts):
    logged_in(browser, texts[Role.read])
    wrong = key_text.make(Role.admin).text
    browser.cookies.clear()
    browser.post("/login", data={"key": wrong})
    rows = list_trail(backend, action="session.open").rows
    assert [(row.who, row.outcome) for row in rows[:2]] == [("nobody", "refused"), ("the read", "done")]
    assert wrong[-49:] not in str(list_trail(backend, 1000).rows)


@pytest.mark.parametrize("longer", ["", "x" * 470])
def test_a_key_in_an_address_is_neither_kept_nor_told(client, backend, texts, longer):
    typed = key_text.make(Role.admin).text
    path = f"/v1/loops/{longer}/{typed}"
    answer = client.patch(path, json={"importance": 2}, headers=bearer(texts[Role.audit]))
    assert answer.status_code == 404
    nowhere = client.get(f"/{longer}/{typed}", headers=bearer(texts[Role.read]))
    kept = list_trail(backend, who="the audit", action="loop.change").rows[0]
    assert kept.subject.startswith(f"/v1/loops/{longer}/la_admin_")
    for text in (answer.text, nowhere.text, kept.subject):
        assert typed[-49:-41] not in text


def test_what_a_terminal_would_obey_stays_encoded_in_the_trail(client, backend):
    path = "/v1/loops/%1B%5D0%3Bx%07%C2%9B2J%E2%80%AE/a%20b%C3%A9"
    assert client.get(path, headers=bearer(key_text.make(Role.admin).text)).status_code == 401
    assert list_trail(backend, action="access").rows[0].subject == "/v1/loops/%1B]0;x%07%C2%9B2J%E2%80%AE/a bé"


def test_nobody_fills_the_trail_without_a_key(serve, settings, backend):
    before, started_s = len(list_trail(backend, 1000).rows), time.monotonic()
    with serve(create_app(settings)) as client:
        for _ in range(30):
            assert client.post("/login", data={"key": "wrong"}).status_code in (401, 429)
            assert client.post("/logout").status_code == 303
            odd = client.post("/login", content=b"x", headers={"Content-Type": "multipart/form-data"})
            assert odd.status_code < 500
    rows = list_trail(backend, 1000).rows
    assert {row.action for row in rows[: len(rows) - before]} == {"session.open"}
    minutes = (time.monotonic() - started_s) / 60.0  # what is allowed comes back while a slow machine is at it
    assert len(rows) - before <= 20 * (1.0 + minutes)


def test_the_trail_is_for_administrators_page_by_page(client, texts):
    first = client.get("/v1/trail", params={"limit": 2}, headers=bearer(texts[Role.admin])).json()
    assert len(first["rows"]) == 2
    after = client.get(
        "/v1/trail", params={"limit": 2, "cursor": first["next_cursor"]}, headers=bearer(texts[Role.admin])
    ).json()
    assert int(after["rows"][0]["id"]) < int(first["rows"][1]["id"])


def test_uploads_say_who_sent_them(client, backend, texts):
    client.post("/v1/uploads?filename=w.csv", content=b"time,PV,OP\n0,5,6\n", headers=bearer(texts[Role.upload]))
    with backend.database.read() as connection:
        who = connection.exec_driver_sql("SELECT received_by FROM uploads ORDER BY id DESC LIMIT 1").scalar()
    assert who == "the upload"


def test_wrong_keys_from_one_address_are_slowed_down_and_good_ones_are_not(serve, settings, texts):
    with serve(create_app(settings)) as client:
        answers = [client.get("/v1/loops", headers=bearer("wrong")) for _ in range(25)]
        assert [answer.status_code for answer in answers] == [401] * 20 + [429] * 5
        assert answers[-1].headers["retry-after"]
        assert client.get("/v1/loops", headers=bearer(texts[Role.read])).status_code == 200


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("run-812.night_2", True),
        ("x" * 64, True),
        ("x" * 65, False),
        ("too-few", False),
        ("run-812.night\t2", False),
        ("run-812.night status=200", False),
    ],
)
def test_a_request_keeps_its_own_name_where_that_cannot_break_a_line_of_a_log(client, given, kept):
    named = client.get("/healthz", headers={"X-Request-Id": given}).headers["x-request-id"]
    assert (named == given) is kept
    assert kept or len(named) == 32
