"""The pages as people meet them: in Chromium, by mouse and by keyboard, on narrow screens, and by the rules of axe."""

import re
from collections.abc import Iterator

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, ViewportSize, expect

from app.services.auditing.audits import LoopFilter, list_audits, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.intake.reading import read_upload
from app.services.intake.uploads import receive
from app.services.plant import overview as plant
from app.services.rendering import figure
from tests.web.conftest import HOSTILE_PAGE, NARROW, PAGES, PATIENCE_MS, WIDE, Pages, wide

pytestmark = pytest.mark.browser

SERIOUS = ("serious", "critical")
expect.set_options(timeout=PATIENCE_MS)


@pytest.fixture(scope="module")
def refused_page(web_backend) -> str:
    """The page of a loop that was in manual and cannot be judged."""
    head, *rows = wide("HAND9").decode().splitlines()
    with receive(web_backend, filename="hand.csv") as receiving:
        receiving.write("\n".join([f"{head},HAND9.MODE", *(f"{row},MAN" for row in rows)]).encode())
        receipt = receiving.commit()
    read_upload(web_backend, int(receipt.upload.id), "test")
    audit_chunk(web_backend, int(start_audit(web_backend, LoopFilter(tags=("HAND9",))).id), "test")
    return "/loops/HAND9"


@pytest.fixture
def opened(chromium: Pages, client) -> Iterator[Page]:
    yield from silent(chromium, str(client.base_url), WIDE)


@pytest.fixture
def narrow(chromium: Pages, client) -> Iterator[Page]:
    """A page that is as narrow as a telephone from the start: what is drawn there is not what a shrunk page shows."""
    yield from silent(chromium, str(client.base_url), NARROW)


def silent(chromium: Pages, address: str, size: ViewportSize) -> Iterator[Page]:
    """A page whose console stays silent: no error of a script, nothing refused by the content policy."""
    page = chromium.open(address, size)
    told: list[str] = []
    page.on("console", lambda message: told.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: told.append(str(error)))
    page.on("request", lambda asked: told.append(asked.url) if not asked.url.startswith(address) else None)
    yield page
    page.close()
    assert told == []


def serious(page: Page) -> list[str]:
    found = Axe().run(page).response["violations"]
    return [f"{v['id']}: {v['nodes'][0]['html'][:200]}" for v in found if v["impact"] in SERIOUS]


def settled(page: Page, path: str) -> None:
    page.goto(path)
    for drawn in ("#treemap", "#charts"):
        if page.locator(drawn).count():
            page.locator(drawn).scroll_into_view_if_needed()
            expect(page.locator(drawn)).to_have_attribute("data-drawn", "yes")


def test_from_the_plant_to_the_worst_loop_and_its_charts(opened: Page):
    settled(opened, "/")
    worst = opened.locator("section:has(#worst-head) tbody a").first
    tag = worst.inner_text()
    worst.click()
    expect(opened.get_by_role("heading", level=1)).to_have_text(tag)
    expect(opened.locator("#charts")).to_have_attribute("data-drawn", "yes")
    for chart in ("trend", "pv-op", "errors"):
        expect(opened.locator(f"#{chart} .main-svg").first).to_be_visible()


@pytest.mark.parametrize("path", ["/", "/loops/LIC7"])
def test_no_chart_offers_to_send_what_it_shows_to_a_cloud(opened: Page, path: str):
    settled(opened, path)
    offered = opened.locator(".modebar-btn").evaluate_all("all => all.map(one => one.getAttribute('aria-label'))")
    assert "Download plot as a PNG" in offered
    assert not [name for name in offered if "hare" in name or "loud" in name]


