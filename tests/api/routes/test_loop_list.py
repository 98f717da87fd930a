"""The plant's loops as one list: out as CSV, changed, and back."""

import csv
import io
import json

import pytest

from app.services.spreadsheet import plain_cell, safe_cell
from app.services.stating.loop_list import MOST_LOOPS
from app.storage import loops
from tests.api.routes.exports import HOSTILE

CSV = {"Content-Type": "text/csv"}
JSON = {"Content-Type": "application/json"}


@pytest.fixture(autouse=True)
def as_it_was(client, plant):
    yield
    for row in client.get("/v1/loops").json()["rows"]:
        told = {name: None for name in row if name not in ("tag", "importance", "samples_to")}
        client.patch("/v1/loops", json={"loops": [{"tag": row["tag"], "importance": 1, **told}]}).raise_for_status()


def listed(client) -> dict[str, dict[str, str]]:
    answer = client.get("/v1/loops", params={"format": "csv"})
    assert answer.headers["content-type"].startswith("text/csv")
    return {row["tag"]: row for row in csv.DictReader(io.StringIO(answer.text.removeprefix("\ufeff"), newline=""))}


def sent(client, text: str | bytes, **headers):
    return client.patch("/v1/loops", content=text if isinstance(text, bytes) else text.encode(), headers=CSV | headers)


def loop(client, tag: str) -> dict:
    return next(row for row in client.get("/v1/loops").json()["rows"] if row["tag"] == tag)


def test_limit_and_cursor_hold_for_the_list_as_csv_too(client, plant):
    """Without a limit it is whole, as it is to be changed and sent back."""
    whole = client.get("/v1/loops", params={"format": "csv"})
    tags = [*listed(client)]
    assert (len(tags), whole.headers["x-next-cursor"]) == (3, "")
    pages, cursor = [], None
    while cursor != "":
        page = client.get("/v1/loops", params={"format": "csv", "limit": 2} | ({"cursor": cursor} if cursor else {}))
        pages.append([row[0] for row in csv.reader(io.StringIO(page.text, newline=""))][1:])
        cursor = page.headers["x-next-cursor"]
    assert pages == [tags[:2], tags[2:]]
    first = client.get("/v1/loops", params={"limit": 2}).json()
    rest = client.get("/v1/loops", params={"format": "csv", "cursor": first["next_cursor"]})
    assert (len(rest.text.splitlines()), rest.headers["x-next-cursor"]) == (2, "")


def test_a_list_as_a_spreadsheet_writes_it_is_set(client):
    text = "Tag;P&ID;Unit;Importance;PV low;PV high;Moves valve\r\nFIC101;12-3;CRUDE;2,5;0;150;no\r\nLIC7;;;4;;;\r\n"
    answer = sent(client, text.encode("utf-16"))
    assert answer.status_code == 200, answer.text
    assert answer.json() == {"changed": 2, "unchanged": 0, "refused": [], "ignored": ["p&id"]}
    flow = loop(client, "FIC101")
    assert (flow["unit"], flow["importance"], flow["pv_high"], flow["moves_valve"]) == ("CRUDE", 2.5, 150.0, False)
    assert (loop(client, "LIC7")["importance"], loop(client, "LIC7")["unit"]) == (4.0, None)
    again = sent(client, text.encode("utf-16")).json()
    assert (again["changed"], again["unchanged"]) == (0, 2)
    sent(client, "tag,unit,importance\nFIC101,,\n")
    assert loop(client, "FIC101") == flow


def test_a_list_may_spell_tags_in_other_letters_as_other_routes_take_them(client):
    lines = [{"tag": "fic101", "unit": "U7"}, {"tag": "lic7", "owner": "crew A"}, {"tag": "nowhere", "unit": "U7"}]
    answer = client.patch("/v1/loops", json={"loops": lines}).json()
    assert (answer["changed"], [one["loop"] for one in answer["refused"]]) == (2, ["nowhere"])
    assert (loop(client, "FIC101")["unit"], loop(client, "LIC7")["owner"]) == ("U7", "crew A")
    assert client.patch("/v1/loops/lic7", json={"owner": None}).json()["owner"] is None


