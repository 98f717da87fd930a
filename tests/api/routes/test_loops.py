"""Loops: listed, changed, their health, trend and history."""

from urllib.parse import quote

import pytest
from sqlalchemy import select

from app.storage import tables
from tests.api.routes.exports import HOSTILE


def test_loops_come_page_by_page_in_the_order_of_their_tags(client, plant):
    tags, cursor = [], None
    while True:
        page = client.get("/v1/loops", params={"limit": 1, **({"cursor": cursor} if cursor else {})}).json()
        tags += [row["tag"] for row in page["rows"]]
        cursor = page["next_cursor"]
        if cursor is None:
            break
    assert tags == sorted(tags)
    assert {"FIC101", "LIC7", HOSTILE} <= set(tags)


@pytest.mark.parametrize("tag", ["FIC101", HOSTILE])
def test_a_loop_is_changed_and_read_back(client, plant, tag):
    url = f"/v1/loops/{quote(tag, safe='')}"
    changed = client.patch(
        url, json={"unit": "CRUDE", "importance": 3, "op_low": 0, "op_high": 100, "integrating": True}
    )
    assert changed.status_code == 200, changed.text
    loop = client.get(url).json()
    assert (loop["tag"], loop["unit"], loop["importance"], loop["op_high"]) == (tag, "CRUDE", 3, 100)
    assert client.patch(url, json={"unit": None}).json()["unit"] is None
    assert client.get(url).json()["importance"] == 3


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"colour": "red"}, 422),
        ({"importance": -1}, 422),
        ({"op_low": 5, "op_high": 5}, 400),
        ({"unit": "x" * 500}, 422),
        ({"unit": "a\x00b"}, 422),
        ({"integrating": 0}, 422),
        ({"moves_valve": "no"}, 422),
        ({"retired": 1}, 422),
        ({"op_high": False}, 422),
        ([], 422),
    ],
)
def test_changes_that_are_refused(client, plant, body, status):
    answer = client.patch("/v1/loops/FIC101", json=body)
    assert answer.status_code == status, answer.text
    assert answer.json()["code"]


def test_a_number_that_is_none_is_refused(client, plant):
    answer = client.patch("/v1/loops/FIC101", content=b'{"pv_low": NaN}', headers={"Content-Type": "application/json"})
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("tag", ["FIC101", HOSTILE])
def test_health_trend_and_history_of_a_loop(client, plant, tag):
    url = f"/v1/loops/{quote(tag, safe='')}"
    health = client.get(f"{url}/health").json()
    assert health["loop"] == tag
    assert health["audit_id"] == plant["id"]
    assert not [name for name, value in health.items() if isinstance(value, dict | list)]
    history = client.get(f"{url}/verdicts").json()
    assert [row["audit_id"] for row in history["rows"]] == [plant["id"]]
    assert history["next_cursor"] is None
    trend = client.get(f"{url}/trend", params={"points": 100}).json()
    assert trend["samples"] == 400
    assert len(trend["time"]) == len(trend["pv"]) == len(trend["op"]) == len(trend["sp"]) <= 120
    part = client.get(f"{url}/trend", params={"start": "2026-01-01T00:10:00Z", "end": "2026-01-01T00:15:00Z"}).json()
    same = client.get(f"{url}/trend", params={"from": "2026-01-01T00:10:00Z", "to": "2026-01-01T00:15:00Z"}).json()
    assert same == part
    assert part["samples"] in (60, 61)
    assert part["time"][0] == "2026-01-01T00:10:00Z"
    again = {"start": "2026-01-01T00:10:00Z", "from": "2026-01-01T00:10:00", "end": "2026-01-01T00:15:00Z"}
    assert client.get(f"{url}/trend", params=again).json() == part


@pytest.mark.parametrize(("name", "other"), [("start", "from"), ("end", "to")])
def test_one_bound_of_a_trend_is_given_once(client, plant, name, other):
    params = {name: "2026-01-01T00:10:00Z", other: "2026-01-01T00:11:00Z"}
    answer = client.get("/v1/loops/FIC101/trend", params=params)
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")
    assert answer.json()["errors"][0]["where"] == f"query.{name}"


