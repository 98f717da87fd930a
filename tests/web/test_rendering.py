"""Pages show what a plant sends as text, never as markup."""

from html.parser import HTMLParser

import pytest

from app.services.audit_line import ReliabilityRow
from app.services.wording import worst_first
from app.web.rendering import figure, first_reasons, page, short_time, tag_in_url

HOSTILE = "<script>alert(1)</script>\"'&/../%2F"


def row(**changes) -> dict:
    values = {name: field.get_default() for name, field in ReliabilityRow.model_fields.items()}
    values |= {"recording": "FIC1", "loop": "FIC1", "samples": 10, "verdict": "stiction", "reliability": "reliable"}
    values |= {
        "stiction_probability": 0.9,
        "engine_version": "1",
        "elapsed_s": 0.1,
        "reasons": "a",
        "reasons_text": "A",
    }
    values |= {"input_fingerprint": "f", "config_fingerprint": "f"}
    return ReliabilityRow(**(values | changes)).model_dump(mode="json")


class Tags(HTMLParser):
    def __init__(self, html: str) -> None:
        super().__init__()
        self.scripts, self.texts, self.links = [], [], []
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        if tag == "script":
            self.scripts.append(dict(attributes))
        if tag == "a":
            self.links.append(dict(attributes)["href"])

    def handle_data(self, data):
        self.texts.append(data)


def plant(rows) -> str:
    return page("plant.html", rows=rows, tiles=[], more=False).body.decode()


def test_hostile_names_stay_text():
    found = Tags(plant([row(loop=HOSTILE, unit=HOSTILE, reasons_text=HOSTILE)]))
    assert found.scripts == [{"src": "/static/plant.js", "defer": None}]
    assert found.texts.count(HOSTILE) == 3
    assert f"/loops/{tag_in_url(HOSTILE)}" in found.links


def test_a_curve_cannot_break_out_of_its_block():
    curve = {"d": ["</script><script>x"], "rmse": [1], "best": 0}
    html = page("loop.html", tag=HOSTILE, row=None, rmse=curve, explanation=None).body.decode()
    sources = [script.get("src") for script in Tags(html).scripts]
    assert sources == [None, "/static/plotly.min.js", "/static/loop.js", "/static/explanation.js"]


def test_an_empty_plant_says_what_to_do():
    assert "loopaudit upload FILE" in plant([])


@pytest.mark.parametrize(("value", "digits", "text"), [(None, 2, "–"), (0.126, 2, "0.13"), (3.0, 0, "3")])
def test_figures(value, digits, text):
    assert figure(value, digits) == text


def test_times_are_short():
    assert short_time("2026-01-31T03:00:00Z") == "2026-01-31 03:00"


def test_the_surest_sticky_valve_comes_first_and_what_is_fine_last():
    rows = [
        row(recording="fine", verdict="no_stiction", stiction_probability=0.1),
        row(recording="dead", verdict="not_auditable", stiction_probability=None),
        row(recording="doubtful", verdict="inconclusive", stiction_probability=0.5),
        row(recording="weak", reliability="not_reliable", stiction_probability=0.99),
        row(recording="b", stiction_probability=0.8),
        row(recording="a", stiction_probability=0.95),
    ]
    assert [line["recording"] for line in worst_first(rows)] == ["a", "b", "weak", "doubtful", "dead", "fine"]


def test_the_table_shows_the_weightiest_reasons_only():
    assert first_reasons("A (0.72). B. C") == "A (0.72). B ..."
    assert first_reasons("A. B") == "A. B"