def test_what_is_folded_is_drawn_at_its_width_once_it_opens_and_for_print(opened: Page):
    settled(opened, "/loops/LIC7")
    expect(opened.locator("#spectra .main-svg").first).to_be_hidden()
    opened.locator("#published > summary").click()
    expect(opened.locator("#spectra .main-svg").first).to_be_visible()
    inner = opened.locator("#published").bounding_box()
    opened.wait_for_function("document.querySelector('#spectra .main-svg').getBoundingClientRect().width > 700")
    assert box(opened, "#spectra .main-svg")["width"] <= inner["width"]
    opened.locator("#published > summary").click()
    opened.evaluate("dispatchEvent(new Event('beforeprint'))")
    expect(opened.locator("#spectra .main-svg").first).to_be_visible()
    opened.evaluate("dispatchEvent(new Event('afterprint'))")
    expect(opened.locator("#spectra .main-svg").first).to_be_hidden()


def test_a_record_of_days_opens_at_the_stretch_that_speaks_for_it(opened: Page):
    """The charts of a longer record are made of those of a short one: the same samples, further apart."""

    def stretched(route):
        told = route.fetch().json()
        trend = told["trend"]
        count = len(trend["time"])
        trend["time"] = [
            f"2026-01-{1 + 4 * k // count:02d}T{(96 * k // count) % 24:02d}:{k % 60:02d}:00Z" for k in range(count)
        ]
        told["judged"] = ["2026-01-01T12:00:00Z", "2026-01-01T18:00:00Z"]
        route.fulfill(json=told)

    opened.route("**/loops/LIC7/charts", stretched)
    settled(opened, "/loops/LIC7")
    shown = "document.getElementById('trend').layout.xaxis.range[1].slice(0, 10)"
    opened.wait_for_function(f"{shown} === '2026-01-01'")
    opened.get_by_role("button", name="Show the whole record").click()
    opened.wait_for_function(f"{shown} === '2026-01-04'")
    opened.get_by_role("button", name="Show the stretch that speaks for the record").click()
    opened.wait_for_function(f"{shown} === '2026-01-01'")


def test_a_click_in_the_treemap_opens_the_loop(opened: Page):
    settled(opened, "/")
    opened.locator("#treemap .slice", has_text="FIC101").first.click()
    expect(opened.get_by_role("heading", level=1)).to_have_text("FIC101")
    expect(opened.locator("#charts")).to_have_attribute("data-drawn", "yes")


CONTRAST = """() => {
  const light = (colour) => {
    const [red, green, blue] = colour.match(/[0-9.]+/g).slice(0, 3).map((part) => part / 255)
      .map((part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4));
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
  };
  return [...document.querySelectorAll("#treemap .slice")].map((slice) => {
    const fill = (part) => light(getComputedStyle(slice.querySelector(part)).fill);
    const [ground, ink] = [fill("path.surface"), fill("text")];
    return (Math.max(ground, ink) + 0.05) / (Math.min(ground, ink) + 0.05);
  });
}"""


def test_words_in_the_treemap_stand_out(opened: Page):
    healths = [0, 19, 21, 45, 60, 80, 100]
    classes = [
        [[0, None]] * place + [[1, health]] + [[0, None]] * (3 - place)
        for place, health in zip((0, 0, 0, 0, 1, 2, 2), healths, strict=True)
    ]
    units = [[f"U{health}", 1, 1.0, health, of_unit] for health, of_unit in zip(healths, classes, strict=True)]
    loops = [[f"FIC{health}", f"U{health}", 1.0, "stiction", health] for health in healths]
    opened.route("**/plant/tiles*", lambda route: route.fulfill(json={"units": units, "loops": loops}))
    settled(opened, "/")
    contrasts = opened.evaluate(CONTRAST)
    assert len(contrasts) >= len(units) + len(loops)
    assert min(contrasts) >= 4.5


def test_the_treemap_rounds_health_as_the_tables_do(opened: Page):
    settled(opened, "/")
    healths = [0.5, 1.5, 38.49, 38.5, 38.51, 39.5, 99.96, 100.0]
    assert opened.evaluate("(healths) => healths.map(known)", healths) == [figure(health, 0) for health in healths]


