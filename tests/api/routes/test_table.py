"""The reliability table: pages, filters, CSV."""

import csv
import io
import re
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from urllib.parse import unquote

import httpx
import pytest
from sqlalchemy.exc import OperationalError

from app.api import reliability
from app.services.plant.reliability import RowFilter
from app.services.telling.asked_wording import asked_words
from app.services.telling.health_classes import BOUNDS
from tests.api.routes.exports import HOSTILE


def test_the_table_has_every_field_of_the_contract(client, plant):
    row = client.get("/v1/reliability").json()["rows"][0]
    wanted = (
        "recording loop samples sampling_interval_s verdict stiction_probability reliability yper_pct yper_raw_pct "
    )
    wanted += "table2_reading hammerstein_d hammerstein_S hammerstein_J hammerstein_na hammerstein_nb hammerstein_nc "
    wanted += "hammerstein_rmse hammerstein_rmse_without_stiction hammerstein_search_space hammerstein_widenings unit "
    wanted += "stiction_band_pct_of_op_range likely_cause engine_version elapsed_s window_start window_end audited_at "
    wanted += "audit_id"
    assert set(wanted.split()) <= set(row)
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?Z", row["audited_at"])


@pytest.mark.parametrize(
    "sort", ["loop", "-loop", "-stiction_probability", "yper_pct", "unit", "-verdict_words", "likely_cause_words"]
)
def test_pages_of_the_table_put_together_are_the_table(client, plant, sort):
    whole = client.get("/v1/reliability", params={"sort": sort}).json()
    assert whole["next_cursor"] is None
    rows, cursor = [], None
    while True:
        params = {"sort": sort, "limit": 1} | ({"cursor": cursor} if cursor else {})
        page = client.get("/v1/reliability", params=params).json()
        rows += page["rows"]
        cursor = page["next_cursor"]
        if cursor is None:
            break
    assert rows == whole["rows"]
    assert len(rows) == 3


def test_loops_are_found_by_what_they_control_and_who_looks_after_them(client, plant):
    def found(path: str, **asked: str) -> list[str]:
        rows = client.get(path, params=asked).json()["rows"]
        return [row["loop" if "loop" in row else "tag"] for row in rows]

    told = {"description": "Rücklauf, reflux of column 4", "owner": "crew A"}
    client.patch("/v1/loops/FIC101", json=told).raise_for_status()
    try:
        for path in ("/v1/reliability", "/v1/loops"):
            for words in ("reflux", "CREW a", "fic101", "RÜCK"):
                assert found(path, search=words) == ["FIC101"]
            assert found(path, search="100%") == []
            assert found(path, owner="crew A") == ["FIC101"]
            assert found(path, owner="crew") == []
        told = client.get("/v1/reliability", params={"columns": "loop,owner", "sort": "owner"}).json()["rows"]
        assert told[0] == {"loop": "FIC101", "owner": "crew A"}
        assert told[1]["owner"] is None
    finally:
        client.patch("/v1/loops/FIC101", json={"description": None, "owner": None}).raise_for_status()


def test_loops_with_and_without_an_open_work_order(client, plant):
    def found(asked: str) -> list[str]:
        return [row["loop"] for row in client.get(f"/v1/reliability?open_order={asked}").json()["rows"]]

    notes = "/v1/loops/LIC7/notes"
    everything = len(client.get("/v1/reliability").json()["rows"])
    assert found("true") == []
    client.post(notes, json={"work_order": "WO-1"}).raise_for_status()
    assert (found("true"), len(found("false"))) == (["LIC7"], everything - 1)
    repair = client.post(notes, json={"repaired_at": "2026-01-02T08:00:00Z"}).json()
    assert found("true") == [], "it has been done"
    client.delete(f"{notes}/{repair['id']}/repair").raise_for_status()
    assert found("true") == ["LIC7"], "it has not"
    client.post(notes, json={"work_order": "WO-1", "repaired_at": "2026-01-02T08:00:00Z"}).raise_for_status()
    assert "LIC7" in found("false")
    assert client.get("/table?open_order=false").text.count("without an open work order") == 1
    assert client.get("/v1/reliability?open_order=perhaps").status_code == 422


