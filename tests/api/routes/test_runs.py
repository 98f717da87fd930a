"""Runs: started, counted, followed."""

import asyncio
import json
from types import SimpleNamespace
from weakref import WeakValueDictionary

import pytest

from app.api import audits as events
from app.services.auditing import audits
from app.services.auditing.chunks import audit_chunk


def test_a_run_counts_its_loops(client, plant):
    assert (plant["state"], plant["total"], plant["done"], plant["failed"], plant["open"]) == ("done", 3, 3, 0, 0)
    runs = client.get("/v1/audits").json()
    assert plant["id"] in [run["id"] for run in runs["rows"]]


def test_a_run_over_some_loops(client, plant, backend):
    answer = client.post("/v1/audits", json={"tags": ["FIC101"]})
    assert answer.status_code == 202
    assert answer.json()["total"] == 1
    audit_chunk(backend, int(answer.json()["id"]), "test")
    assert client.get(answer.headers["location"]).json()["state"] == "done"
    assert client.post("/v1/audits", json={"tags": ["NOWHERE"]}).json()["code"] == "unknown_loops"
    refused = client.post("/v1/audits", json={"loops": ["FIC101"]})
    assert (refused.status_code, "loops are named in `tags`" in refused.json()["detail"]) == (422, True)


def test_a_run_without_a_body_is_one_over_the_plant(client, plant, backend):
    answer = client.post("/v1/audits")
    assert (answer.status_code, answer.json()["total"]) == (202, client.post("/v1/audits", json={}).json()["total"])


def test_a_body_that_is_no_json_starts_no_run(client, plant):
    before = client.get("/v1/audits?limit=1").json()["rows"]
    for body in ({"data": {"unit": "a"}}, {"content": b'{"tags": []}', "headers": {"Content-Type": "text/plain"}}):
        answer = client.post("/v1/audits", **body)
        assert (answer.status_code, answer.json()["code"]) == (415, "media_type")
        assert "application/json" in answer.json()["detail"]
    assert client.get("/v1/audits?limit=1").json()["rows"] == before
    form = {"Content-Type": "application/x-www-form-urlencoded"}
    assert client.post("/v1/audits", headers=form).status_code == 202  # `curl -d ''`: no body
    other = {"Content-Type": "application/vnd.plant+json; charset=utf-8"}
    assert client.post("/v1/audits", content=b"{}", headers=other).status_code == 202


@pytest.mark.parametrize("wanted", [{"unit": "nosuch"}, {"type": "nosuch"}, {"tags": []}], ids=str)
def test_a_filter_that_no_loop_fits_starts_no_run(client, plant, wanted):
    before = client.get("/v1/audits?limit=1").json()["rows"]
    answer = client.post("/v1/audits", json=wanted)
    assert (answer.status_code, answer.json()["code"]) == (400, "no_loops")
    assert client.get("/v1/audits?limit=1").json()["rows"] == before


def test_events_tell_the_progress_and_the_end(client, plant, backend):
    run = client.post("/v1/audits", json={"tags": ["LIC7"]}).json()
    with client.stream("GET", f"/v1/audits/{run['id']}/events") as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        lines = stream.iter_lines()
        assert next(lines) == "event: progress"
        assert json.loads(next(lines).removeprefix("data: "))["open"] == 1
        audit_chunk(backend, int(run["id"]), "test")
        rest = list(lines)
    assert "event: end" in rest
    assert json.loads(rest[-2].removeprefix("data: "))["state"] == "done"


def test_a_run_is_cancelled_and_what_it_found_stays(client, plant, backend):
    run = client.post("/v1/audits", json={"tags": ["FIC101", "LIC7"]}).json()
    cancelled = client.post(f"/v1/audits/{run['id']}/cancel")
    assert (cancelled.status_code, cancelled.json()["state"], cancelled.json()["open"]) == (200, "cancelled", 0)
    assert {failure["code"] for failure in cancelled.json()["failures"]} == {"cancelled"}
    assert client.post(f"/v1/audits/{run['id']}/cancel").json() == cancelled.json()
    assert audit_chunk(backend, int(run["id"]), "test") == 0
    assert client.get("/v1/loops/FIC101/health").json()["audit_id"] != run["id"]


def test_only_a_run_that_goes_on_is_cancelled(client, plant):
    ended = client.post(f"/v1/audits/{plant['id']}/cancel")
    assert (ended.status_code, ended.json()["code"]) == (409, "wrong_state")
    assert client.get(f"/v1/audits/{plant['id']}").json() == plant
    missing = client.post("/v1/audits/99999/cancel")
    assert (missing.status_code, missing.json()["code"]) == (404, "unknown_audit")


def test_far_more_loops_than_a_plant_has_are_not_taken_on(client, plant, backend, monkeypatch):
    waiting = client.post("/v1/audits", json={"tags": ["FIC101"]}).json()
    monkeypatch.setattr(audits, "MOST_OPEN", 1)
    before = client.get("/v1/audits?limit=1").json()["rows"]
    answer = client.post("/v1/audits", json={"tags": ["FIC101"]})
    assert (answer.status_code, answer.json()["code"]) == (409, "too_many_open")
    assert client.get("/v1/audits?limit=1").json()["rows"] == before
    monkeypatch.undo()
    client.post(f"/v1/audits/{waiting['id']}/cancel")


def test_a_loop_may_be_spelled_in_other_letters(client, plant, backend):
    run = client.post("/v1/audits", json={"tags": ["fic101", "FIC101"]}).json()
    assert run["total"] == 1
    client.post(f"/v1/audits/{run['id']}/cancel")
    for rest in ("", "/health", "/verdicts"):
        own = client.get(f"/v1/loops/FIC101{rest}")
        assert client.get(f"/v1/loops/fic101{rest}").json() == own.json()
    assert client.get("/v1/loops/fic999").status_code == 404


def test_many_streams_of_a_run_ask_the_data_base_as_one(backend, monkeypatch):
    looked, get = [], audits.get_audit
    monkeypatch.setattr(audits, "get_audit", lambda *given: looked.append(1) or get(*given))
    monkeypatch.setattr(events, "LOOK_S", 0.05)
    run = audits.start_audit(backend)

    async def answered() -> bool:
        return False

    request = SimpleNamespace(app=SimpleNamespace(state=SimpleNamespace(watched=WeakValueDictionary())))
    request.is_disconnected = answered

    async def first_of(stream) -> str:
        told = await anext(stream)
        await stream.aclose()
        return told

    async def crowd() -> list[str]:
        streams = [events.watched(request, backend, run.id) for _ in range(30)]
        return await asyncio.gather(*map(first_of, streams))

    told = asyncio.run(crowd())
    assert len(set(told)) == 1
    assert len(looked) <= 3
    assert not request.app.state.watched
    audits.cancel_audit(backend, run.id)


def test_the_plant_is_told_night_by_night(client, plant, backend):
    run = client.post("/v1/audits", json={}).json()
    audit_chunk(backend, int(run["id"]), "test")
    told = client.get("/v1/nights").json()
    assert told["next_cursor"] is None
    night = told["rows"][-1]
    assert (night["run"], night["audited"]) == (run["id"], run["total"])
    assert night["sticking"] == sum(unit["sticking"] for unit in night["units"])


def test_the_plant_asked_for_twice_is_one_run(client, plant):
    first, second = (client.post("/v1/audits", json={}) for _ in range(2))
    assert (second.status_code, second.json()["id"]) == (202, first.json()["id"])
    assert client.post("/v1/audits", json={"tags": ["FIC101"]}).json()["id"] != first.json()["id"]
