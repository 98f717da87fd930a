"""The page of the plant: its counts, how old its records are, and the last nights behind a verdict."""

import re
from dataclasses import replace

import pytest

from app.services.auditing.audits import cancel_audit, start_audit
from app.services.outward import NightOfUnitOut
from app.services.outward import NightOut as Course
from app.services.plant import groups
from app.services.plant.changes import Changes
from app.services.plant.judged import Judged, ToManual
from app.services.plant.nights import Night
from app.services.plant.overview import overview
from app.services.plant.plant_sheet import plant_sheet
from app.services.plant.worst import worst
from app.services.results import ChangeView
from app.web import loop as loop_page
from app.web import pages
from tests.web.conftest import HOSTILE, Seen, seen


def test_the_plant_counts_its_loops(client):
    found = seen(client, "/")
    assert "3" in found.texts
    assert any("of 3 loops audited" in text for text in found.texts)
    told = client.get("/plant/tiles").json()
    assert {row[0] for row in told["loops"]} == {"FIC101", "LIC7", HOSTILE}
    assert [unit[1] for unit in told["units"]] == [3]
    assert client.get("/plant/tiles?unit=").json()["loops"] == told["loops"]
    assert client.get("/plant/tiles?unit=elsewhere").json()["loops"] == []


def test_where_no_loop_is_left_for_the_worst_that_is_said_and_no_empty_table_shown(client, monkeypatch):
    assert 'id="no-worst"' not in client.get("/").text
    monkeypatch.setattr(pages, "listed_first", lambda *_: ([], []))
    html = client.get("/").text
    assert "No others: what was judged is listed under other headings of this page." in html
    assert 'aria-label="Worst loops"' not in html


@pytest.mark.parametrize(
    ("room", "stick", "told"),
    [(3, 1_216, "The first 3 are shown; all 1,216 valves that stick are in the table."), (3, 3, ""), (12, 16, "")],
)
def test_the_worst_say_where_the_valves_are_that_they_have_no_room_for(client, monkeypatch, room, stick, told):
    """With room left, the others that stick stand in other lists."""

    def listed(backend, by, *_):
        return [], [row | {"verdict": "stiction"} for row in worst(backend, by)]

    def sheet(backend, reach):
        found = plant_sheet(backend, reach)
        return found | {"seen": replace(found["seen"], verdicts={"stiction": stick})}

    for name, other in (("listed_first", listed), ("plant_sheet", sheet), ("WORST", room)):
        monkeypatch.setattr(pages, name, other)
    more = client.get("/").text.partition('<p id="more-worst"')[2].partition("</p>")[0].partition(">")[2]
    assert re.sub("<[^>]+>", "", more) == told
    assert ('href="/table?verdict=stiction"' in more) == bool(told)


def test_a_plant_says_how_old_its_records_are(client):
    told = next(text for text in seen(client, "/").texts if text.startswith("Recorded up to 2026-01-01 00:49 UTC, "))
    assert told.endswith(" days ago: no newer export has arrived.")
    assert any("newest sample 2026-01-01 00:49, " in text for text in seen(client, "/loops/FIC101").texts)
    one = seen(client, "/table?column=recorded_to&sort=-recorded_to")
    assert "Recorded until, UTC" in one.texts
    assert [text.strip() for text in one.texts].count("2026-01-01 00:49") == 3
    first = client.get("/v1/reliability?format=csv&columns=loop,recorded_to&sort=recorded_to&limit=1")
    assert first.text.splitlines()[1].endswith(",2026-01-01T00:49:55Z")
    second = client.get(
        "/v1/reliability",
        params={"sort": "recorded_to", "limit": 1, "cursor": first.headers["X-Next-Cursor"]},
    ).json()
    assert [row["loop"] for row in second["rows"]] == ["FIC101"]


def test_the_course_of_the_plant_comes_apart_from_its_page(client, monkeypatch):
    assert 'data-url="/plant/course"' in client.get("/").text
    assert "One night so far" in client.get("/plant/course").text
    nights = [
        Course(f"2026-03-0{day}", str(day), 300, sticking, 81.2, 4, (NightOfUnitOut("U1", sticking),), apart)
        for day, sticking, apart in ((1, 0, 0), (2, 12, 0), (3, 1, 1))
    ]
    monkeypatch.setattr(pages, "course", lambda _: nights)
    html = client.get("/plant/course").text
    assert html.count("<li>") == 3
    assert 'aria-label="2026-03-02: 12 valves stick, of 300 loops audited; health 81"' in html
    assert 'aria-label="2026-03-03: 1 valve sticks, and 1 more from old records or from before a repair, of' in html
    assert '<rect width="10" y="0.0" height="100.0"/>' in html
    monkeypatch.setattr(pages, "course", lambda _: [])
    assert "No night so far" in client.get("/plant/course").text