def test_a_trend_that_ends_before_it_begins_is_refused(client, plant):
    backwards = {"from": "2026-01-02T00:00:00Z", "to": "2026-01-01T00:00:00Z"}
    answer = client.get("/v1/loops/FIC101/trend", params=backwards)
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")
    assert "begins before it ends" in answer.text
    assert answer.json()["errors"][0]["where"] == "query.from"
    later = client.get("/v1/loops/FIC101/trend", params={"from": "2030-01-01T00:00:00Z"})
    assert (later.status_code, later.json()["samples"]) == (200, 0)


def test_what_is_said_of_a_loop_is_stripped_and_its_type_known(client, plant):
    def patched(**changes):
        return client.patch("/v1/loops/LIC7", json=changes)

    assert patched(unit=" CRUDE ", type="level").json()["unit"] == "CRUDE"
    assert patched(unit="  ").json()["unit"] is None
    refused = patched(type="rocket")
    assert (refused.status_code, refused.json()["code"]) == (400, "unknown_type")
    assert "flow, pressure, level" in refused.json()["detail"]
    assert patched(type=None).json()["type"] is None


def test_what_a_terminal_would_obey_is_not_kept(client, plant):
    said = {"owner": "me\x1b]0;x\x07", "description": "a\x1b[2J\n\tb\x9b\x85c"}
    changed = client.patch("/v1/loops/FIC101", json=said).json()
    assert (changed["owner"], changed["description"]) == ("me]0;x", "a[2J\n\tb\x85c")
    note = {"text": "packing\x1b[31m\nrenewed", "work_order": "\x9b31mWO-1\x7f"}
    written = client.post("/v1/loops/FIC101/notes", json=note).json()
    assert (written["text"], written["work_order"]) == ("packing[31m\nrenewed", "31mWO-1")
    client.patch("/v1/loops/FIC101", json={"owner": None, "description": None})


def test_a_retired_loop_is_listed_and_stands_in_no_table(client, plant):
    def told(path, **params):
        rows = client.get(f"/v1/{path}", params=params).json()["rows"]
        return {row.get("loop") or row["tag"] for row in rows}

    url = "/v1/loops/LIC7"
    all_loops, all_rows = told("loops"), told("reliability")
    before = client.get(url).headers["ETag"]
    assert client.patch(url, json={"retired": True}).json()["retired"] is True
    try:
        assert client.get(url).json()["retired"] is True
        assert client.get(url).headers["ETag"] != before
        assert told("loops") == told("loops", retired="any") == all_loops
        assert told("loops", retired="true") == told("reliability", retired="true") == {"LIC7"}
        assert told("loops", retired="false") == all_loops - {"LIC7"}
        assert told("reliability") == told("reliability", retired="false") == all_rows - {"LIC7"}
        assert told("reliability", retired="any") == told("reliability", audit_id=plant["id"]) == all_rows
        assert "LIC7" not in client.get("/v1/reliability", params={"format": "csv"}).text
        assert client.get("/v1/loops", params={"retired": "perhaps"}).status_code == 422
    finally:
        assert client.patch(url, json={"retired": None}).json()["retired"] is False
    trailed = client.get("/v1/trail", params={"limit": 10}).json()["rows"]
    assert {"action": "loop.change", "subject": url, "outcome": "done"}.items() <= trailed[0].items()


@pytest.fixture
def mapped(plant, backend):
    """A type that no list knows, as the mapping of a plant may give it to FIC101; taken away again."""
    of_fic = tables.loops.update().where(tables.loops.c.tag == "FIC101")
    with backend.database.write() as connection:
        before = connection.scalar(select(tables.loops.c.type).where(tables.loops.c.tag == "FIC101"))
        connection.execute(of_fic.values(type="Durchfluss"))
    yield "Durchfluss"
    with backend.database.write() as connection:
        connection.execute(of_fic.values(type=before))


def test_a_type_that_the_plants_mapping_gave_is_known(client, mapped):
    try:
        assert client.patch("/v1/loops/LIC7", json={"type": mapped}).json()["type"] == mapped
    finally:
        client.patch("/v1/loops/LIC7", json={"type": None})


@pytest.mark.parametrize("start", ["20240301", "0.5", "nan", "1e3"])
def test_a_number_is_no_time(client, start):
    answer = client.get("/v1/loops/FIC101/trend", params={"start": start})
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")
    assert client.post("/v1/loops/FIC101/explanations", json={"from": 20240301}).status_code == 422
