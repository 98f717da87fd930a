"""Notes, work orders, repairs and shelvings, written and ended on the page of a loop and over the API."""

import re
from datetime import UTC, datetime, timedelta

import pytest
from markupsafe import escape

from tests.web.conftest import HOSTILE_PAGE, Seen, seen


def test_a_note_with_a_work_order_and_a_repair_is_written_and_shown_as_text(client):
    note = {"text": "<b-evil>packing</b-evil> renewed", "work_order": "WO-<1>", "repaired_at": "2026-01-01T06:00"}
    answer = client.post(f"{HOSTILE_PAGE}/notes", data=note)
    assert (answer.status_code, answer.headers["location"]) == (303, f"{HOSTILE_PAGE}#notes")
    found = seen(client, HOSTILE_PAGE)
    assert "<b-evil>packing</b-evil> renewed" in found.texts
    assert "WO-<1>" in found.texts
    assert any("No verdict rests on a record from after the repair yet" in text for text in found.texts)
    assert found.forbidden == []


def test_before_and_after_a_repair(client):
    client.post("/loops/LIC7/notes", data={"repaired_at": "2025-12-31T00:00"})
    texts = seen(client, "/loops/LIC7").texts
    assert "Before and after the repair of 2025-12-31 00:00" in texts
    assert "Probability of stiction" in texts
    assert "Reversals of OP an hour" in texts
    assert not any(text.startswith("stiction band") for text in texts)


def test_a_repair_is_withdrawn_on_the_page_and_the_trail_keeps_it(client):
    client.post("/loops/FIC101/notes", data={"repaired_at": "2025-12-30T00:00", "text": "not this loop"})
    note_id = client.get("/v1/loops/FIC101/notes").json()["rows"][0]["id"]
    form = f"/loops/FIC101/notes/{note_id}/withdraw"
    assert form in client.get("/loops/FIC101").text
    answer = client.post(form)
    assert (answer.status_code, answer.headers["location"]) == (303, "/loops/FIC101#notes")
    page = client.get("/loops/FIC101").text
    assert form not in page
    assert "Before and after the repair of 2025-12-30 00:00" not in page
    assert "not this loop" in page
    assert "by a local user without a key" in page
    row = client.get("/v1/trail?action=repair.withdraw").json()["rows"][0]
    assert (row["who"], row["outcome"]) == ("a local user without a key", "done")


def test_notes_are_written_and_repairs_withdrawn_over_the_api(client):
    path = f"/v1{HOSTILE_PAGE}/notes"
    said = {"text": "packing", "work_order": "WO-2", "repaired_at": "2025-12-30T06:00:00"}
    wrote = client.post(path, json=said)
    assert (wrote.status_code, wrote.json()["repaired_at"]) == (201, "2025-12-30T06:00:00Z")
    withdrawn = client.delete(f"{path}/{wrote.json()['id']}/repair").json()
    assert withdrawn["withdrawn_by"] == "a local user without a key"
    assert client.get(path).json()["rows"][0] == withdrawn
    assert client.delete(f"{path}/nonsense/repair").json()["code"] == "no_such_repair"
    far = client.post(path, json={"repaired_at": "9999-12-31T23:59:59-14:00"})
    assert (far.status_code, far.json()["code"]) == (400, "bad_time")


def test_a_loop_is_shelved_on_its_page_left_out_of_the_worst_and_listed_again(client):
    day = (datetime.now(UTC) + timedelta(days=30)).strftime("%Y-%m-%d")
    worst = re.compile(r"Worst first.*?</table>", re.DOTALL)
    href = 'href="/loops/LIC7"'
    assert href in worst.search(client.get("/").text)[0]
    note = {"text": "<b-evil>until</b-evil> the turnaround", "work_order": "WO-17", "shelved_until": f"{day}T06:00"}
    answer = client.post("/loops/LIC7/notes", data=note)
    assert (answer.status_code, answer.headers["location"]) == (303, "/loops/LIC7#notes")
    plant = client.get("/").text
    assert href not in worst.search(plant)[0]
    assert "<summary>1 shelved</summary>" in plant
    assert href in plant.partition("<summary>1 shelved</summary>")[2]
    assert seen(client, "/").forbidden == []
    found = seen(client, "/loops/LIC7")
    assert found.forbidden == []
    words = " ".join(" ".join(found.texts).split())
    assert f"Shelved until {day} 06:00" in words
    assert f"Wait: shelved until {day} 06:00 (work order WO-17)." in words
    assert any(f"{day} 06:00" in text for text in seen(client, "/table?column=shelved_until").texts)
    note_id = client.get("/v1/loops/LIC7/notes").json()["rows"][0]["id"]
    form = f"/loops/LIC7/notes/{note_id}/unshelve"
    assert form in client.get("/loops/LIC7").text
    answer = client.post(form)
    assert (answer.status_code, answer.headers["location"]) == (303, "/loops/LIC7#notes")
    page = client.get("/loops/LIC7").text
    assert form not in page
    assert "by a local user without a key" in page
    assert href in worst.search(client.get("/").text)[0]
    row = client.get("/v1/trail?action=shelving.withdraw").json()["rows"][0]
    assert (row["who"], row["outcome"]) == ("a local user without a key", "done")


