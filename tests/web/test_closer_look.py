"""What is drawn of a loop's record when somebody looks at a part of it: the samples, not lines between extremes."""

import json
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from app.services.plant import charts
from tests.web.conftest import WIDE, Pages
from tests.web.test_browser import settled, silent

pytestmark = pytest.mark.browser

SAMPLES, POINTS = 600, 200
PART = ["2026-01-01 00:10:00", "2026-01-01 00:15:00"]
ZOOM = "([from, to]) => Plotly.relayout('trend', { 'xaxis.range[0]': from, 'xaxis.range[1]': to })"


@pytest.fixture
def thinned(chromium: Pages, client, monkeypatch) -> Iterator[Page]:
    """A loop's page of which the trend cannot show all samples."""
    monkeypatch.setattr(charts, "POINTS", POINTS)
    for page in silent(chromium, str(client.base_url), WIDE):
        settled(page, "/loops/LIC7")
        yield page


def drawn(page: Page, name: str = "OP") -> tuple[list[str], list[float]]:
    found = "(name) => JSON.stringify(document.getElementById('trend').data.filter((one) => one.name === name)[0])"
    trace = json.loads(page.evaluate(found, name))
    return trace["x"], trace["y"]


def test_a_part_of_the_trend_is_drawn_with_all_of_its_samples(thinned: Page):
    assert len(drawn(thinned)[0]) < SAMPLES
    expect(thinned.locator("#trend-note")).to_contain_text(f"of {SAMPLES:,} samples shown")
    thinned.evaluate(ZOOM, PART)
    expect(thinned.locator("#trend")).to_have_attribute("data-zoom", "part")
    times, op = drawn(thinned)
    assert (times[0], times[-1]) == ("2026-01-01T00:09:55.000", "2026-01-01T00:15:05.000")
    assert op == pytest.approx([40 + 5 * ((k % 40) / 20 - 1) for k in range(119, 182)])
    expect(thinned.locator("#trend-note")).to_contain_text("All 63 samples shown")
    seen = thinned.evaluate("document.getElementById('trend').layout.xaxis.range.map(String)")
    assert seen == PART


def test_a_drag_fetches_and_a_double_click_brings_the_whole_back(thinned: Page):
    whole = drawn(thinned)
    plot = thinned.locator("#trend .xy2 .nsewdrag").first
    plot.scroll_into_view_if_needed()
    at = plot.bounding_box()
    with thinned.expect_response(lambda answer: "charts?from=" in answer.url):
        thinned.mouse.move(at["x"] + 0.4 * at["width"], at["y"] + 40)
        thinned.mouse.down()
        thinned.mouse.move(at["x"] + 0.6 * at["width"], at["y"] + 40, steps=8)
        thinned.mouse.up()
    expect(thinned.locator("#trend")).to_have_attribute("data-zoom", "part")
    assert len(drawn(thinned)[0]) == pytest.approx(0.2 * SAMPLES, abs=10)
    plot.dblclick(position={"x": 100, "y": 40})
    expect(thinned.locator("#trend")).to_have_attribute("data-zoom", "whole")
    assert drawn(thinned) == whole
    expect(thinned.locator("#trend-note")).to_contain_text(f"of {SAMPLES:,} samples shown")


def test_of_several_looks_the_last_one_counts(thinned: Page):
    asked: list[str] = []
    thinned.on("request", lambda request: asked.append(request.url) if "charts?" in request.url else None)
    parts = [[f"2026-01-01 00:{minute}", f"2026-01-01 00:{minute + 2}"] for minute in (12, 16, 20)]
    thinned.evaluate(f"(parts) => Promise.all(parts.map({ZOOM}))", parts)
    expect(thinned.locator("#trend")).to_have_attribute("data-zoom", "part")
    assert len(asked) == 1
    assert drawn(thinned)[0][0] == "2026-01-01T00:19:55.000"


def test_a_trend_that_has_all_samples_asks_for_no_more(chromium: Pages, client):
    for page in silent(chromium, str(client.base_url), WIDE):
        settled(page, "/loops/LIC7")
        page.on("request", lambda request: pytest.fail(request.url))
        page.evaluate(ZOOM, PART)
        page.wait_for_timeout(500)
        expect(page.locator("#trend-note")).to_have_text(f"All {SAMPLES:,} samples shown.")
