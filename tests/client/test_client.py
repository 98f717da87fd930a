"""The client against the service as it is, and against a service that is busy or speaks otherwise."""

import ast
import dataclasses
import json
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx
import pytest

import app.client
from app.api.explanation_models import ExplanationOut
from app.api.models import HealthOut
from app.api.reference import fields_of
from app.client import (
    Audit,
    Client,
    Explanation,
    Group,
    Loop,
    NoServiceError,
    Note,
    Row,
    ServiceError,
    Trend,
    Upload,
)
from app.main import create_app
from app.services.audit_json.models import TableRow
from app.services.backend import Backend
from app.services.explaining.working import explain_next
from app.services.intake.reading import read_upload
from app.services.outward import AuditOut, GroupOut, LoopOut, NoteOut, TrendOut, UploadOut

ROOM = Path(app.client.__file__).parent
TAG = "AREA 1/FIC?#%2F"


@pytest.fixture(scope="module")
def backend(open_plant) -> Backend:
    return open_plant()


@pytest.fixture(scope="module")
def client(serve, backend):
    with serve(create_app(backend.settings)) as connection, Client(str(connection.base_url)) as own:
        yield own


@pytest.fixture(scope="module")
def upload(client, backend, tmp_path_factory):
    file = tmp_path_factory.mktemp("exports") / "a.csv"
    lines = [f"2026-01-01T00:{k // 60:02d}:{k % 60:02d}Z,{k % 7},{k % 5}" for k in range(300)]
    file.write_text("\n".join([f"DateTime,{TAG}.PV,{TAG}.OP", *lines]) + "\n", encoding="utf-8")
    sent = client.upload(file)
    read_upload(backend, int(sent.id), owner="test")
    return client.get_upload(sent.id)


@pytest.mark.parametrize(
    ("own", "served"),
    [
        (Loop, LoopOut),
        (Row, TableRow),
        (Row, HealthOut),
        (Upload, UploadOut),
        (Audit, AuditOut),
        (Trend, TrendOut),
        (Note, NoteOut),
        (Explanation, ExplanationOut),
        (Group, GroupOut),
    ],
)
def test_every_field_is_one_that_the_service_sends(own, served):
    assert {f.name for f in dataclasses.fields(own)} - {"raw"} <= set(fields_of(served))


