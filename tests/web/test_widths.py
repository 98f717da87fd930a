"""What stands in a table has room: at the width of a desk and of a telephone."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest
from playwright.sync_api import Page, expect

from app.services.auditing.audits import list_audits
from app.services.auditing.run_figures import RunFigures
from app.services.digests.making import digest_of
from app.services.digests.telling import as_html
from app.services.outward import FailureOut, NightOfUnitOut, NightOut
from app.services.plant.judged import Judged
from app.services.plant.nights import Night as Mark
from app.services.reports import documents
from app.services.stating.notes import add_note
from app.web import pages, runs
from tests.web.conftest import NARROW
from tests.web.test_browser import narrow, opened, settled, width

__all__ = ["narrow", "opened"]

pytestmark = pytest.mark.browser

COLUMNS = (
    "unit", "verdict", "reliability", "health", "stiction_probability", "likely_cause", "reasons_text", "next_step",
    "work_order", "repaired_at",
)  # fmt: skip

UNITS = (
    "HYDROCRACKER-2",
    "REGENERATOR",
    "CRUDE_UNIT_1",
    "ALKYLATION",
    "PLATFORMER",
    "VACUUM_DIST",
    "SULPHUR_REC",
    None,
)
OF_UNITS = [
    NightOut(
        f"2026-03-0{day}", str(day), 14_000, 1_234, 80.0, 1_234, tuple(NightOfUnitOut(unit, 1_234) for unit in UNITS), 0
    )
    for day in range(1, 8)
]


def test_what_to_do_has_room_and_the_last_column_is_seen(opened: Page):
    opened.set_viewport_size({"width": 1400, "height": 900})
    opened.goto("/table?" + "&".join(f"column={name}" for name in COLUMNS))
    assert opened.locator("td.do").first.bounding_box()["width"] > 150
    part = opened.locator(".wide:has(#loops)")
    assert part.evaluate("part => part.scrollWidth <= part.clientWidth")


def test_on_a_telephone_the_tiles_stand_in_two_columns_below_the_first(narrow: Page):
    narrow.goto("/")
    first, *others = (tile.bounding_box() for tile in narrow.locator(".tile").all())
    assert len(others) == 4
    assert {tile["x"] for tile in others[::2]} == {first["x"]}
    assert {tile["x"] for tile in others[1::2]} == {others[1]["x"]}
    assert [tile["width"] for tile in others] == pytest.approx([others[0]["width"]] * 4, abs=0.1)
    assert first["width"] == pytest.approx(others[1]["x"] + others[1]["width"] - first["x"])


def test_on_a_telephone_all_pages_are_named_in_one_line(narrow: Page):
    narrow.goto("/")
    assert len({link.bounding_box()["y"] for link in narrow.locator("header nav a").all()}) == 1


@pytest.mark.parametrize("path", ["/", "/table"])
def test_on_a_telephone_a_valve_is_said_to_stick_once(narrow: Page, path: str):
    narrow.goto(path)
    row = narrow.locator("tr:has(.badge.stiction):has(td.cause)").first
    cause = row.locator("td.cause")
    assert (cause.text_content() or "").strip() == "the valve sticks"
    expect(cause).to_be_hidden()
    narrow.set_viewport_size({"width": 1280, "height": 900})
    expect(cause).to_be_visible()


def test_on_a_telephone_a_cause_that_is_chosen_without_the_verdict_is_seen(narrow: Page):
    narrow.goto("/table?column=likely_cause")
    expect(narrow.locator("td.cause", has_text="the valve sticks").first).to_be_visible()


@pytest.mark.parametrize("width_px", [1280, 360])
def test_the_order_of_the_table_can_be_read_to_its_end(opened: Page, width_px):
    opened.set_viewport_size({"width": width_px, "height": 900})
    opened.goto("/table")
    order = opened.locator("#sort")
    given = order.bounding_box()["width"]
    order.evaluate("select => { select.style.width = select.style.maxWidth = 'max-content'; }")
    assert given >= order.bounding_box()["width"]


def test_what_happened_to_failed_loops_is_read_whole_on_a_narrow_screen(narrow: Page, monkeypatch: pytest.MonkeyPatch):
    shown = runs.run_figures

    def failed(*asked: object) -> RunFigures:
        figures = shown(*asked)
        return replace(figures, run=replace(figures.run, done=0, failed=1_234))

    why = FailureOut("AREA_0001_REFINERY_NORTH_FLOW_CTRL_00133", "memory_limit", "ZeroDivisionError: division by zero")
    monkeypatch.setattr(runs, "run_figures", failed)
    monkeypatch.setattr(runs, "failures", lambda *_: [why])
    narrow.goto("/runs/1")
    part = narrow.get_by_role("group", name="Failed loops")
    assert part.evaluate("part => part.scrollWidth <= part.clientWidth")
    expect(part).to_contain_text("ZeroDivisionError: division by zero")
    expect(narrow.locator("#count")).to_contain_text("1,234 failed")
    expect(narrow.locator("main")).to_contain_text("1,233 more failed")


def test_units_show_their_health_on_a_narrow_screen(narrow: Page):
    settled(narrow, "/")
    health = narrow.locator("section:has(#units-head) td[data-label=Health]").first
    place = health.bounding_box()
    assert place["x"] + place["width"] <= NARROW["width"]
    expect(health.locator("meter")).to_be_visible()


def test_the_bars_of_a_fortnight_leave_room_for_their_dates(opened: Page, monkeypatch: pytest.MonkeyPatch):
    nights = [NightOut(f"2026-03-{day:02d}", str(day), 300, 100 + day, 80.0, 4, (), 0) for day in range(1, 15)]
    monkeypatch.setattr(pages, "course", lambda _: nights)
    for wide, shown in ((360, 7), (700, 14)):
        opened.set_viewport_size({"width": wide, "height": 800})
        opened.goto("/")
        labels = opened.locator(".course span:visible")
        expect(labels).to_have_count(shown)
        assert labels.last.inner_text() == "03-14"
        assert labels.evaluate_all("all => all.every(one => one.scrollWidth <= one.parentElement.clientWidth)")
        assert opened.locator(".course").evaluate("list => list.scrollWidth <= list.clientWidth")


def test_a_label_without_a_value_is_not_shown_on_a_narrow_screen(narrow: Page):
    settled(narrow, "/table?column=unit&column=health")
    cells = narrow.locator("#loops td[data-label=Unit]")
    assert cells.count() == 3
    assert not any(cell.is_visible() for cell in cells.all())
    expect(narrow.locator("#loops td[data-label=Health]").first).to_be_visible()


def test_letters_that_turn_the_line_round_leave_the_figures_beside_a_tag_alone(opened: Page):
    opened.goto("/runs/1")
    place = """() => {
      const list = document.createElement("p"), tag = document.createElement("a"), figure = document.createElement("i");
      tag.href = "/"; tag.textContent = "FIC-1\u202eEVIL"; figure.textContent = "0.15 s";
      list.append(tag, " ", figure); document.querySelector("main").append(list);
      return figure.getBoundingClientRect().left >= tag.getBoundingClientRect().right;
    }"""
    assert opened.evaluate(place)


@pytest.mark.parametrize("wide", [360, 700, 1280])
def test_words_of_the_plant_report_are_not_parted(opened: Page, client, wide: int):
    opened.set_viewport_size({"width": wide, "height": 900})
    opened.set_content(client.get("/v1/report").text)
    assert width(opened) <= wide
    badges = opened.locator("table .badge").all()
    assert badges
    assert all(badge.bounding_box()["height"] < 40 for badge in badges)


@pytest.fixture
def long_words(web_backend) -> str:
    """A loop that is shelved with a work order and a note that have no space."""
    until = datetime.now(UTC) + timedelta(days=2)
    add_note(web_backend, "LIC7", "n" * 4000, "W" * 100, None, "anna", until)
    return "LIC7"


@pytest.mark.parametrize("wide", [420, 1400])
def test_long_words_of_a_note_leave_pages_reports_and_mails_as_wide_as_the_screen(
    opened: Page, client, web_backend, long_words: str, wide: int
):
    opened.set_viewport_size({"width": wide, "height": 900})
    widths = {}
    for path in (f"/loops/{long_words}", "/"):
        settled(opened, path)
        opened.evaluate("document.querySelectorAll('details').forEach(one => { one.open = true })")
        opened.wait_for_function(f"document.documentElement.scrollWidth <= {wide}", timeout=5_000)
        shelved = opened.locator("#shelved .wide")
        if shelved.count():
            widths[path] = shelved.evaluate("part => part.scrollWidth - part.clientWidth") + wide
    number = list_audits(web_backend, 1).rows[0].id
    documents = {
        "plant": client.get("/v1/report").text,
        "loop": client.get(f"/v1/loops/{long_words}/report").text,
        "digest": as_html(digest_of(web_backend, number)).replace("LIC7", "LIC7" + "W" * 100),
    }
    for name, html in documents.items():
        opened.set_content(html)
        opened.evaluate("document.querySelectorAll('details').forEach(one => { one.open = true })")
        widths[name] = width(opened)
    assert max(widths.values()) <= wide, widths


def test_history_and_repairs_fold_on_a_narrow_screen(narrow: Page, web_backend):
    add_note(web_backend, "FIC101", "new packing", "WO-3", datetime.now(UTC) - timedelta(days=1), "anna")
    for path, part in (("/loops/FIC101", "#history-part .wide"), ("/", "section:has(#repairs-head) .wide")):
        settled(narrow, path)
        folded = narrow.locator(part)
        assert folded.evaluate("part => part.scrollWidth <= part.clientWidth")
        expect(folded.locator("td[data-label]:not(:empty)").first).to_be_visible()


@pytest.mark.parametrize("part", ["#rivals .wide", "[aria-label^='Check']"])
def test_what_was_seen_has_the_whole_width_of_a_narrow_screen(narrow: Page, part: str):
    settled(narrow, "/loops/FIC101")
    narrow.evaluate("document.querySelectorAll('details').forEach(one => { one.open = true })")
    table = narrow.locator(part).first
    seen = table.locator("tbody tr").first.locator("td").last
    assert seen.bounding_box()["width"] > 0.85 * table.bounding_box()["width"]


def test_a_point_goes_on_below_its_words_and_not_below_its_mark(narrow: Page):
    settled(narrow, "/loops/FIC101")
    point = narrow.locator(".points li").first
    point.evaluate("point => { point.lastChild.textContent = ' words'.repeat(30); }")
    lefts = "point => { const at = document.createRange(); at.selectNodeContents(point.lastChild);"
    found = point.evaluate(lefts + " return [...at.getClientRects()].map(line => Math.round(line.left)); }")
    assert len(found) > 1
    assert max(found) - min(found) <= 6  # a blank


def test_a_printed_table_has_no_form(opened: Page):
    opened.goto("/table")
    expect(opened.locator("form.tools")).to_be_visible()
    opened.emulate_media(media="print")
    expect(opened.locator("form.tools")).to_be_hidden()
    expect(opened.locator("#loops")).to_be_visible()


def test_a_treemap_that_was_not_scrolled_to_leaves_no_blank_card_on_paper(opened: Page):
    opened.set_viewport_size({"width": 1280, "height": 200})
    opened.goto("/")
    card = opened.locator(".card:has(> #treemap)")
    opened.emulate_media(media="print")
    expect(card).to_be_hidden()
    opened.emulate_media(media="screen")
    card.scroll_into_view_if_needed()
    expect(card.locator(".js-plotly-plot, .main-svg").first).to_be_visible()
    opened.emulate_media(media="print")
    expect(card).to_be_visible()


A4_ACROSS, A4_UPRIGHT = 1047, 680
"""What the margins leave of the paper, in px."""


@pytest.mark.parametrize("path", ["/", "/table?" + "&".join(f"column={name}" for name in COLUMNS), "/nights"])
def test_what_is_printed_fits_the_paper(opened: Page, monkeypatch: pytest.MonkeyPatch, path: str):
    weeks = tuple(Mark(f"2026-03-0{day}", "stiction", "not_reliable") for day in range(1, 8))
    span = Judged("2026-03-07T22:00:00Z", "2026-03-07T23:59:00Z", True)
    monkeypatch.setattr(pages, "nights", lambda _, tags, until=None: dict.fromkeys(tags, weeks))
    monkeypatch.setattr(pages, "judged", lambda _, tags, until=None: dict.fromkeys(tags, span))
    monkeypatch.setattr(pages, "course", lambda _: OF_UNITS)
    opened.set_viewport_size({"width": A4_ACROSS, "height": 740})
    settled(opened, path)
    opened.emulate_media(media="print")
    assert width(opened) <= A4_ACROSS
    assert "landscape" in opened.request.get("/static/loopaudit.css").text()


def test_a_printed_report_fits_the_paper(opened: Page, client, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(documents, "course", lambda _: OF_UNITS)
    opened.set_viewport_size({"width": A4_UPRIGHT, "height": 1000})
    opened.emulate_media(media="print")
    opened.set_content(client.get("/v1/report").text)
    expect(opened.locator("#course th")).to_have_count(13)
    assert width(opened) <= A4_UPRIGHT


def test_a_long_verdict_of_an_explanation_does_not_widen_a_narrow_screen(narrow: Page):
    settled(narrow, "/loops/FIC101")
    words = "physics is missing from the simulation; which one, the record can hardly tell"
    card = narrow.locator("#explanation .card").first
    card.evaluate("(card, words) => { card.innerHTML = `<p><span class='badge'>${words}</span></p>`; }", words)
    assert width(narrow) <= NARROW["width"]


def test_a_chart_is_printed_on_white_from_a_dark_screen_too(opened: Page):
    opened.emulate_media(color_scheme="dark")
    settled(opened, "/loops/LIC7")
    chart = opened.locator("#trend .main-svg").first
    dark = chart.evaluate("svg => getComputedStyle(svg).backgroundColor")
    opened.evaluate("dispatchEvent(new Event('beforeprint'))")
    expect(chart).to_have_css("background-color", "rgb(255, 255, 255)")
    opened.evaluate("dispatchEvent(new Event('afterprint'))")
    expect(chart).to_have_css("background-color", dark)
    assert dark != "rgb(255, 255, 255)"


def test_lines_and_captions_are_printed_for_paper_from_a_dark_screen_too(opened: Page):
    opened.emulate_media(color_scheme="dark")
    settled(opened, "/loops/LIC7")
    grid, caption = opened.locator("#trend .gridlayer path").first, opened.locator("#charts .weak").first
    dark = grid.evaluate("path => getComputedStyle(path).stroke")
    opened.evaluate("dispatchEvent(new Event('beforeprint'))")
    opened.emulate_media(media="print")
    expect(grid).to_have_css("stroke", "rgb(221, 227, 234)")  # pale, as from a light screen
    expect(caption).to_have_css("color", "rgb(86, 99, 114)")
    opened.emulate_media(media="screen")
    opened.evaluate("dispatchEvent(new Event('afterprint'))")
    expect(grid).to_have_css("stroke", dark)
    assert dark == "rgb(52, 64, 77)"