@pytest.mark.parametrize("path", ["/", "/table", "/loops/FIC101"])
def test_the_last_nights_stand_behind_a_verdict(client, monkeypatch, path):
    assert 'class="nights"' not in client.get(path).text  # of one night there is no course
    told = (Night("2026-03-01", "no_stiction", "reliable"), Night("2026-03-02", "stiction", "not_reliable"))
    for module, name in ((pages, "nights"), (loop_page, "nights_of")):
        monkeypatch.setattr(module, name, lambda _, tags, until=None: dict.fromkeys(tags, told))
    html = client.get(path).text
    assert '<span class="no_stiction">–</span><span class="stiction unsure">S</span>' in html
    assert "2026-03-01 no stiction (rely on it); 2026-03-02 valve sticks (look first)" in html


BUTTON = "Audit the whole plant now"


def test_while_a_run_goes_on_its_link_stands_in_place_of_the_button(client, web_backend):
    assert client.get("/").text.count(BUTTON) == client.get("/runs").text.count(BUTTON) == 1
    run = start_audit(web_backend)
    told = " ".join(seen(client, "/").texts)
    assert f"run {run.id} of " in told
    assert " is still running, 0 of 3 loops audited; the verdicts of the others are from earlier runs" in told
    for path in ("/", "/runs"):
        page = client.get(path).text
        assert BUTTON not in page
        assert f'<a href="/runs/{run.id}">Run {run.id} is still running</a>' in page
    assert client.post("/runs").headers["location"] == f"/runs/{run.id}"  # of a page that was loaded before
    cancel_audit(web_backend, run.id)
    assert client.get("/").text.count(BUTTON) == 1


def test_what_changed_leaves_nothing_out(client, monkeypatch):
    def change(number: int) -> ChangeView:
        of_now = ("", 50.0, "reliable", "stiction")
        return ChangeView(
            f"C{number}", None, "new", "no_stiction", "stiction", "loop", "because", *of_now, weakly=number == 3
        )

    judged = Judged("2026-01-01T00:00:00Z", "2026-01-01T01:00:00Z", True)
    manual = [ToManual(f"M{number}", None, "stiction", "reliable", judged) for number in range(12)]
    found = Changes("1", "2026-01-01T02:00:00Z", [change(number) for number in range(15)], True, True, manual)
    monkeypatch.setattr("app.services.plant.plant_sheet.changes", lambda *_, **__: found)
    texts = seen(client, "/").texts
    assert "5 or more verdicts that changed, 2 more loops that went to manual" in texts
    assert '<span class="badge stiction weakly">valve sticks, possibly</span>' in client.get("/").text
    assert {f"C{number}" for number in range(15)} | {f"M{number}" for number in range(12)} <= set(texts)


def test_before_a_run_has_ended_nothing_is_compared_with_it(client, monkeypatch):
    monkeypatch.setattr("app.services.plant.plant_sheet.changes", lambda *_, **__: Changes(None, None, [], False))
    texts = seen(client, "/").texts
    assert "No run of the plant has ended yet: there is nothing to compare with." in texts
    assert not any("that run" in text for text in texts)


def test_groups_that_are_not_known_yet_are_said_to_be(client, monkeypatch):
    for path in ("/", "/loops/FIC101"):
        assert 'id="groups-awaited"' not in client.get(path).text
    monkeypatch.setattr(groups, "soon", lambda backend: None)
    for path in ("/", "/loops/FIC101", "/groups"):
        assert 'id="groups-before"' in client.get(path).text
    for shown in ("app.services.plant.groups.shown", "app.services.plant.loop_sheet.shown"):
        monkeypatch.setattr(shown, lambda backend: groups.Shown(None))
    for path in ("/", "/loops/FIC101"):
        assert 'id="groups-awaited"' in client.get(path).text


def test_what_could_not_be_audited_is_told_apart_by_what_is_known_of_it(client, monkeypatch, web_backend):
    def told(verdicts: dict[str, int], refused: dict[str, int]) -> str:
        found = replace(overview(web_backend), verdicts=verdicts, refused=refused)
        monkeypatch.setattr("app.services.plant.plant_sheet.overview", lambda _: found)
        html = client.get("/").text
        start = html.index('<p id="not-audited">')
        return " ".join("".join(Seen(html[start : html.index("</p>", start)]).texts).split())

    of_eight = {"stuck_valve_or_dead_transmitter": 3, "not_in_automatic": 4, "data": 1}
    assert told({"not_auditable": 8}, of_eight) == (
        "8 loops could not be audited and are not in this list. In 3 of them PV does not answer OP: the valve is "
        "stuck, or the transmitter is dead. Of the valves of the other 5 nothing is known, good or bad."
    )
    assert told({"not_auditable": 1}, {"data": 1}) == (
        "1 loop could not be audited and is not in this list. Nothing is known of its valve, good or bad."
    )


def test_a_plant_of_retired_loops_is_not_said_to_be_new(client, web_backend, monkeypatch):
    found = replace(
        overview(web_backend), loops=0, audited=0, verdicts={}, reliable={}, refused={}, units=[], retired=3
    )
    monkeypatch.setattr("app.services.plant.plant_sheet.overview", lambda _: found)
    html = client.get("/").text
    assert "No loop is in service" in html
    assert '<a href="/table?retired=true">3 retired</a>' in html
    assert "No loop has been audited yet" not in html