def test_the_client_needs_nothing_of_the_server():
    names = set()
    for path in ROOM.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names.update(alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                names.add(node.module or "")
    strangers = {n for n in names if n.split(".")[0] not in sys.stdlib_module_names and not n.startswith("app.client")}
    assert strangers == {"httpx"}
    assert (ROOM / "py.typed").is_file()


def test_an_export_is_sent_and_its_loops_are_there(client, upload):
    assert (upload.state, upload.ended, upload.loops) == ("done", True, [TAG])
    assert [loop.tag for loop in client.loops()] == [TAG]
    assert client.loop(TAG).tag == TAG
    assert upload.raw["size_bytes"] == upload.size_bytes


def test_a_loop_is_changed(client, upload):
    assert client.change_loop(TAG, unit="area 2", importance=3).importance == 3.0
    assert [loop.tag for loop in client.loops(unit="area 2")] == [TAG]
    assert list(client.loops(unit="elsewhere")) == []
    assert client.change_loop(TAG, owner="crew A").owner == "crew A"
    assert [[loop.tag for loop in client.loops(owner=owner)] for owner in ("crew A", "crew B")] == [[TAG], []]
    assert [row.loop for row in client.reliability(owner="crew B")] == []


def test_many_loops_are_changed_at_once(client, upload):
    done = client.change_loops([{"tag": TAG, "importance": 2}, {"tag": "NOWHERE", "importance": 2}])
    assert (done.changed, [row["code"] for row in done.refused]) == (1, ["unknown_loop"])


def test_the_series_come_with_their_times(client, upload):
    trend = client.trend(TAG, points=50)
    assert trend.samples == 300
    assert len(trend.time) == len(trend.time_ms) == len(trend.pv) == len(trend.op)


def test_a_loop_is_retired_and_found_again(client, upload):
    assert client.change_loop(TAG, retired=True).retired
    assert [loop.tag for loop in client.loops(retired=True)] == [TAG]
    assert client.change_loop(TAG, retired=False).retired is False
    assert list(client.loops(retired=True)) == []


def test_an_audit_is_started_and_waited_for(client, upload, monkeypatch):
    run = client.start_audit(tags=[TAG])
    assert (run.total, run.ended) == (1, False)
    monkeypatch.setattr("app.client.connection.POLL_S", 0.01)
    with pytest.raises(TimeoutError):
        client.wait(lambda: client.get_audit(run.id), timeout_s=0.05)


def test_an_audit_is_cancelled(client, upload):
    run = client.start_audit(tags=[TAG])
    assert client.cancel_audit(run.id).state == "cancelled"
    assert client.cancel_audit(run.id).ended
    with pytest.raises(ServiceError, match="unknown_audit"):
        client.cancel_audit("77777")


def test_a_refusal_has_the_code_of_the_service(client, upload):
    with pytest.raises(ServiceError) as refusal:
        client.health(TAG)
    assert (refusal.value.status, refusal.value.code) == (404, "not_audited")
    with pytest.raises(ServiceError) as refusal:
        list(client.reliability(sort="nothing"))
    assert refusal.value.code == "bad_sort"


def test_notes_are_written_read_and_withdrawn(client, upload):
    said = client.write_note(TAG, "packing renewed", work_order="WO-7", repaired_at="2026-01-01T00:02:00Z")
    assert (said.work_order, said.repaired_at, said.withdrawn_at) == ("WO-7", "2026-01-01T00:02:00Z", None)
    until = datetime.now(UTC).replace(microsecond=0) + timedelta(days=9)
    shelved = client.write_note(TAG, "until the turnaround", shelved_until=until)
    assert datetime.fromisoformat(shelved.shelved_until or "") == until
    assert [note.id for note in client.notes(TAG)] == [shelved.id, said.id]
    assert client.withdraw_repair(TAG, said.id).withdrawn_at
    assert client.end_shelving(TAG, shelved.id).withdrawn_at
    with pytest.raises(ServiceError, match="empty_note"):
        client.write_note(TAG)


def test_an_explanation_is_asked_for_and_its_answer_read(client, backend, upload):
    asked = client.ask_explanation(TAG, end="2026-01-01T00:05:00Z", model={"gain": 1.0, "time_constants_s": [5]})
    assert (asked.state, asked.ended, asked.loop, asked.simulation) == ("open", False, TAG, "model")
    (listed,) = client.explanations(TAG)
    assert (listed.id, listed.simulation) == (asked.id, None)
    explain_next(backend, "test")
    done = client.wait(lambda: client.get_explanation(TAG, asked.id), timeout_s=1.0)
    assert (done.state, done.raw["recording"]) == ("done", TAG)
    head, *rows = client.explanation_trace(TAG, asked.id).splitlines()
    assert "PV" in head
    assert len(rows) == 300
    with pytest.raises(ServiceError) as refusal:
        client.explanation_trace(TAG, "77777")
    assert refusal.value.status == 404


def test_groups_are_read():
    sent = {"id": "1", "period_s": 60.0, "source": "FIC1", "members": [{"loop": "FIC1"}], "new": 1}
    with answering(httpx.Response(200, json={"rows": [sent], "next_cursor": None})) as client:
        (group,) = client.groups()
    assert (group.source, group.period_s, group.members, group.raw["new"]) == ("FIC1", 60.0, [{"loop": "FIC1"}], 1)


def test_a_plant_without_groups_has_none(client, upload):
    assert list(client.groups()) == []


def answering(*answers: httpx.Response, asked: list[httpx.Request] | None = None) -> Client:
    left = iter(answers)

    def answer(request: httpx.Request) -> httpx.Response:
        if asked is not None:
            asked.append(request)
        return next(left)

    return Client("http://server", key="la_read_x", tries=3, transport=httpx.MockTransport(answer))


@pytest.mark.parametrize("last", [None, ""])
def test_pages_end_where_no_cursor_is_told(last):
    """An empty one, as a proxy or a mock may make of null, would ask for the first page for ever."""
    pages = [{"rows": [{"loop": "A"}], "next_cursor": "c"}, {"rows": [{"loop": "B"}], "next_cursor": last}]
    with answering(*[httpx.Response(200, json=page) for page in pages]) as client:
        assert [row.loop for row in client.reliability()] == ["A", "B"]


def test_pages_are_followed_and_the_key_is_in_the_header():
    asked: list[httpx.Request] = []
    pages = [{"rows": [{"loop": "A"}], "next_cursor": "c"}, {"rows": [{"loop": "B", "new": 1}], "next_cursor": None}]
    with answering(*(httpx.Response(200, json=page) for page in pages), asked=asked) as client:
        rows = list(client.reliability(verdict="stiction", unit=None))
    assert [row.loop for row in rows] == ["A", "B"]
    assert (rows[1].raw["new"], rows[0].health) == (1, None)
    assert [request.url.params.get("cursor") for request in asked] == [None, "c"]
    assert {request.headers["Authorization"] for request in asked} == {"Bearer la_read_x"}
    assert all("la_read_x" not in str(request.url) and "unit" not in request.url.params for request in asked)


def test_a_busy_service_is_asked_again_with_the_whole_body(tmp_path):
    file = tmp_path / "a.csv"
    file.write_bytes(b"time,PV,OP\n" * 10)
    bodies = []

    def answer(request: httpx.Request) -> httpx.Response:
        bodies.append(request.read())
        busy = len(bodies) == 1
        return httpx.Response(503, headers={"Retry-After": "0"}) if busy else httpx.Response(202, json={"id": "7"})

    told: list[int] = []
    with Client("http://server", transport=httpx.MockTransport(answer)) as client:
        assert client.upload(file, sent=told.append).id == "7"
    assert bodies == [file.read_bytes()] * 2
    assert sum(told) == 2 * len(file.read_bytes())


def test_a_service_that_stays_busy_is_told_as_such():
    busy = [httpx.Response(429, headers={"Retry-After": "0"}, json={"code": "slow_down", "detail": "d"})] * 3
    with answering(*busy) as client, pytest.raises(ServiceError, match="slow_down"):
        client.loop("A")


@pytest.mark.parametrize("error", [httpx.ConnectError("refused"), httpx.ReadTimeout(""), httpx.ReadError("gone")])
def test_a_service_that_is_not_there_is_told_with_its_address(error):
    def dead(request: httpx.Request) -> httpx.Response:
        raise error

    with (
        Client("http://me:hidden@server:8000/", transport=httpx.MockTransport(dead)) as client,
        pytest.raises(NoServiceError, match="http://server:8000 does not answer") as refusal,
    ):
        client.loop("A")
    assert isinstance(refusal.value, ServiceError)
    assert (refusal.value.status, refusal.value.code) == (0, "no_service")
    assert type(error).__name__ in str(refusal.value)
    assert "hidden" not in str(refusal.value)


def test_what_a_proxy_says_is_an_error_too():
    with answering(httpx.Response(502, text="<html>")) as client, pytest.raises(ServiceError) as refusal:
        client.loop("A")
    assert (refusal.value.status, refusal.value.code) == (502, "no_problem_details")


@pytest.mark.parametrize(
    "ask",
    [
        lambda client: client.loop("A"),
        lambda client: list(client.loops()),
        lambda client: next(client.groups()),
        lambda client: client.start_audit(),
        lambda client: client.write_note("A", "b"),
        lambda client: client.explanation_trace("A", "1"),
    ],
)
@pytest.mark.parametrize(
    ("answer", "got"),
    [
        (httpx.Response(200, html="<!doctype html>"), "text/html; charset=utf-8"),
        (httpx.Response(200, content=b"\xff"), "no content type"),
        (httpx.Response(200, json=["a"]), "application/json"),
    ],
)
def test_whoever_answers_all_with_200_is_no_service(ask, answer, got):
    with answering(answer) as client, pytest.raises(ServiceError, match=f"does not answer like.* {got}") as refusal:
        ask(client)
    assert (refusal.value.status, refusal.value.code) == (200, "no_problem_details")


def test_a_redirect_does_not_take_the_key_elsewhere():
    asked: list[httpx.Request] = []
    moved = httpx.Response(302, headers={"Location": "http://elsewhere/"})
    with answering(moved, asked=asked) as client, pytest.raises(ServiceError):
        client.loop("A")
    assert len(asked) == 1


def test_an_export_is_sent_with_its_mapping(client, backend, tmp_path):
    export, tags = tmp_path / "m.csv", tmp_path / "tags.json"
    export.write_text("DateTime,TI-7,ZT-7\n2026-01-01T00:00:00Z,1,2\n2026-01-01T00:00:05Z,2,3\n")
    named = {"TI-7": "PV", "ZT-7": "OP"}
    tags.write_text(json.dumps([{"tag": tag, "loop": "TIC7", "signal": signal} for tag, signal in named.items()]))
    sent = client.upload(export, mapping=tags)
    read_upload(backend, int(sent.id), owner="test")
    assert client.get_upload(sent.id).loops == ["TIC7"]
    assert client.upload(export).id != sent.id