def test_what_is_written_can_be_read_again(client):
    lines = [
        {"tag": HOSTILE, "unit": "=1+1", "description": 'a "wide", deep\nlevel', "pv_low": -1.5e-7, "pv_high": 1 / 3},
        {"tag": "LIC7", "integrating": True, "moves_valve": False, "type": "level"},
    ]
    assert client.patch("/v1/loops", json={"loops": lines}).json()["changed"] == 2
    before = client.get("/v1/loops").json()["rows"]
    assert listed(client)[f"'{HOSTILE}"]["unit"] == "'=1+1"
    text = client.get("/v1/loops", params={"format": "csv"}).content
    client.patch("/v1/loops", json={"loops": [{"tag": row["tag"], "unit": None, "pv_high": None} for row in before]})
    assert sent(client, text).json()["refused"] == []
    assert client.get("/v1/loops").json()["rows"] == before


def test_what_cannot_be_set_is_refused_and_the_rest_is_set(client):
    rows = {
        "FIC101,a,1,": None,
        "FIC101,b,1,": "named_twice",
        "NOWHERE,a,1,": "unknown_loop",
        "LIC7,a,1,,5": "ragged_row",
        f"LIC7,{'x' * 500},,": "bad_value",
        ",a,1,": "no_tag",
    }
    answer = sent(client, "\n".join(["tag,unit,importance,type", *rows]) + "\n")
    assert answer.status_code == 200, answer.text
    told = answer.json()
    assert told["changed"] == 1
    assert sorted(row["code"] for row in told["refused"]) == sorted(code for code in rows.values() if code)
    assert (loop(client, "FIC101")["unit"], loop(client, "LIC7")["unit"]) == ("a", None)


@pytest.mark.parametrize(
    ("row", "code"),
    [
        ("high,flow,0,50", "bad_value"),
        ("-3,flow,0,50", "bad_value"),
        ("2.5,rocket,0,50", "unknown_type"),
        ("2.5,flow,50,0", "bad_span"),
    ],
)
def test_of_a_row_with_a_cell_that_cannot_be_set_the_rest_is_set(client, row, code):
    told = sent(client, f"tag,unit,importance,type,pv_low,pv_high\nLIC7,a,{row}\n").json()
    assert ([one["code"] for one in told["refused"]], told["changed"]) == ([code], 1)
    kept = loop(client, "LIC7")
    assert kept["unit"] == "a"
    for name, value, wrong in (("importance", 2.5, "bad_value"), ("type", "flow", "unknown_type")):
        assert (kept[name] == value) is (code != wrong)
    assert ((kept["pv_low"], kept["pv_high"]) == (0.0, 50.0)) is (code != "bad_span")


def test_json_is_set_loop_by_loop(client):
    told = client.patch("/v1/loops", json={"loops": [{"tag": "LIC7", "unit": "a", "importance": -3}]}).json()
    assert ([one["code"] for one in told["refused"]], told["changed"]) == (["bad_value"], 0)


@pytest.mark.parametrize(
    "text",
    [
        "sep=;\nTag;Importance\nFIC101;2,5\n",
        "\ufeff\n\nTag;note (a, b, c);Importance;\nFIC101;x;2,5;\n;;;\n",
        'tag,"importance","area; line; unit"\r\nFIC101,"2.5",a\r\n , ,\r\n',
        "tag\timportance\rFIC101\t2,5\r\x1a",
    ],
)
def test_lists_as_other_spreadsheets_write_them(client, text):
    answer = sent(client, text)
    assert answer.status_code == 200, answer.text
    assert (answer.json()["changed"], answer.json()["refused"]) == (1, [])
    assert loop(client, "FIC101")["importance"] == 2.5