def test_a_loop_is_shelved_over_the_api(client):
    path = "/v1/loops/FIC101/notes"
    moment = (datetime.now(UTC) + timedelta(days=30)).strftime("%Y-%m-%dT06:00:00")
    wrote = client.post(path, json={"text": "spare part", "shelved_until": moment})
    assert (wrote.status_code, wrote.json()["shelved_until"]) == (201, f"{moment}Z")
    assert client.delete(f"{path}/{wrote.json()['id']}/repair").json()["code"] == "no_such_repair"
    ended = client.delete(f"{path}/{wrote.json()['id']}/shelving").json()
    assert ended["withdrawn_by"] == "a local user without a key"
    assert client.get(path).json()["rows"][0] == ended
    assert client.delete(f"{path}/nonsense/shelving").json()["code"] == "no_such_shelving"
    refused = client.post(path, json={"shelved_until": moment})
    assert (refused.status_code, refused.json()["code"]) == (400, "no_reason_to_shelve")
    late = client.post(path, json={"text": "x", "shelved_until": "2020-01-01"})
    assert (late.status_code, late.json()["code"]) == (400, "bad_shelving_time")


@pytest.mark.parametrize(
    "note",
    [
        {},
        {"shelved_until": "2126-01-01T06:00"},
        {"text": "x", "shelved_until": "2126-01-01T06:00"},
        {"text": "x", "shelved_until": "tomorrow"},
        {"text": "x" * 5000},
        {"text": "x", "repaired_at": "yesterday"},
        {"repaired_at": "9999-12-31T23:59:59-14:00"},
        {"text": "x", "repaired_at": "2126-01-01T06:00"},
    ],
)
def test_notes_that_say_nothing_or_too_much_are_refused(client, note):
    assert client.post("/loops/FIC101/notes", data=note).status_code == 400


@pytest.mark.parametrize(
    ("note", "why"),
    [
        ({"work_order": " "}, "a note needs a text, a work order or the time of a repair"),
        ({"text": "<b-evil>x</b-evil>", "work_order": 'W"7', "repaired_at": "2126-01-01T06:00"}, "is still to come"),
        ({"text": "<b-evil>x</b-evil>", "repaired_at": "yesterday"}, "like 2026-01-31T12:00"),
        ({"shelved_until": "2126-01-01T06:00"}, "to shelve a loop takes a reason"),
        ({"text": "<b-evil>x</b-evil>", "shelved_until": '"tomorrow'}, "the time until which the loop is shelved"),
    ],
)
def test_a_refused_note_says_why_at_its_form_and_keeps_what_was_typed(client, note, why):
    answer = client.post(f"{HOSTILE_PAGE}/notes", data=note)
    found = Seen(answer.text)
    assert any(text.startswith("Not saved:") and why in text for text in found.texts)
    assert found.forbidden == []
    for typed in note.values():
        assert str(escape(typed)) in answer.text


@pytest.mark.parametrize(
    ("form", "place"), [("notes", "notes"), ("settings", "settings"), ("explanations", "explanation")]
)
def test_the_page_of_a_refused_form_loaded_again_is_that_of_its_loop(client, form, place):
    answer = client.get(f"{HOSTILE_PAGE}/{form}")
    assert (answer.status_code, answer.headers["location"]) == (303, f"{HOSTILE_PAGE}#{place}")
    unknown = client.get(f"/loops/NONE/{form}", headers={"Accept": "application/json"})
    assert (unknown.status_code, unknown.json()["detail"]) == (404, f"there is no loop 'NONE/{form}'")