def test_of_a_large_unit_the_worst_are_drawn_and_the_others_lead_to_the_table(opened: Page, monkeypatch):
    monkeypatch.setattr(plant, "MOST_TILES", 1)
    monkeypatch.setattr(plant, "LEAST_TILES", 1)
    settled(opened, "/")
    opened.locator("#treemap .slice", has_text="no unit named").first.click(position={"x": 5, "y": 5})
    opened.locator("#treemap .slice", has_text="others").last.click()
    expect(opened.get_by_role("heading", level=1)).to_contain_text("Reliability")
    expect(opened.locator("#counted")).to_contain_text("that name no unit")
    assert "health_class=middle" in opened.url


def test_a_class_of_health_in_the_treemap_leads_to_its_loops_in_the_table(opened: Page):
    classes = [[900, 41.0], [900, 70.0], [900, 91.0], [900, None]]
    told = {"units": [["U1", 3600, 3600.0, 60.0, classes], ["U2", 3600, 3600.0, 60.0, classes]], "loops": []}
    opened.route("**/plant/tiles*", lambda route: route.fulfill(json=told))
    settled(opened, "/")
    opened.locator("#treemap .slice", has_text="below 60").first.click()
    expect(opened.locator("#health-class")).to_have_value("low")
    assert opened.url.endswith("/table?unit=U1&health_class=low")


@pytest.mark.parametrize("path", ["/uploads", "/uploads/1"])
def test_tables_of_uploads_stand_on_a_narrow_screen_whole(narrow: Page, path: str):
    settled(narrow, path)
    inner = "part => part.scrollWidth <= part.clientWidth"
    assert narrow.locator("[role=group] > table").evaluate_all(f"parts => parts.every({inner})")


@pytest.mark.parametrize("path", PAGES)
def test_axe_finds_nothing_serious_and_narrow_screens_need_no_sideways_scrolling(opened: Page, path: str):
    settled(opened, path)
    assert serious(opened) == []
    opened.emulate_media(color_scheme="dark")
    assert serious(opened) == []
    opened.set_viewport_size(NARROW)
    for _ in range(50):  # charts follow the width of the window after a moment
        if opened.evaluate("document.documentElement.scrollWidth") <= 360:
            break
        opened.wait_for_timeout(100)
    assert opened.evaluate("document.documentElement.scrollWidth") <= 360


@pytest.mark.parametrize("path", PAGES)
def test_a_page_that_is_opened_on_a_narrow_screen_fits_it(narrow: Page, path: str):
    settled(narrow, path)
    assert width(narrow) <= NARROW["width"]
    narrow.evaluate("document.querySelectorAll('details').forEach((part) => { part.open = true; })")
    assert width(narrow) <= NARROW["width"]


@pytest.mark.parametrize("path", ["/table", "/"])
def test_a_loop_and_why_it_is_accused_stand_on_a_narrow_screen_whole(narrow: Page, path: str):
    settled(narrow, path)
    row = narrow.locator(".narrowing tbody tr").first
    for part in ("td.tag", "td.why", ".badge"):
        place = row.locator(part).first.bounding_box()
        assert place["x"] >= 0
        assert place["x"] + place["width"] <= NARROW["width"]
    label = row.locator("[data-label='Health']").evaluate("cell => getComputedStyle(cell, '::before').content")
    assert label.strip('" ') == "Health"


def test_a_table_scrolls_within_itself_beside_its_tags(narrow: Page):
    settled(narrow, "/groups")
    table = narrow.locator(".wide:has(td.tag)").first
    table.evaluate("part => part.scrollTo(400, 0)")
    assert table.evaluate("part => part.scrollLeft") > 0
    tag = table.locator("td.tag").first.bounding_box()
    assert tag["x"] >= 0
    assert tag["x"] + tag["width"] <= NARROW["width"]
    assert width(narrow) <= NARROW["width"]


