"""Reports as files of their own: they need nothing from elsewhere, and what a plant sends stays text."""

import re
import xml.etree.ElementTree as ET
from datetime import UTC, datetime, timedelta
from html.parser import HTMLParser
from pathlib import Path

import pytest

from app.errors import NotFoundError, RequestError
from app.services.addresses import tag_in_url
from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.axes import ticks
from app.services.backend import Backend
from app.services.explaining.wording import SIMULATION_WORDS
from app.services.moments import UTC_CLOCK
from app.services.plant import loop_sheet
from app.services.plant.groups import plant_groups
from app.services.plant.loop_verdicts import loop_health
from app.services.reports import documents as reports
from app.services.reports.svg import Ends, Line, chart
from app.services.stating.notes import add_note, end_shelving
from app.services.stating.properties import patch_loop
from app.services.telling.next_steps import next_step
from app.storage import loops
from tests.told_groups import group_of
from tests.web.conftest import TAGS

HOSTILE = "=A 1/<script>alert('x')</script>\"&?#%2F"
VOID = {"meta", "link", "br", "input", "hr", "img", "rect", "line", "path", "circle"}


class Document(HTMLParser):
    """Whether every element is closed in its turn, which elements there are, what they fetch, and the texts."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open, self.tags, self.fetched, self.texts = [], set(), [], []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.add(tag)
        self.fetched += [value for name, value in attributes if name in ("src", "href", "srcset", "data", "action")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


@pytest.fixture(scope="module")
def two_nights(web_backend):
    add_note(web_backend, HOSTILE, "<b-evil>looked</b-evil> at it", "WO-1", None, "<i>somebody</i>")
    audit_chunk(web_backend, int(start_audit(web_backend).id), "test")
    return web_backend


def test_a_report_says_what_to_do_next(two_nights):
    text = " ".join(" ".join(Document(of_loop(two_nights)).texts).split())
    assert f"What to do: {next_step(loop_health(two_nights, HOSTILE), UTC_CLOCK)}" in text


def of_loop(backend) -> str:
    return reports.loop_report(backend, HOSTILE)


def of_all(backend) -> str:
    return reports.loop_reports(backend)


def test_reports_of_many_loops_are_those_that_a_filter_leaves(two_nights, client):
    whole = words_of(of_all(two_nights))
    assert f"reports of {len(TAGS)} loops" in whole
    assert all(whole.count(tag) >= 2 for tag in TAGS), "in the list, and over its report"
    assert whole.count("What to do:") == len(TAGS)
    assert whole.count("What the figures mean") == 1
    first = words_of(reports.loop_reports(two_nights, sort="-loop", most=1))
    assert "reports of 1 loop 3 loops. Here are the first 1 ; a narrower filter, by unit or owner," in first
    assert "LIC7" in first
    some = client.get("/v1/reports", params={"search": "fic"})
    assert re.fullmatch(r'attachment; filename="plant-loops-[\d-]+\.html"', some.headers["content-disposition"])
    assert "LIC7" not in some.text
    assert "1 loop: with “fic” in tag, description or owner." in words_of(some.text)
    assert "No loop matches." in client.get("/v1/reports", params={"unit": "elsewhere"}).text
    of_run = words_of(client.get("/v1/reports", params={"audit_id": "1"}).text)
    assert f"{len(TAGS)} loops, as run 1 found them. Each report here is of the loop's newest verdict." in of_run
    assert "found them" not in whole
    assert client.get("/v1/reports", params={"limit": 51}).status_code == 422
    assert client.get("/v1/reports", params={"audit_id": "777"}).status_code == 404
    assert client.get("/v1/reports", params={"sort": "nonsense"}).status_code == 400


@pytest.mark.parametrize("make", [of_loop, reports.plant_report])
def test_a_report_is_whole_needs_nothing_and_runs_nothing(two_nights, make):
    html = make(two_nights)
    found = Document(html)
    assert found.open == []
    assert found.tags.isdisjoint({"script", "iframe", "object", "form", "b-evil", "i"})
    assert found.fetched == ["data:,"]
    assert not re.search(r"https?://|url\(|@import", html)
    assert any(HOSTILE in text for text in found.texts)
    assert len(html) < 400_000


def test_a_loops_report_tells_what_its_page_tells(two_nights):
    texts = " ".join(" ".join(Document(of_loop(two_nights)).texts).split())
    for heading in ("Why", "How large is the stiction", "The record", "PV over OP", "Night by night", "Key figures"):
        assert heading in texts
    assert "<b-evil>looked</b-evil> at it" in texts
    assert "10.1016/S0959-1524(02)00007-0" in texts


@pytest.mark.parametrize("measured", [True, False])
def test_the_sentences_at_the_head_of_a_report_stand_apart(two_nights, monkeypatch, measured):
    known = {"likely_cause": "set_point_following", "health": 98.0}
    row = loop_health(two_nights, "FIC101") | known | ({} if measured else {"stiction_probability": None})
    monkeypatch.setattr(loop_sheet.loop_verdicts, "loop_health", lambda *_, **__: row)
    head = reports.loop_report(two_nights, "FIC101").partition('<p class="verdict">')[2].partition("</p>")[0]
    said = " ".join(re.sub("<[^>]+>", "", head).split())
    assert re.search(r"[;.] [Hh]ealth 98 of 100\. Likely cause[^.]*: follows its set point\.$", said), said
    assert not re.search(r"\. ?[a-z]|\.[A-Z]", re.sub(r"0\.\d+", "", said)), said


def words_of(html: str) -> str:
    return " ".join(" ".join(Document(html).texts).split())


def test_a_report_says_of_its_loop_what_the_page_says_at_its_head(two_nights):
    told = words_of(reports.loop_report(two_nights, "FIC101"))
    assert re.search(r"newest sample 2026-01-01 00:49, \d+ days ago", told)
    until = datetime.now(UTC) + timedelta(days=30)
    note = add_note(two_nights, "FIC101", "<b-evil>spare part", "WO-8", None, "anna", until)
    patch_loop(two_nights, "FIC101", {"moves_valve": False})
    told = words_of(reports.loop_report(two_nights, "FIC101"))
    assert re.search(r"Shelved until [^.]+ \(work order WO-8\)\. By anna on [^:]+:\d\d: <b-evil>spare part", told)
    sticks = loop_health(two_nights, "FIC101")["verdict"] == "stiction"
    assert ("How large is the stiction" in told) is sticks
    patch_loop(two_nights, "FIC101", {"moves_valve": None})
    end_shelving(two_nights, "FIC101", note.id, "anna")


def test_a_report_names_the_tag_that_notes_and_nights_are_of(two_nights):
    patch_loop(two_nights, "LIC7", {"continues": "FIC101"})
    try:
        add_note(two_nights, "LIC7", "goes on")
        assert "Before it got this tag it was FIC101" in words_of(reports.loop_report(two_nights, "LIC7"))
        assert "It continues as LIC7" in words_of(reports.loop_report(two_nights, "FIC101"))
        assert re.search(r"\w FIC101 (yes|look first|look today)", words_of(reports.loop_report(two_nights, "LIC7")))
    finally:
        patch_loop(two_nights, "LIC7", {"continues": None})
        patch_loop(two_nights, "FIC101", {"retired": False})


def test_a_period_that_is_shared_by_chance_is_no_company(two_nights, monkeypatch):
    crowded = group_of("1", 300.0, True, True, 0.84, None, plant_groups(two_nights)[0].members)
    monkeypatch.setattr(loop_sheet, "groups_of", lambda found, tag: [crowded])
    told = words_of(of_loop(two_nights))
    assert "Its period is shared by 2 other loops, probably by chance." in told
    assert "oscillates together" not in told


def test_no_probability_of_a_report_is_told_as_certain(two_nights, monkeypatch):
    effect = {"effect": "valve.stiction", "alternatives": [], "probability": 0.999, "block": "valve", "windows": []}
    effect |= {"condition": "after OP reverses", "parameters": {}, "evidence": []}
    found = {"state": "done", "effects": [effect], "verdict": "missing_physics", "simulation": "own", "fit": None}
    found |= {"closed_loop": None, "evidence": [], "remarks": [], "window_start": "2026-01-01T00:00:00Z"}
    found["window_end"] = "2026-01-01T01:00:00Z"
    found["simulation"] = next(iter(SIMULATION_WORDS))
    monkeypatch.setattr(reports.explanations, "newest", lambda *_: found)
    monkeypatch.setattr(loop_sheet, "contradiction", lambda *_: None)
    monkeypatch.setattr(loop_sheet, "derivative", lambda *_: None)
    html = of_loop(two_nights)
    assert '<td class="number">over 0.99</td><td>valve, after OP reverses' in html


def test_the_routes_send_files_to_keep(client, two_nights):
    answer = client.get(f"/v1/loops/{tag_in_url(HOSTILE)}/report")
    assert answer.headers["content-disposition"].startswith('attachment; filename="A-1-script-alert-x-script-2F-20')
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert client.get("/v1/report").headers["content-disposition"].startswith('attachment; filename="plant-20')
    assert client.get("/v1/loops/nobody/report").status_code == 404


@pytest.fixture
def unaudited(backend) -> Backend:
    """A plant with a loop that nobody has audited."""
    with backend.database.write() as connection:
        loops.ensure(connection, ["NEW1"])
    return backend


def test_what_was_not_audited_has_no_report(unaudited):
    with pytest.raises(NotFoundError):
        reports.plant_report(unaudited)
    with pytest.raises(NotFoundError):
        reports.loop_report(unaudited, "NEW1")


def test_a_chart_is_a_picture_with_its_values_inside():
    ends = Ends(0.0, 2.0, "<a>", "b", "x")
    drawn = chart(
        [0.0, 1.0, 2.0], [Line("<PV>", [1.0, None, 3.0], "#000", dots=True)], ends, title='"PV"', shaded=(-9, 1)
    )
    picture = ET.fromstring(drawn)  # noqa: S314 - our own
    assert picture.get("aria-label") == '"PV"'
    (path,) = picture.iter("path")
    assert path.get("d").count("M") == 2  # a gap breaks the line
    assert len(list(picture.iter("circle"))) == 2
    assert "<a>" in [text.text for text in picture.iter("text")]
    heights = [float(value) for value in re.findall(r"[ML][\d.]+ ([\d.]+)", path.get("d"))]
    assert heights[0] > heights[1]  # greater values stand higher


def test_nothing_to_draw_is_said():
    assert "nothing to show" in chart([0.0], [Line("PV", [None], "#000")], Ends(0, 1, "", ""), title="PV")


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(0.0, 10.0, [0, 5, 10]), (0.2, 0.9, [0.2, 0.4, 0.6, 0.8]), (-1e-3, 1e-3, [-0.001, -0.0005, 0.0, 0.0005, 0.001])],
)
def test_ticks_are_round(low, high, expected):
    assert ticks(low, high) == pytest.approx(expected)


def test_the_command_writes_one(two_nights, web_backend, tmp_path, monkeypatch):
    from typer.testing import CliRunner

    from app.cli.main import cli

    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(web_backend.settings.data_dir))
    file = tmp_path / "report.html"
    assert CliRunner().invoke(cli, ["report", "--loop", "FIC101", "--out", str(file)]).exit_code == 0
    assert "<h1>FIC101" in Path(file).read_text(encoding="utf-8")
    assert CliRunner().invoke(cli, ["report", "--plant"]).output.startswith("<!doctype html>")
    assert isinstance(CliRunner().invoke(cli, ["report"]).exception, RequestError)


def test_a_pv_that_stood_has_no_picture_over_op():
    moving = {"op": [40.0, 41.0, 42.0], "pv": [1.0, 1.0, 2.0], "samples": 3, "shown": 3}
    assert reports._path({"pv_op": moving}) is not None
    for stood in (moving | {"pv": [3.5e-44] * 3}, {**moving, "op": [], "pv": []}, None):
        assert reports._path({"pv_op": stood}) is None
    judged_none = {"pv_op": moving, "judged": None, "window": None}
    assert reports._path_of(judged_none) == "All 3 samples of what was given to the audit."
    assert reports._path_of(judged_none | {"window": ["a", "b"]}) == "All 3 samples of the audited window."


@pytest.mark.parametrize("tag", ["FIC101", "LIC7"])
def test_a_report_draws_a_valve_only_where_its_size_is_stated(client, tag):
    told = client.get(f"/loops/{tag}/charts").json()
    assert told["valve"] is not None
    assert ("valve, estimated" in client.get(f"/v1/loops/{tag}/report").text) is (told["size"] is not None)
