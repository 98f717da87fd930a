"""What pages say of loops whose PV came to stand together: once at the head of the plant, and with links on each."""

import pytest
from playwright.sync_api import Page, expect

from app.main import create_app
from app.services.addresses import tag_in_url
from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.warming import warm_up
from app.services.digests.making import digest_of
from app.services.digests.telling import as_html
from tests.services.standing_plant import stored
from tests.web.conftest import HOSTILE, NARROW, Pages, seen
from tests.web.test_browser import silent, width

DOWN = ("FIC1", "FIC2. A", "LIC3", HOSTILE, "PIC5", "TIC6", "TIC7")
FIRST, LAST = "FIC1", "TIC7"


@pytest.fixture(scope="module")
def standing(serve, open_plant):
    """Seven loops of a unit that was shut down within half an hour, and a transmitter that died before."""
    warm_up()
    backend = open_plant()
    at = {tag: 900 + 5 * k for k, tag in enumerate(DOWN)} | {"X1": 400, "R1": None}
    stored(backend, at, {tag: "Unit 3" if tag in DOWN else "Unit 4" for tag in at})
    audit_chunk(backend, int(start_audit(backend).id), "test")
    with serve(create_app(backend.settings)) as client:
        client.backend = backend
        yield client


def today(client) -> str:
    html = client.get("/").text
    assert 'id="today-head"' in html
    return html.split('id="today-head"')[1].split("</section>")[0]


def test_the_plant_lists_them_once_with_links_and_the_other_apart(standing):
    part = today(standing)
    assert part.count("<tr>") == 1 + 2
    said = "PV of 7 loops froze within 30 minutes, all of Unit 3, since 2025-06-16 06:06:"
    assert f"<b>{said}</b> look first at whether their unit is down" in part
    assert [tag for tag in (*DOWN, "X1") if f'href="/loops/{tag_in_url(tag)}"' in part] == [*DOWN[:5], "X1"]
    assert '#stood-with">and 2 more</a>' in part


@pytest.mark.parametrize("tag", [FIRST, LAST, HOSTILE])
def test_each_of_them_says_it_with_links_to_the_others(standing, tag):
    told = seen(standing, f"/loops/{tag_in_url(tag)}")
    text = " ".join(" ".join(told.texts).split())
    assert "PV froze together with other loops; look today, first at what they share" in text
    assert "PV of 6 other loops froze within 30 minutes, all of Unit 3 (" in text
    others = [f"/loops/{tag_in_url(other)}" for other in DOWN if other != tag]
    assert set(others) <= set(told.links)


def test_a_loop_that_stands_alone_says_nothing_of_others(standing):
    html = standing.get("/loops/X1").text
    assert "froze " not in html
    assert "a stuck valve or a dead transmitter; look today" in html


def test_the_report_and_the_digest_tell_of_them_in_one_line(standing):
    told = "PV of 7 loops froze within 30 minutes, all of Unit 3"
    assert standing.get("/v1/report").text.count(told) == 1
    assert as_html(digest_of(standing.backend, "1")).count(told) == 1
    assert "It froze together with" in standing.get(f"/v1/loops/{FIRST}/report").text


def test_the_table_lists_each_of_them_as_it_is(standing):
    rows = standing.get("/v1/reliability?likely_cause=stuck_valve_or_dead_transmitter&limit=50").json()["rows"]
    assert {row["loop"]: row["stood_with"] for row in rows} == {**dict.fromkeys(DOWN, 6), "X1": None}


@pytest.fixture
def narrow(chromium: Pages, standing):
    yield from silent(chromium, str(standing.base_url), NARROW)


@pytest.mark.browser
def test_on_a_telephone_the_entry_leads_to_the_others(narrow: Page):
    narrow.goto("/")
    expect(narrow.get_by_text("PV of 7 loops froze within 30 minutes")).to_be_visible()
    assert width(narrow) <= NARROW["width"]
    narrow.get_by_role("link", name="and 2 more").click()
    expect(narrow.locator("#stood-with")).to_be_in_viewport()
    expect(narrow.locator("#stood-with a")).to_have_count(6)