def test_the_page_of_a_loop_that_cannot_be_judged_fits_a_narrow_screen(narrow: Page, refused_page: str):
    settled(narrow, refused_page)
    expect(narrow.locator(".badge").first).to_have_text("not auditable")
    narrow.evaluate("document.querySelectorAll('details').forEach((part) => { part.open = true; })")
    expect(narrow.locator("main")).to_contain_text("not in automatic")
    assert serious(narrow) == []
    assert width(narrow) <= NARROW["width"]


@pytest.mark.parametrize("size", [NARROW, {"width": 1280, "height": 900}])
def test_nothing_in_the_trend_covers_anything_else(opened: Page, size: ViewportSize):
    opened.set_viewport_size(size)
    settled(opened, "/loops/LIC7")
    drawn = opened.locator("#trend .main-svg").first.bounding_box()
    plots = [box(opened, f"#trend .{name} .nsewdrag") for name in ("xy", "xy2")]
    legend, title = box(opened, "#trend .legend"), box(opened, "#trend .xtitle")
    stamps = [stamp.bounding_box() for stamp in opened.locator("#trend .xtick text").all()]
    assert stamps
    assert not any(overlap(legend, plot) for plot in plots)
    assert not any(overlap(title, stamp) for stamp in stamps)
    assert all(inside(part, drawn) for part in (legend, title, *stamps))


def width(page: Page) -> int:
    return page.evaluate("document.documentElement.scrollWidth")


def box(page: Page, selector: str):
    return page.locator(selector).first.bounding_box()


def overlap(one, other) -> bool:
    """Whether two boxes share more than a pixel's rim."""
    return all(
        min(one[at] + one[size], other[at] + other[size]) - max(one[at], other[at]) > 1.0
        for at, size in (("x", "width"), ("y", "height"))
    )


def inside(one, other) -> bool:
    return all(
        one[at] >= other[at] - 1.0 and one[at] + one[size] <= other[at] + other[size] + 1.0
        for at, size in (("x", "width"), ("y", "height"))
    )


def test_by_keyboard_alone(opened: Page):
    opened.goto("/table")
    opened.keyboard.press("Tab")
    expect(opened.locator(".skip")).to_be_focused()
    opened.keyboard.press("Enter")
    expect(opened).to_have_url(re.compile("#main$"))
    while opened.evaluate("document.activeElement.id") != "search":
        opened.keyboard.press("Tab")
    opened.keyboard.type("fic")
    opened.keyboard.press("Enter")
    expect(opened.locator("#loops tbody tr")).to_have_count(1)
    while opened.evaluate("document.activeElement.textContent") != "FIC101":
        opened.keyboard.press("Tab")
    opened.keyboard.press("Enter")
    expect(opened.get_by_role("heading", level=1)).to_have_text("FIC101")


def test_columns_and_order_are_chosen(opened: Page):
    opened.goto("/table")
    opened.get_by_text("Columns", exact=True).click()
    opened.get_by_label("Yper, %").check()
    opened.get_by_role("checkbox", name="Likely cause").uncheck()
    opened.get_by_role("button", name="Show").click()
    expect(opened.get_by_role("columnheader", name="Yper, %")).to_be_visible()
    expect(opened.get_by_role("columnheader", name="Likely cause")).to_have_count(0)
    opened.get_by_role("link", name="Yper, %").click()
    expect(opened.get_by_role("columnheader", name="Yper, %")).to_have_attribute("aria-sort", "descending")


def test_a_note_is_written(opened: Page):
    opened.goto("/loops/LIC7")
    opened.get_by_role("textbox", name="Note").fill("<b>looked at</b> the packing")
    opened.get_by_role("textbox", name="Work order").fill("WO-7")
    opened.get_by_role("button", name="Save the note").click()
    expect(opened.locator(".said").first).to_have_text("<b>looked at</b> the packing")