def test_loops_by_the_class_of_their_health(client, plant):
    """The treemap counts these classes: whoever sees ten loops below 60 wants to know which."""
    health = {row["loop"]: row["health"] for row in client.get("/v1/reliability").json()["rows"]}
    classes = {
        "low": {loop for loop, value in health.items() if value is not None and value < 60},
        "middle": {loop for loop, value in health.items() if value is not None and 60 <= value < 80},
        "high": {loop for loop, value in health.items() if value is not None and value >= 80},
        "not_evaluated": {loop for loop, value in health.items() if value is None},
    }
    assert any(classes.values())
    for name, loops in classes.items():
        found = client.get(f"/v1/reliability?health_class={name}").json()["rows"]
        assert {row["loop"] for row in found} == loops
        page = client.get(f"/table?health_class={name}").text
        assert set(map(unquote, re.findall(r'<td class="tag"><a href="/loops/([^"]+)"', page))) == loops
        assert f"health_class={name}" in re.search(r'href="([^"]+)">CSV as seen', page)[1]
    assert client.get("/v1/reliability?health_class=80").status_code == 422


@pytest.mark.parametrize(
    ("name", "words"),
    [("low", "below 60"), ("middle", "60 to 80"), ("high", "80 or more"), ("not_evaluated", "not evaluated")],
)
def test_a_class_of_health_is_named_in_words(client, name, words):
    page = client.get(f"/table?health_class={name}").text
    assert f'<option value="{name}" selected>{words}</option>' in page
    assert asked_words(RowFilter(health=BOUNDS[name])) == f"health {words}"


def test_loops_that_name_no_unit(client, plant):
    def found(path: str, asked: str) -> list[str]:
        answer = client.get(f"{path}?no_unit={asked}&format=csv&columns=loop")
        return answer.text.splitlines()[1:]

    client.patch("/v1/loops/LIC7", json={"unit": "U1"}).raise_for_status()
    try:
        assert (len(found("/v1/reliability", "true")), found("/v1/reliability", "false")) == (2, ["LIC7"])
        page = client.get("/table?no_unit=true").text
        assert "<b>2</b> loops: that name no unit" in page
        assert "/v1/reliability?no_unit=true&amp;sort=" in page
        assert '<option value="true" selected>none</option>' in page
    finally:
        client.patch("/v1/loops/LIC7", json={"unit": None}).raise_for_status()


def test_filters(client, plant):
    rows = client.get("/v1/reliability").json()["rows"]
    verdicts = {row["verdict"] for row in rows}
    for verdict in verdicts:
        found = client.get("/v1/reliability", params={"verdict": verdict}).json()["rows"]
        assert [row["loop"] for row in found] == [row["loop"] for row in rows if row["verdict"] == verdict]
    everything = [row["loop"] for row in rows]
    for several in ("stiction,no_stiction", "stiction, no_stiction,inconclusive,not_auditable"):
        wanted = [verdict.strip() for verdict in several.split(",")]
        found = client.get("/v1/reliability", params={"verdict": several}).json()["rows"]
        assert [row["loop"] for row in found] == [row["loop"] for row in rows if row["verdict"] in wanted]
    one_by_one = {"verdict": ["stiction,no_stiction", "inconclusive", "not_auditable"]}
    assert [row["loop"] for row in client.get("/v1/reliability", params=one_by_one).json()["rows"]] == everything
    assert client.get("/v1/reliability", params={"search": "lic"}).json()["rows"][0]["loop"] == "LIC7"
    assert client.get("/v1/reliability", params={"unit": "NOWHERE"}).json() == {"rows": [], "next_cursor": None}
    assert len(client.get("/v1/reliability", params={"audit_id": plant["id"]}).json()["rows"]) == 3
    for unknown in ("none", "99999"):
        for form in ("json", "csv"):
            answer = client.get("/v1/reliability", params={"audit_id": unknown, "format": form})
            assert (answer.status_code, answer.json()["code"]) == (404, "unknown_audit")


def test_the_table_as_csv_opens_safely(client, plant):
    answer = client.get("/v1/reliability", params={"format": "csv"})
    assert answer.headers["content-type"].startswith("text/csv")
    rows = list(csv.DictReader(io.StringIO(answer.text, newline="")))
    assert {row["loop"] for row in rows} == {"FIC101", "LIC7", "'" + HOSTILE}
    numbers = {row["loop"]: row["yper_pct"] for row in client.get("/v1/reliability").json()["rows"]}
    assert {row["loop"].removeprefix("'"): float(row["yper_pct"]) for row in rows} == pytest.approx(numbers)


