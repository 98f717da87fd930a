"""What stands in a table has room: at the width of a desk and of a telephone."""

import pytest
from playwright.sync_api import Page, expect

from tests.web.test_browser import NARROW, narrow, opened, settled, width

__all__ = ["narrow", "opened"]

pytestmark = pytest.mark.browser

COLUMNS = (
    "unit", "verdict", "reliability", "health", "stiction_probability", "likely_cause", "reasons_text", "next_step",
    "work_order", "repaired_at",
)  # fmt: skip


def test_what_to_do_has_room_and_the_last_column_is_seen(opened: Page):
    opened.set_viewport_size({"width": 1400, "height": 900})
    opened.goto("/table?" + "&".join(f"column={name}" for name in COLUMNS))
    assert opened.locator("td.do").first.bounding_box()["width"] > 150
    part = opened.locator(".wide:has(#loops)")
    assert part.evaluate("part => part.scrollWidth <= part.clientWidth")


def test_units_show_their_health_on_a_narrow_screen(narrow: Page):
    settled(narrow, "/")
    health = narrow.locator("section:has(#units-head) td[data-label=Health]").first
    place = health.bounding_box()
    assert place["x"] + place["width"] <= NARROW["width"]
    expect(health.locator("meter")).to_be_visible()


@pytest.mark.parametrize("wide", [360, 700, 1280])
def test_words_of_the_plant_report_are_not_parted(opened: Page, client, wide: int):
    opened.set_viewport_size({"width": wide, "height": 900})
    opened.set_content(client.get("/v1/report").text)
    assert width(opened) <= wide
    badges = opened.locator("table .badge").all()
    assert badges
    assert all(badge.bounding_box()["height"] < 40 for badge in badges)