def test_a_run_is_watched_while_it_goes_on(opened: Page, web_backend):
    opened.goto("/loops/LIC7")
    opened.get_by_role("button", name="Audit again").click()
    expect(opened.locator("#count")).to_have_text("0 of 1 done")
    audit_chunk(web_backend, int(list_audits(web_backend, 1).rows[0].id), "test")
    expect(opened.locator("#count")).to_have_text("1 of 1 done")
    expect(opened.locator("#state")).to_have_text("done")


def test_a_file_is_sent_read_and_its_tags_mapped_anew(opened: Page, web_backend):
    opened.goto("/uploads")
    body = b"time,NEW1.PV,NEW1.OP,NEW1.X\n0,1,2,3\n1,2,3,bad\n2,3,4,5\n"
    opened.get_by_label("Drop a historian export").set_input_files(
        {"name": "new.csv", "mimeType": "text/csv", "buffer": body}
    )
    opened.get_by_role("button", name="Send").click()
    opened.wait_for_url("**/uploads/*")
    number = int(opened.url.rpartition("/")[2])
    read_upload(web_backend, number, "test")
    opened.get_by_label("Loop of NEW1.X").fill("NEW1")
    opened.get_by_label("Signal of NEW1.X").select_option("SP")
    expect(opened.locator("#mapping-text")).to_have_value("tag,loop,signal\nNEW1.X,NEW1,SP\n")
    opened.get_by_role("button", name="Read the file again").click()
    opened.wait_for_url(lambda url: not url.endswith(f"/{number}"))
    read_upload(web_backend, int(opened.url.rpartition("/")[2]), "test")
    expect(opened.get_by_label("Signal of NEW1.X")).to_have_value("SP")


@pytest.mark.parametrize("path", ["/v1/report", f"/v1{HOSTILE_PAGE}/report"])
def test_a_report_opens_from_disk_without_a_network(chromium: Pages, client, tmp_path, path: str):
    file = tmp_path / "report.html"
    file.write_bytes(client.get(path).content)
    page = chromium.open(size=NARROW)
    page.context.set_offline(True)
    told: list[str] = []
    page.on("console", lambda message: told.append(message.text))
    page.on("pageerror", lambda error: told.append(str(error)))
    page.on("request", lambda asked: told.append(asked.url) if asked.url.startswith("http") else None)
    page.goto(file.as_uri())
    expect(page.get_by_role("heading", level=1)).to_be_visible()
    assert told == []
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    assert serious(page) == []
    page.close()


@pytest.fixture(params=[NARROW, WIDE], ids=["narrow", "wide"])
def refused(request: pytest.FixtureRequest, chromium: Pages, client) -> Iterator[Page]:
    """A page that may be refused: of every answer from 400 on Chromium itself writes an error to the console."""
    page = chromium.open(str(client.base_url), request.param)
    yield page
    page.close()


@pytest.mark.parametrize(
    ("path", "status", "code"),
    [
        ("/nowhere", 404, "no_such_route"),
        ("/loops/nothing", 404, "unknown_loop"),
        ("/table?sort=nonsense", 400, "bad_sort"),
        ("/table?search=" + "x" * 300, 422, "invalid_request"),
    ],
)
def test_axe_finds_nothing_serious_on_an_error_page_and_it_fits(refused: Page, path: str, status: int, code: str):
    answer = refused.goto(path)
    assert answer is not None
    assert answer.status == status
    told_well(refused, code)


def test_axe_finds_nothing_serious_where_a_form_is_refused(refused: Page, client):
    refused.set_content(f'<form method="post" action="{client.base_url}/runs"><button>Send</button></form>')
    with refused.expect_navigation() as sent:
        refused.get_by_role("button").click()
    assert sent.value.status == 403
    told_well(refused, "cross_site")


def told_well(page: Page, code: str) -> None:
    expect(page.locator("main code").first).to_have_text(code)
    for scheme in ("dark", "light"):
        page.emulate_media(color_scheme=scheme)
        assert serious(page) == []
    assert width(page) <= page.viewport_size["width"]
