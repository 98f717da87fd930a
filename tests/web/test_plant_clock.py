"""Whoever looks at the pages lives by the plant's clocks: people are told times by them, machines in UTC."""

from collections.abc import Iterator
from datetime import UTC, datetime

import pytest
from playwright.sync_api import expect

from app.main import create_app
from app.services.digests.making import digest_of, run_to_tell
from app.services.digests.telling import as_html, as_text, subject
from app.services.reports.documents import loop_report
from app.services.stating.notes import list_notes
from tests.web.conftest import TAGS, Pages

ZONE = "Asia/Manila"
"""Eight hours ahead of UTC: the record ends at 2026-01-01 00:49 UTC."""
LAST = "2026-01-01 08:49"


@pytest.fixture(scope="module")
def manila(web_backend):
    return web_backend.__class__.open(web_backend.settings.model_copy(update={"time_zone": ZONE}))


@pytest.fixture(scope="module")
def client(serve, manila) -> Iterator:
    with serve(create_app(manila.settings)) as found:
        yield found


def test_pages_tell_times_by_the_plant_s_clock_and_say_by_which(client):
    plant, loop = client.get("/").text, client.get("/loops/FIC101").text
    assert f"Recorded up to {LAST} UTC+08:00" in plant
    assert f"newest sample {LAST}" in loop
    assert f"Times are those of {ZONE}." in plant
    assert f'data-zone="{ZONE}"' in loop
    table = client.get("/table?column=recorded_to").text
    assert f"Recorded until, {ZONE}" in table
    assert table.count(LAST) == len(TAGS)
    for page in (plant, loop, table):
        assert "2026-01-01 00:49" not in page


@pytest.mark.parametrize("path", ["/runs", "/runs/1", "/uploads", "/uploads/1", "/groups", "/loops/LIC7/explanation"])
def test_each_page_has_the_clock(client, path):
    assert client.get(path).status_code == 200


def test_a_page_without_times_names_no_zone(client):
    assert "Times are" not in client.get("/login").text


def test_machines_are_told_utc_all_the_same(client):
    row = client.get("/v1/reliability?format=csv&columns=loop,recorded_to&limit=1").text.splitlines()[1]
    assert row.endswith(",2026-01-01T00:49:55Z")


def test_a_repair_is_written_down_by_the_plant_s_clock(client, manila):
    form = {"text": "packing", "repaired_at": "2026-01-01T08:00"}
    answer = client.post("/loops/LIC7/notes", data=form, headers={"Origin": str(client.base_url).rstrip("/")})
    assert answer.status_code in (200, 303)
    assert list_notes(manila, "LIC7")[0].repaired_at == "2026-01-01T00:00:00Z"
    assert "repaired 2026-01-01 08:00" in client.get("/loops/LIC7").text


def test_a_repair_that_is_still_to_come_is_refused_by_the_plant_s_clock(client):
    form = {"text": "x", "repaired_at": "2999-12-31T23:59"}
    answer = client.post("/loops/LIC7/notes", data=form, headers={"Origin": str(client.base_url).rstrip("/")})
    assert answer.status_code == 400
    assert "2999-12-31 23:59 UTC+08:00 is still to come" in answer.text


def test_digest_and_report_tell_them_too(manila):
    digest = digest_of(manila, run_to_tell(manila))
    begun = datetime.fromisoformat(digest.run.created_at)
    there = manila.clock.told(digest.run.created_at)
    assert there.endswith(" UTC+08:00")
    assert f", {there}:" in as_text(digest)
    assert there in as_html(digest)
    assert subject(digest).endswith(f"({manila.clock.date(begun)})")
    report = loop_report(manila, "FIC101")
    assert f"All times are those of {ZONE}." in report
    assert f"{LAST} UTC+08:00" in report


def test_charts_are_drawn_by_the_plant_s_clock(chromium: Pages, client):
    page = chromium.open(str(client.base_url))
    try:
        page.goto("/loops/FIC101")
        expect(page.locator("#charts")).to_have_attribute("data-drawn", "yes")
        drawn = page.evaluate("""() => {
          const chart = document.getElementById("trend");
          return [chart.data[0].x.at(-1), chart.layout.xaxis.title.text, chart.layout.shapes[0].x1];
        }""")
    finally:
        page.close()
    assert drawn[0].startswith("2026-01-01T08:49:55")
    assert drawn[1] == "time in Asia/Manila, UTC+08:00"
    assert datetime.fromisoformat(drawn[2]) <= datetime(2026, 1, 1, 8, 50, tzinfo=UTC).replace(tzinfo=None)
    assert drawn[2].startswith("2026-01-01T08:")


def test_a_chart_of_a_record_without_a_date_counts_from_its_start_and_says_so(chromium: Pages, client):
    page = chromium.open(str(client.base_url))
    try:
        page.goto("/loops/FIC101")
        told = page.evaluate("""() => {
          const clock = clockAt("1970-01-01T00:27:04Z", "1970-01-01T00:00:00Z");
          const shown = clock.shown("1970-01-01T00:00:00Z");
          return [shown, clock.instant(shown), clock.title];
        }""")
    finally:
        page.close()
    start = "1970-01-01T00:00:00.000"
    assert told == [start, f"{start}Z", "time since a start without a date"]