@pytest.mark.parametrize("number", ['"1,500"', '"1,5"', "1_000", "١٢", "1 000", "0x10", "nan", "1.234.567"])
def test_a_number_that_may_be_another_one_is_refused(client, number):
    told = sent(client, f"tag,pv_low,pv_high\nFIC101,0,{number}\n").json()
    assert [row["code"] for row in told["refused"]] == ["bad_value"]
    assert told["refused"][0]["text"].startswith("row 2: ")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("tag;pv_high\nFIC101;1.000,5\n", "without marks between thousands"),
        ('tag,pv_high\nFIC101,"1.000,5"\n', "without marks between thousands"),
        ('tag,pv_high\nFIC101,"1,000.5"\n', "without marks between thousands"),
        ('tag,pv_high\nFIC101,"1,500"\n', "a comma in it may part thousands"),
        ("tag,pv_high\nFIC101,much\n", "got 'much'"),
        ("tag;pv_low;pv_high\nFIC101;1.500;2500\n", "or with other than three decimals"),
        ("tag;pv_low;pv_high\nFIC101;1,500;2500\n", "or with other than three decimals"),
        ("tag;pv_low;pv_high\nFIC101;0,5;1.500\n", "or with other than three decimals"),
        ("tag;pv_low;pv_high\nFIC101;0.5;1,500\n", "or with other than three decimals"),
    ],
)
def test_a_number_is_refused_with_the_reason_that_holds(client, text, why):
    (refused,) = sent(client, text).json()["refused"]
    assert refused["text"].endswith(why)


@pytest.mark.parametrize(
    ("text", "high"),
    [
        ("tag,pv_low,pv_high\nFIC101,0,1.500\n", 1.5),
        ("tag;pv_low;pv_high\nFIC101;0,5;1,500\n", 1.5),
        ("tag;pv_low;pv_high\nFIC101;0.5;1.500\n", 1.5),
        ("tag;pv_low;pv_high\nFIC101;0;0,125\n", 0.125),
        ("tag;pv_low;pv_high\nFIC101;0;1234,567\n", 1234.567),
    ],
)
def test_three_decimals_are_read_where_the_list_shows_what_its_mark_means(client, text, high):
    assert sent(client, text).json()["refused"] == []
    assert loop(client, "FIC101")["pv_high"] == high


@pytest.mark.parametrize("text", ["loop,importance\nFIC101,4\n", "Loop;note, short;importance\nFIC101;x;4\n"])
def test_a_loop_may_be_named_as_the_table_names_it(client, text):
    assert sent(client, text).json()["changed"] == 1
    assert loop(client, "FIC101")["importance"] == 4


def test_beside_a_tag_a_column_loop_is_none_of_ours(client):
    told = sent(client, "tag,loop,importance\nFIC101,LIC7,5\n").json()
    assert (told["changed"], told["ignored"]) == (1, ["loop"])
    assert loop(client, "FIC101")["importance"] == 5


def test_yes_and_no_are_known_in_other_languages(client):
    assert sent(client, "tag;moves_valve\nFIC101;FALSCH\nLIC7;ja\n").json()["changed"] == 2
    assert (loop(client, "FIC101")["moves_valve"], loop(client, "LIC7")["moves_valve"]) == (False, True)


def test_loops_are_retired_by_the_list(client):
    assert sent(client, "tag,retired\nFIC101,yes\nLIC7,no\n").json()["changed"] == 1
    assert [listed(client)[tag]["retired"] for tag in ("FIC101", "LIC7")] == ["yes", "no"]
    retired = client.get("/v1/loops", params={"format": "csv", "retired": "true"}).text
    assert ("FIC101" in retired, "LIC7" in retired) == (True, False)
    told = client.patch("/v1/loops", json={"loops": [{"tag": "FIC101", "retired": False}]}).json()
    assert (told["changed"], loop(client, "FIC101")["retired"]) == (1, False)


@pytest.mark.parametrize("tag", ["F\x00", "F\ud800"])
def test_a_tag_that_no_data_base_keeps_is_no_loop(client, tag):
    lines = [{"tag": tag, "unit": "a"}, {"tag": "LIC7", "unit": "b"}, {"tag": tag, tag: 1}]
    told = client.patch("/v1/loops", content=json.dumps({"loops": lines}), headers=JSON).json()
    assert ([row["code"] for row in told["refused"]], told["changed"]) == (["bad_value", "unknown_loop"], 1)


