"""What the scripts of pages do where something fails on the way: an answer that does not come, a login that ends."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, Route, expect

from app.services.auditing.audits import cancel_audit, start_audit
from app.services.explaining import explanations
from app.services.intake.reading import read_upload
from app.services.intake.uploads import list_uploads
from tests.web.conftest import NARROW, Pages
from tests.web.test_browser import settled

NONE = ([0, None],)
pytestmark = pytest.mark.browser


@pytest.fixture
def opened(chromium: Pages, client) -> Iterator[Page]:
    """Of every answer that fails Chromium itself writes an error to the console."""
    page = chromium.open(str(client.base_url))
    yield page
    page.close()


def csv(tag: str) -> dict[str, object]:
    return {"name": f"{tag}.csv", "mimeType": "text/csv", "buffer": f"time,{tag}.PV,{tag}.OP\n0,1,2\n1,2,3\n".encode()}


def test_the_list_of_uploads_says_by_itself_what_became_of_them(opened: Page, client, web_backend):
    """Who sends several files is led there, and saw for good that they wait to be read."""
    number = client.post("/v1/uploads?filename=nothing.csv", content=b"not a table").json()["id"]
    opened.goto("/uploads")
    state = opened.locator("#uploads tr", has_text="nothing.csv").locator("td").nth(2)
    expect(state).to_have_text("received, waiting to be read")
    read_upload(web_backend, int(number), "test")
    expect(state).to_contain_text("failed: no column of times with signals beside it was found", timeout=10_000)
    expect(state).to_have_class("refused why")


def asked_until(opened: Page, count: int) -> list[int]:
    """The pauses in which a page has asked, once there are so many: it may not evaluate what a string says."""
    for _ in range(200):
        pauses = opened.evaluate("() => window.pauses")
        if len(pauses) >= count:
            break
        opened.wait_for_timeout(50)
    return pauses


def test_a_list_of_uploads_without_news_is_asked_for_less_and_less_often(opened: Page, client, web_backend):
    """A page that stands open while an upload waits for room asked for it 40,000 times a day."""
    number = client.post("/v1/uploads?filename=rests.csv", content=b"not a table, at rest").json()["id"]
    opened.add_init_script(
        "const wait = window.setTimeout; window.pauses = [];"
        "window.setTimeout = (what, ms) => { window.pauses.push(ms); return wait(what, 50); };"
    )
    opened.goto("/uploads")
    pauses = asked_until(opened, 10)
    assert pauses[0] == 2000
    assert pauses == sorted(pauses)
    assert pauses[-1] == 30_000
    client.post("/v1/uploads?filename=news.csv", content=b"time,L2.PV,L2.OP\n0,1,2\n1,2,3\n")
    assert 2000 in asked_until(opened, len(pauses) + 5)[len(pauses) :], "with news it begins anew"
    read_upload(web_backend, int(number), "test")


def test_a_list_of_uploads_without_news_is_left_alone_and_asked_for_no_more_after_the_login(opened: Page, client):
    """What somebody marked to copy was unmarked every two seconds, and whose login had ended was never told."""
    client.post("/v1/uploads?filename=waits.csv", content=b"time,L1.PV,L1.OP\n0,1,2\n1,2,3\n")
    asked: list[str] = []

    def ended(route: Route) -> None:
        asked.append(route.request.resource_type)
        if asked[-1] == "document" or len(asked) < 3:
            return route.continue_()
        return route.fulfill(status=303, headers={"Location": "/glossary"})  # as to the login

    loaded: list[Page] = []
    opened.on("load", lambda page: loaded.append(page))
    opened.route("**/uploads", ended)
    opened.goto("/uploads")
    opened.evaluate("document.querySelector('#uploads tr').mine = true")
    while len(asked) < 2:
        opened.wait_for_timeout(100)
    opened.wait_for_timeout(500)
    assert opened.evaluate("document.querySelector('#uploads tr').mine") is True
    while len(loaded) < 2:  # a page that is closed amid a navigation may wait for it for good
        opened.wait_for_timeout(100)
    assert asked == ["document", "fetch", "fetch", "document"]  # loaded again, which leads to the login


@pytest.mark.parametrize("size", [None, {"S": 3.0, "low": 2.0, "high": 4.0}])
def test_a_valve_is_drawn_by_itself_only_where_its_size_is_stated(opened: Page, size: dict[str, float] | None):
    """A valve that was cleared was drawn as one that sticks."""

    def sized(route: Route) -> None:
        told = route.fetch().json()
        told["trend"]["valve"], told["valve"] = told["trend"]["op"], {"S": 3.0, "J": 1.0}
        route.fulfill(json=told | {"size": size})

    opened.route("**/loops/LIC7/charts*", sized)
    opened.goto("/loops/LIC7")
    opened.locator("#charts").scroll_into_view_if_needed()
    expect(opened.locator("#charts")).to_have_attribute("data-drawn", "yes")
    drawn = opened.evaluate(
        "document.getElementById('trend').data.find((one) => one.name === 'valve, estimated').visible"
    )
    assert (drawn != "legendonly") is (size is not None)
    said = "drawn with the size S above" if size else "which are assumed, not measured"
    expect(opened.locator("#valve-note")).to_contain_text(said)


def test_an_upload_is_waited_for_though_an_answer_was_lost(opened: Page, client, web_backend):
    number = client.post("/v1/uploads?filename=lost.csv", content=b"time,L1.PV,L1.OP\n0,1,2\n1,2,3\n").json()["id"]
    asked = []

    def lost_at_first(route):
        asked.append(route.request.url)
        route.abort() if len(asked) == 1 else route.continue_()

    opened.route(f"**/v1/uploads/{number}", lost_at_first)
    opened.goto(f"/uploads/{number}")
    expect(opened.locator("#upload")).to_have_attribute("data-state", "received")
    while len(asked) < 2:
        opened.wait_for_timeout(100)
    read_upload(web_backend, int(number), "test")
    expect(opened.locator("#upload")).to_have_attribute("data-state", "done")


def test_all_files_that_are_dropped_are_sent(opened: Page, web_backend):
    opened.goto("/uploads")
    opened.get_by_label("Drop a historian export").set_input_files([csv("D1"), csv("D2"), csv("D3")])
    with opened.expect_navigation(url=re.compile("/uploads$")):
        opened.get_by_role("button", name="Send").click()
    assert {"D1.csv", "D2.csv", "D3.csv"} <= {upload.filename for upload in list_uploads(web_backend).rows}


def test_of_some_files_those_are_named_that_were_not_taken(opened: Page, web_backend):
    opened.goto("/uploads")
    opened.get_by_label("Drop a historian export").set_input_files([csv("E1"), {**csv("E2"), "buffer": b""}, csv("E3")])
    opened.get_by_role("button", name="Send").click()
    expect(opened.locator("#sending")).to_contain_text("2 of 3 files were taken. E2.csv: not taken: ")


def test_lines_that_were_typed_into_a_mapping_stay_when_a_row_is_changed(opened: Page):
    opened.goto("/uploads/1")
    text, loop = opened.locator("#mapping-text"), opened.get_by_label("Loop of FIC101.PV")
    text.fill("tag,loop,signal\nOTHER.X,O1,PV\nFIC101.PV,OLD,PV")
    loop.fill("NEW")
    expect(text).to_have_value("tag,loop,signal\nOTHER.X,O1,PV\nFIC101.PV,NEW,PV\n")
    opened.get_by_label("Signal of LIC7.OP").select_option("SP")
    loop.fill("N,$&2")
    expect(text).to_have_value('tag,loop,signal\nOTHER.X,O1,PV\nFIC101.PV,"N,$&2",PV\nLIC7.OP,LIC7,SP\n')
    loop.fill("FIC101")
    expect(text).to_have_value("tag,loop,signal\nOTHER.X,O1,PV\nLIC7.OP,LIC7,SP\n")


def test_a_long_tag_is_shortened_in_the_treemap_to_what_can_be_read(opened: Page):
    tag = "AREA_0001_REFINERY_NORTH_FLOW_CONTROLLER_0000133"
    told = {
        "units": [["U1", 2, 2.0, 80.0, [[2, 41.0], *NONE, *NONE, *NONE]]],
        "loops": [[tag, "U1", 1.0, "stiction", 41.0], ["FIC1", "U1", 1, "stiction", 41]],
    }
    opened.route("**/plant/tiles", lambda route: route.fulfill(json=told))
    opened.goto("/")
    opened.locator("#treemap").scroll_into_view_if_needed()
    shown = opened.locator("#treemap .slice", has_text="AREA_000…R_0000133").last
    expect(shown).to_be_visible()
    expect(opened.locator("#treemap .slice", has_text="FIC1").last).to_be_visible()
    shown.hover()
    expect(opened.locator("#treemap .hoverlayer")).to_contain_text(tag)


def test_a_tag_is_shortened_between_what_is_read_as_one_letter(opened: Page):
    family, accented = "\U0001f468\u200d\U0001f469\u200d\U0001f467", "e\u0301"
    tags = [family * 20, accented * 18, f"<b>{accented * 30}"]
    units = [["U1", 3, 3.0, 80.0, [[3, 41.0], *NONE, *NONE, *NONE]]]
    told = {"units": units, "loops": [[tag, "U1", 1.0, "stiction", 41.0] for tag in tags]}
    opened.route("**/plant/tiles", lambda route: route.fulfill(json=told))
    opened.goto("/")
    opened.locator("#treemap").scroll_into_view_if_needed()
    for shown in (f"{family * 8}…{family * 9}", accented * 18, f"<b>{accented * 5}…{accented * 9}"):
        expect(opened.locator("#treemap .slice", has_text=shown).last).to_be_visible()


def test_the_treemap_shows_loops_without_a_health_in_grey(opened: Page):
    loops = [
        ["FIC101", "A", 1.0, "not_auditable", None],
        ["LIC7", "A", 1.0, "stiction", 0],
        ["X", "A", 1, "stiction", 50],
    ]
    classes = [[2, 25.0], *NONE, [2, 90.0], [1, None]]
    units = [["A", 5, 5.0, 50.0, classes], ["B", 1, 1.0, None, [*NONE, *NONE, *NONE, [1, None]]]]
    tiles = {"units": units, "loops": loops}
    opened.route("**/plant/tiles*", lambda route: route.fulfill(json=tiles))
    settled(opened, "/")

    def fill(text: str) -> str:
        slice_ = opened.locator("#treemap .slice", has_text=text).last
        return slice_.locator("path.surface").evaluate("part => getComputedStyle(part).fill")

    assert fill("FIC101") == "rgb(135, 148, 163)"
    assert fill("LIC7") == "rgb(179, 38, 30)"
    assert fill("X") not in (fill("FIC101"), fill("LIC7"))
    expect(opened.locator("#treemap .slice", has_text="2 others")).to_contain_text("health 80 or more")


def large_plant(opened: Page) -> list[str]:
    """Three units of 1,000 loops each; the addresses that are asked for of one of them."""
    classes = [[400, 40.0], [200, 71.5], [330, 92.0], [70, None]]
    units = [[f"U{k}", 1000, 1000.0, 85.0, classes] for k in range(3)]
    loops = [[f"FIC{k}{place}", f"U{k}", 1.0, "stiction", 10.0 + place / 10] for k in range(3) for place in range(133)]
    told, asked = {"units": units, "loops": loops}, []

    def one(route: Route):
        asked.append(route.request.url)
        route.fulfill(
            json={"loops": [[f"FIC1{place}", "U1", 1.0, "stiction", 10.0 + place / 10] for place in range(400)]}
        )

    opened.route("**/plant/tiles", lambda route: route.fulfill(json=told))
    opened.route("**/plant/tiles?*", one)
    settled(opened, "/")
    return asked


def test_where_loops_have_no_room_for_names_the_treemap_has_them_by_health_and_the_worst_by_name(opened: Page):
    asked = large_plant(opened)
    slices = opened.locator("#treemap .slice")
    for told in ("^400 loops ?below 60", "^200 loops ?60 to 80", "^330 loops ?80 or more", "^70"):
        expect(slices.filter(has_text=re.compile(told))).to_have_count(3)
    for unit in "012":
        expect(slices.filter(has_text=re.compile(f"^FIC{unit}[012](?![0-9])"))).to_have_count(3)
    expect(slices.filter(has_text="FIC")).to_have_count(9)
    expect(opened.locator("#treemap-sizes")).to_contain_text("number of loops")
    assert asked == []


def test_a_unit_of_a_large_plant_opens_and_closes_again(opened: Page):
    asked = large_plant(opened)
    slices = opened.locator("#treemap .slice")
    slices.filter(has_text=re.compile("^U1")).last.click(position={"x": 8, "y": 8})
    expect(slices.filter(has_text=re.compile(r"^FIC150(?![0-9])"))).to_be_visible()
    expect(slices.filter(has_text="330 others")).to_contain_text("health 80 or more")
    expect(opened.locator("#treemap-sizes")).to_contain_text("importance")
    assert len(asked) == 1
    assert asked[0].endswith("?unit=U1")
    opened.locator("#treemap .pathbar", has_text="Plant").click()
    expect(slices.filter(has_text="330 loops")).to_have_count(3)
    expect(opened.locator("#treemap-sizes")).to_contain_text("number of loops")


def test_a_unit_that_was_closed_opens_again_where_all_loops_have_room(opened: Page):
    units = [["U1", 150, 150.0, 50.0, [[150, 50.0], *NONE, *NONE, *NONE]]]
    loops = [[f"FIC{place}", "U1", 1.0, "stiction", 50.0] for place in range(150)]
    opened.route("**/plant/tiles", lambda route: route.fulfill(json={"units": units, "loops": loops[:100]}))
    opened.route("**/plant/tiles?*", lambda route: route.fulfill(json={"loops": loops}))
    settled(opened, "/")
    others = opened.locator("#treemap .slice", has_text="50 others")
    unit = opened.locator("#treemap .slice", has_text=re.compile("^U1"))
    for _ in range(2):
        expect(others).to_have_count(1)
        unit.last.click(position={"x": 8, "y": 8})
        expect(others).to_have_count(0)
        opened.locator("#treemap .pathbar", has_text="Plant").click()
    expect(others).to_have_count(1)


def test_on_a_telephone_the_treemap_is_high_enough_for_a_name_of_each_unit_and_has_no_scale_beside_it(opened: Page):
    opened.set_viewport_size(NARROW)
    large_plant(opened)
    expect(opened.locator("#treemap .slice", has_text="FIC")).to_have_count(9)
    plot = opened.locator("#treemap .treemaplayer").bounding_box()
    assert plot["width"] > 280


def test_a_run_is_watched_on_after_a_refused_stream(opened: Page, web_backend):
    run = start_audit(web_backend)
    refused = []

    def refused_at_first(route):
        refused.append(route.request.url)
        route.fulfill(status=503, body="") if len(refused) == 1 else route.continue_()

    opened.route("**/events", refused_at_first)
    opened.goto(f"/runs/{run.id}")
    while len(refused) < 2:
        opened.wait_for_timeout(200)
    cancel_audit(web_backend, run.id)
    expect(opened.locator("#run")).to_have_attribute("data-ended", "yes")


OPEN = {
    "id": "7",
    "loop": "LIC7",
    "state": "open",
    "asked_at": "2026-01-01T00:00:00Z",
    "located": None,
    "waits_for_room_since": None,
}


def test_a_part_that_has_not_changed_keeps_the_keyboard_and_a_login_is_no_part(opened: Page, monkeypatch):
    monkeypatch.setattr(explanations, "newest", lambda *_: OPEN | {"effects": [], "verdict": None})
    monkeypatch.setattr("app.web.explanation.in_words", lambda found, clock: found)
    monkeypatch.setattr("app.services.plant.loop_sheet.contradiction", lambda *_: None)
    monkeypatch.setattr("app.services.plant.loop_sheet.derivative", lambda *_: None)
    asked = []

    def answered(route):
        asked.append(route.request.url)
        if len(asked) < 3:
            route.continue_()
        else:
            route.fulfill(status=303, headers={"Location": "/glossary"})  # as to the login

    opened.route("**/explanation", answered)
    opened.goto("/loops/LIC7")
    opened.locator("#explanation a", has_text="JSON").focus()
    while len(asked) < 3:
        assert opened.evaluate("document.activeElement.textContent") == "JSON"
        opened.wait_for_timeout(200)
    expect(opened.locator("#explanation [role=alert]")).to_contain_text("Your login has ended")
    assert opened.locator("header").count() == 1
    opened.wait_for_timeout(2500)
    assert len(asked) == 3