@pytest.mark.parametrize(
    ("params", "status", "code"),
    [
        ({"limit": 0}, 422, "invalid_request"),
        ({"limit": 20001}, 422, "invalid_request"),
        ({"sort": "colour"}, 400, "bad_sort"),
        ({"sort": "loop; DROP TABLE loops"}, 400, "bad_sort"),
        ({"cursor": "nonsense"}, 400, "bad_cursor"),
        ({"cursor": "A" * 4500}, 400, "bad_cursor"),
        ({"verdict": "perhaps"}, 422, "invalid_request"),
        ({"verdict": "stiction,perhaps"}, 422, "invalid_request"),
        ({"verdict": "stiction,"}, 422, "invalid_request"),
        ({"format": "xml"}, 422, "invalid_request"),
        ({"colour": "red"}, 422, "invalid_request"),
    ],
)
def test_questions_to_the_table_that_are_refused(client, plant, params, status, code):
    answer = client.get("/v1/reliability", params=params)
    assert (answer.status_code, answer.json()["code"]) == (status, code)


def test_the_csv_has_the_columns_that_are_asked_for_in_their_order(client):
    answer = client.get("/v1/reliability?format=csv&columns=verdict,loop,%20verdict&sort=-loop")
    lines = list(csv.reader(io.StringIO(answer.text)))
    assert lines[0] == ["verdict", "loop"]
    assert {line[1] for line in lines[1:]} >= {"FIC101", "LIC7"}
    assert all(len(line) == 2 for line in lines)


def test_all_columns_are_all_that_can_be_asked_for(client, plant):
    client.patch("/v1/loops/FIC101", json={"description": "feed", "importance": 3}).raise_for_status()
    of_csv = client.get("/v1/reliability?format=csv&columns=all&search=FIC101").text
    (told,) = csv.DictReader(io.StringIO(of_csv, newline=""))
    assert (told["description"], told["importance"], told["of_old_record"]) == ("feed", "3.0", "False")
    assert {"type", "priority", "recorded_to"} <= set(told)
    (row,) = client.get("/v1/reliability?columns=all&search=FIC101").json()["rows"]
    assert list(row) == list(told)
    assert row["description"] == "feed"
    assert row["window_samples"] <= row["samples"]


@pytest.mark.parametrize("query", ["format=csv&columns=loop,colour", "format=csv&columns=", "columns=loop,colour"])
def test_columns_that_there_are_not_are_refused(client, query):
    answer = client.get(f"/v1/reliability?{query}")
    assert (answer.status_code, answer.json()["code"]) == (400, "bad_columns")


def test_json_too_has_the_columns_that_are_asked_for_in_their_order(client, plant):
    whole = client.get("/v1/reliability?sort=-loop").json()
    url = "/v1/reliability?columns=verdict,loop,importance,priority&sort=-loop&limit=2"
    answer = client.get(url)
    assert [list(row) for row in answer.json()["rows"]] == [["verdict", "loop", "importance", "priority"]] * 2
    assert [row["loop"] for row in answer.json()["rows"]] == [row["loop"] for row in whole["rows"]][:2]
    assert answer.json()["next_cursor"]
    known = {"If-None-Match": answer.headers["etag"]}
    assert client.get(url, headers=known).status_code == 304
    assert client.get("/v1/reliability?columns=loop&limit=2&sort=-loop", headers=known).status_code == 200


def test_every_order_is_told_and_what_stands_in_no_row(client, plant):
    (told,) = [
        one["description"]
        for one in client.get("/openapi.json").json()["paths"]["/v1/reliability"]["get"]["parameters"]
        if one["name"] == "sort"
    ]
    orders = told.removeprefix("One of ").partition(";")[0].split(", ")
    assert {"loop", "priority", "stiction_probability", "audited_at_ms"} <= set(orders)
    for name in orders:
        assert client.get("/v1/reliability", params={"sort": f"-{name}", "limit": 1}).status_code == 200, name
    absent = set(orders) - set(client.get("/v1/reliability").json()["rows"][0])
    of_loops, by_words = re.search(r"Of these (.*) are the loop's.*; (.*) are orders by the words ", told).groups()
    assert absent == {*of_loops.split(", "), *by_words.split(", ")}


def test_programs_get_texts_as_they_are(client, plant):
    tags = [row["loop"] for row in client.get("/v1/reliability").json()["rows"]]
    assert tags[0].startswith("=")
    guarded, raw = (client.get(f"/v1/reliability?format=csv&columns=loop{more}") for more in ("", "&raw=true"))
    given, as_it_is = (list(csv.DictReader(io.StringIO(answer.text))) for answer in (guarded, raw))
    assert [row["loop"] for row in as_it_is] == tags
    assert [row["loop"] for row in given] == [f"'{tags[0]}", *tags[1:]]
    assert guarded.headers["etag"] != raw.headers["etag"]


