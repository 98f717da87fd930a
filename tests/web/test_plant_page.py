"""The page of the plant: its counts, how old its records are, and the last nights behind a verdict."""

import pytest

from app.services.plant.nights import Night
from app.web import loop as loop_page
from app.web import pages
from tests.web.conftest import HOSTILE, seen


def test_the_plant_counts_its_loops(client):
    found = seen(client, "/")
    assert "3" in found.texts
    assert any("of 3 loops audited" in text for text in found.texts)
    told = client.get("/plant/tiles").json()
    assert {row[0] for row in told["loops"]} == {"FIC101", "LIC7", HOSTILE}
    assert [unit[1] for unit in told["units"]] == [3]
    assert client.get("/plant/tiles?unit=").json()["loops"] == told["loops"]
    assert client.get("/plant/tiles?unit=elsewhere").json()["loops"] == []


def test_a_plant_says_how_old_its_records_are(client):
    told = next(text for text in seen(client, "/").texts if text.startswith("Recorded up to 2026-01-01 00:49 UTC, "))
    assert told.endswith(" days ago: no newer export has come.")
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


@pytest.mark.parametrize("path", ["/", "/table", "/loops/FIC101"])
def test_the_last_nights_stand_behind_a_verdict(client, monkeypatch, path):
    assert 'class="nights"' not in client.get(path).text  # of one night there is no course
    told = (Night("2026-03-01", "no_stiction", "reliable"), Night("2026-03-02", "stiction", "not_reliable"))
    for module, name in ((pages, "nights"), (loop_page, "nights_of")):
        monkeypatch.setattr(module, name, lambda _, tags: dict.fromkeys(tags, told))
    html = client.get(path).text
    assert '<span class="no_stiction">–</span><span class="stiction unsure">S</span>' in html
    assert "2026-03-01 no stiction (rely on it); 2026-03-02 valve sticks (look first)" in html