def test_types_of_the_plant_are_looked_up_once(client, backend, monkeypatch):
    asked = []
    monkeypatch.setattr(loops, "types", lambda connection: asked.append(1) or ["own"])
    told = sent(client, "tag,type\nFIC101,Flow\nLIC7,own\n").json()
    assert ([row["code"] for row in told["refused"]], told["changed"], len(asked)) == (["unknown_type"], 1, 1)
    monkeypatch.undo()


@pytest.mark.parametrize("text", ["Feed flow; +/- 5 %", "'=x", "''=x", "a;'=b", "'quoted'", "\t=1", "-3", "a\n@b"])
def test_words_come_back_as_they_were(client, text):
    assert plain_cell(safe_cell(text)) == text
    client.patch("/v1/loops", json={"loops": [{"tag": "LIC7", "description": text}]})
    kept = loop(client, "LIC7")["description"]
    told = sent(client, client.get("/v1/loops", params={"format": "csv"}).content).json()
    assert (told["changed"], told["refused"]) == (0, [])
    assert loop(client, "LIC7")["description"] == kept


@pytest.mark.parametrize(
    ("body", "headers", "status", "code"),
    [
        (b"", CSV, 422, "bad_loop_list"),
        (b"tag,unit\n", CSV, 422, "bad_loop_list"),
        (b'sep="\ntag"unit\nFIC101"a\n', CSV, 422, "bad_loop_list"),
        (b"name,unit\nFIC101,a\n", CSV, 422, "bad_loop_list"),
        (b"tag,unit,UNIT\nFIC101,a,\n", CSV, 422, "bad_loop_list"),
        (b"tag,pv low,pv_low\nFIC101,1,2\n", CSV, 422, "bad_loop_list"),
        (b'tag,unit\nFIC101,"a\nLIC7,b\n', CSV, 422, "bad_loop_list"),
        (b"tag,colour\nFIC101,red\n", CSV, 422, "bad_loop_list"),
        (b"\x00\x01\x02\xff\xfe" * 9, CSV, 422, "bad_loop_list"),
        (b"[{", {"Content-Type": "application/json"}, 422, "bad_loop_list"),
        (b'{"loops": [3]}', {"Content-Type": "application/json"}, 422, "bad_loop_list"),
        (b'{"loops": [{"tag": "A", "tag": "B"}]}', {"Content-Type": "application/json"}, 422, "bad_loop_list"),
        (b"[" * 100_000, {"Content-Type": "application/json"}, 422, "bad_loop_list"),
        (b'{"loops": []}', {"Content-Type": "application/xml"}, 415, "media_type"),
        (
            b'{"loops": [' + b",".join([b'{"tag":"A"}'] * 20_001) + b"]}",
            {"Content-Type": "application/json"},
            422,
            "bad_loop_list",
        ),
    ],
)
def test_a_list_that_is_none_is_refused(client, body, headers, status, code):
    answer = client.patch("/v1/loops", content=body, headers=headers)
    assert (answer.status_code, answer.json()["code"]) == (status, code), answer.text[:300]


def test_lines_of_json_are_as_strict_as_one_loop(client):
    lines = [{"tag": "LIC7", "integrating": 1}, {"tag": "LIC7", "colour": "red"}, {"tag": 7}, {"unit": "a"}]
    told = client.patch("/v1/loops", json={"loops": lines}).json()
    assert sorted(row["code"] for row in told["refused"]) == ["bad_value", "bad_value", "no_tag", "no_tag"]
    assert told["changed"] == 0


def test_a_list_of_as_many_loops_as_are_taken_can_be_sent(client):
    named = {"description": "x" * 200, "unit": "CRUDE DISTILLATION", "pv_unit": "kg/h", "pv_low": 0.0, "pv_high": 150.0}
    lines = [{"tag": f"NONE{k}", "importance": 2.5, **named} for k in range(MOST_LOOPS)]
    body = json.dumps({"loops": lines})
    assert len(body) > 6e6
    answer = client.patch("/v1/loops", content=body, headers=JSON)
    assert answer.status_code == 200, answer.text[:300]
    assert len(answer.json()["refused"]) == MOST_LOOPS
    answer = client.patch("/v1/loops", content=body[:-2] + " " * (12 << 20) + "]}", headers=JSON)
    assert (answer.status_code, answer.json()["code"]) == (413, "body_too_large")