@pytest.mark.parametrize(
    "asked", ["format=csv&byte_order_mark=true", "columns=loop,verdict", "audit_id={id}", "format=csv&search=none"]
)
def test_a_whole_table_goes_out_in_parts_and_is_the_same(client, plant, monkeypatch, asked):
    url = f"/v1/reliability?{asked.format(**plant)}&sort=-loop&limit=2"
    whole, made = client.get(url), []
    monkeypatch.setattr(reliability.service, "PART_ROWS", 1)
    part = reliability.service.Reading.part
    monkeypatch.setattr(reliability.service.Reading, "part", lambda *told: made.append(1) or part(*told))
    streamed = client.get(url)
    assert streamed.content == whole.content
    assert [answer.headers["vary"] for answer in (whole, streamed)] == ["Accept-Encoding"] * 2
    same = ("etag", "content-type", "x-next-cursor", "content-disposition")
    assert [streamed.headers.get(name) for name in same] == [whole.headers.get(name) for name in same]
    if "search" not in asked:
        assert ("content-length" in whole.headers, "content-length" in streamed.headers) == (True, False)
        assert len(made) == 2
    assert client.get(url, headers={"If-None-Match": streamed.headers["etag"]}).status_code == 304
    assert client.head(url).status_code == 200


@pytest.mark.parametrize(
    ("name", "told", "usual"),
    [
        ("unit", "area 2", None),
        ("type", "flow", None),
        ("description", "feed", None),
        ("owner", "crew A", None),
        ("importance", 7.0, 1.0),
    ],
)
@pytest.mark.parametrize("asked", ["format=csv&columns=all", "columns=all", "columns=all&audit_id={id}"])
def test_whoever_knows_the_table_is_told_what_a_loop_is_now(client, plant, asked, name, told, usual):
    url = f"/v1/reliability?{asked.format(**plant)}&search=LIC7"
    client.patch("/v1/loops/LIC7", json={name: usual}).raise_for_status()
    known = {"If-None-Match": client.get(url).headers["etag"]}
    assert client.get(url, headers=known).status_code == 304
    client.patch("/v1/loops/LIC7", json={name: told}).raise_for_status()
    try:
        answer = client.get(url, headers=known)
        assert answer.status_code == 200
        (row,) = csv.DictReader(io.StringIO(answer.text)) if "csv" in asked else answer.json()["rows"]
        assert row[name] == (str(told) if "csv" in asked else told)
    finally:
        client.patch("/v1/loops/LIC7", json={name: usual}).raise_for_status()


def test_what_is_wrong_by_the_first_part_is_told_as_it_is(client, plant, monkeypatch):
    def away(*_):
        raise OperationalError("SELECT", {}, Exception("the server is away"))

    monkeypatch.setattr(reliability.service.Reading, "part", away)
    answer = client.get("/v1/reliability?format=csv")
    assert (answer.status_code, answer.json()["code"]) == (503, "database_away")


def test_what_goes_wrong_later_is_no_whole_answer(client, plant, monkeypatch):
    monkeypatch.setattr(reliability.service, "PART_ROWS", 1)
    part, made = reliability.service.Reading.part, []

    def away_later(*told):
        made.append(1)
        if len(made) > 1:
            raise OperationalError("SELECT", {}, Exception("the server is away"))
        return part(*told)

    monkeypatch.setattr(reliability.service.Reading, "part", away_later)
    with pytest.raises(httpx.RemoteProtocolError):
        client.get("/v1/reliability?format=csv")


def test_few_parts_of_whole_tables_are_made_at_a_time(client, plant, monkeypatch):
    inside, most, lock, page = [], [], threading.Lock(), reliability.service.Reading.part

    def counted(*given, **named):
        with lock:
            inside.append(1)
            most.append(len(inside))
        time.sleep(0.1)
        with lock:
            inside.pop()
        return page(*given, **named)

    monkeypatch.setattr(reliability.service.Reading, "part", counted)
    asked = {"format": "csv", "limit": 20_000}
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: client.get("/v1/reliability", params=asked).status_code, range(8)))
    assert set(answers) == {200}
    assert max(most) == reliability.PARTS_AT_ONCE


@pytest.mark.parametrize("number", ["nan", "inf", "-inf"])
def test_a_probability_that_is_no_number_is_refused_as_such(client, number):
    answer = client.get("/v1/reliability", params={"min_probability": number})
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")
    assert answer.json()["detail"] == "query.min_probability: Input should be a finite number"
