"""The pages on a real plant: what a plant sends stays text, forms do what they say, nothing runs that is not ours."""

import re
from datetime import UTC, datetime, timedelta

import pytest
from markupsafe import escape
from sqlalchemy import func, select, update

from app.services.addresses import tag_in_url
from app.services.auditing.audits import cancel_audit, list_audits
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.nightly import nightly
from app.services.intake.reading import read_upload
from app.services.intake.uploads import list_uploads, receive
from app.services.next_steps import next_step
from app.services.plant import loops, overview
from app.services.plant.loops import loop_health, verdict_detail
from app.services.plant.nights import Night
from app.services.plant.periods import periods
from app.services.wording import UNANSWERED
from app.storage import uploads as stored_uploads
from app.storage.tables import loops as stored_loops
from app.storage.tables import newest_rows
from app.web import loop as loop_page
from app.web import pages
from app.web.columns import COLUMNS
from tests.web.conftest import HOSTILE, HOSTILE_PAGE, PAGES, Seen, seen, wide


@pytest.mark.parametrize("path", PAGES)
def test_a_page_brings_no_script_and_no_style_but_our_own(client, path):
    found = seen(client, path)
    assert found.forbidden == []
    assert all(source and source.startswith("/static/") for source in found.scripts)


@pytest.mark.parametrize("path", ["/", "/table", "/uploads/1"])
def test_hostile_names_stay_text(client, path):
    assert any(HOSTILE in text for text in seen(client, path).texts)


def test_a_loop_s_page_leads_to_its_parts_and_to_the_loops_beside_it(client):
    page = client.get("/loops/LIC7").text
    for place in re.findall(r'href="#([^"]+)"', page):
        assert f'id="{place}"' in page
    worst = [link for link in seen(client, "/").links if link.startswith("/loops/")][:3]
    for at, path in enumerate(worst):
        text = client.get(path).text
        assert re.findall(r'rel="prev" href="([^"]+)"', text) == worst[:at][-1:]
        assert re.findall(r'rel="next" href="([^"]+)"', text) == worst[at + 1 : at + 2]


def test_the_loops_beside_a_loop_are_those_of_the_list_that_the_plant_s_page_shows(client, web_backend):
    """Neither what is to be looked at today is among them nor a loop whose record is old."""
    worst = [row["loop"] for row in overview.worst(web_backend)]
    assert loop_page._beside(web_backend, worst[1]) == (worst[0], worst[2])
    with web_backend.database.read() as connection:
        newest_ns = connection.scalar(select(func.max(stored_loops.c.newest_ns)))
    of_loop = {tag: stored_loops.c.tag == tag for tag in worst}
    mine = newest_rows.c.loop_id == select(stored_loops.c.id).where(of_loop[worst[2]]).scalar_subquery()
    with web_backend.database.read() as connection:
        (was,) = connection.execute(select(newest_rows.c.verdict, newest_rows.c.likely_cause).where(mine)).all()

    def store(end_ns, **told):
        with web_backend.database.write() as connection:
            connection.execute(update(stored_loops).where(of_loop[worst[0]]).values(newest_ns=end_ns))
            connection.execute(update(newest_rows).where(mine).values(**told))

    store(newest_ns - 40 * 86_400 * 10**9, verdict="inconclusive", likely_cause=UNANSWERED)
    try:
        assert [loop_page._beside(web_backend, tag) for tag in worst] == [(None, None)] * 3
    finally:
        store(newest_ns, **was._mapping)


def test_a_loop_says_how_large_its_stiction_is_or_why_not(client):
    assert "How large is the stiction" in seen(client, "/loops/LIC7").texts


def test_a_loop_says_what_to_do_next_and_which_end_of_a_figure_is_good(client):
    row = client.get("/v1/loops/FIC101/health").json()
    text = " ".join(" ".join(seen(client, "/loops/FIC101").texts).split())
    assert next_step(row) in text
    assert "(regular above 1; at most 100)" in text
    assert "(1 is best, 0 worst)" in text


def test_a_hostile_tag_has_a_page_and_charts(client):
    assert HOSTILE_PAGE in seen(client, "/table").links
    told = client.get(f"{HOSTILE_PAGE}/charts").json()
    assert len(told["trend"]["time"]) == 600
    assert told["window"][0].startswith("2026-01-01")
    assert len(told["pv_op"]["pv"]) > 300
    assert len(told["spectra"]["pv_amplitude"]) == len(told["spectra"]["significant"])
    assert sum(told["errors"]["share_pct"]) == pytest.approx(100.0)


def test_charts_have_the_curves_of_the_verdict_or_none(client):
    told = client.get("/loops/FIC101/charts").json()
    assert told["rmse_d"] is None or len(told["rmse_d"]["d"]) == len(told["rmse_d"]["rmse"])
    assert (told["valve"] is None) == ("valve" not in told["trend"])


def test_the_plant_counts_its_loops(client):
    found = seen(client, "/")
    assert "3" in found.texts
    assert any("of 3 loops audited" in text for text in found.texts)
    told = client.get("/plant/tiles").json()
    assert {row[0] for row in told["loops"]} == {"FIC101", "LIC7", HOSTILE}
    assert [unit[1] for unit in told["units"]] == [3]
    assert client.get("/plant/tiles?unit=").json()["loops"] == told["loops"]
    assert client.get("/plant/tiles?unit=elsewhere").json()["loops"] == []


def test_the_table_is_filtered_sorted_and_shows_the_columns_that_were_chosen(client):
    found = seen(client, "/table?search=fic&column=yper_pct&sort=loop")
    assert "/loops/FIC101" in found.links
    assert "/loops/LIC7" not in found.links
    assert "Yper, %" in found.texts
    assert "/v1/reliability?search=fic&sort=loop&format=csv&limit=20000" in found.links
    assert client.get("/v1/reliability?search=fic&sort=loop&format=csv&limit=20000").text.count("\n") == 2


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


def test_the_table_says_of_an_undated_record_that_it_has_no_date(client, web_backend):
    of_it = update(stored_loops).where(stored_loops.c.tag == "LIC7")
    with web_backend.database.write() as connection:
        known = connection.scalar(select(stored_loops.c.newest_ns).where(stored_loops.c.tag == "LIC7"))
        connection.execute(of_it.values(newest_ns=2_995 * 10**9))
    try:
        page = client.get("/table?column=recorded_to&search=LIC7").text
    finally:
        with web_backend.database.write() as connection:
            connection.execute(of_it.values(newest_ns=known))
    assert 'data-label="Recorded until">no date' in page
    assert "1970" not in page


@pytest.mark.parametrize("path", ["/", "/table", "/loops/FIC101"])
def test_the_last_nights_stand_behind_a_verdict(client, monkeypatch, path):
    assert 'class="nights"' not in client.get(path).text  # of one night there is no course
    told = (Night("2026-03-01", "no_stiction", "reliable"), Night("2026-03-02", "stiction", "not_reliable"))
    for module, name in ((pages, "nights"), (loop_page, "nights_of")):
        monkeypatch.setattr(module, name, lambda _, tags: dict.fromkeys(tags, told))
    html = client.get(path).text
    assert '<span class="no_stiction">–</span><span class="stiction unsure">S</span>' in html
    assert "2026-03-01 no stiction (rely on it); 2026-03-02 valve sticks (look first)" in html


def test_columns_without_an_order_have_no_link(client):
    html = client.get("/table?column=stiction_S&column=health").text
    assert '<th scope="col" class="number">Size S, units of OP</th>' in html
    assert "sort=stiction_S" not in html
    assert "sort=health" in html


def test_what_is_seen_of_the_table_can_be_exported(client):
    links = seen(client, "/table?search=fic&column=yper_pct&column=verdict&sort=-yper_pct").links
    as_seen = next(link for link in links if "columns=" in link)
    lines = client.get(as_seen).text.splitlines()
    assert lines[0] == "loop,yper_pct,verdict"
    assert len(lines) == 2
    assert lines[1].startswith("FIC101,")


def test_every_column_of_the_table_can_be_exported(client):
    every = "&".join(f"column={name}" for name in COLUMNS)
    as_seen = next(link for link in seen(client, f"/table?{every}").links if "columns=" in link)
    assert client.get(as_seen).text.splitlines()[0] == ",".join(["loop", *COLUMNS])
    one = client.get("/v1/reliability?format=csv&columns=loop,importance,type,priority&search=LIC7").text.splitlines()[
        1
    ]
    assert one.startswith("LIC7,1.0,,")
    assert float(one.rpartition(",")[2]) > 0


@pytest.mark.parametrize("query", ["sort=nonsense", "cursor=nonsense"])
def test_a_table_that_there_is_not_is_refused_in_words(client, query):
    assert client.get(f"/table?{query}").status_code in (400, 422)


def test_a_loop_that_continues_another_one_says_so_on_both_pages(client):
    told = {"importance": "1", "continues": "FIC101"}
    client.post("/v1/loops/FIC101/notes", json={"work_order": "WO-77"}).raise_for_status()
    assert client.post("/loops/LIC7/settings", data=told).status_code == 303
    try:
        assert 'id="continues"' in client.get("/loops/LIC7").text
        assert "WO-77" in client.get("/loops/LIC7").text
        assert 'id="goes-on-as"' in client.get("/loops/FIC101").text
        assert client.get("/v1/loops/FIC101").json()["retired"]
        refused = client.post("/loops/FIC101/settings", data={"importance": "1", "continues": "LIC7"})
        assert (refused.status_code, "continues it" in refused.text) == (400, True)
    finally:
        client.patch("/v1/loops/LIC7", json={"continues": None}).raise_for_status()
    assert not client.get("/v1/loops/FIC101").json()["retired"]
    assert client.post("/loops/LIC7/continues", data={"earlier": "FIC101"}).status_code == 303
    client.patch("/v1/loops/LIC7", json={"continues": None}).raise_for_status()


def test_an_importance_that_orders_loops_is_shown_where_it_is_not_the_usual_one(client):
    def told() -> list[bool]:
        return [
            "importance 2.5" in client.get(f"/table?search=FIC101{more}").text for more in ("", "&column=importance")
        ]

    assert "worst first, by health and importance" in client.get("/table").text
    assert told() == [False, False]
    client.patch("/v1/loops/FIC101", json={"importance": 2.5}).raise_for_status()
    try:
        assert told() == [True, False]
    finally:
        client.patch("/v1/loops/FIC101", json={"importance": 1}).raise_for_status()


def test_columns_that_there_are_not_are_left_out(client):
    assert "Verdict" in seen(client, "/table?column=nonsense").texts


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


def test_the_period_of_each_figure_is_told(client, web_backend):
    for path in ("/loops/LIC7", "/v1/loops/LIC7/report"):
        texts = seen(client, path).texts
        assert any(
            text.startswith("Record: 600 samples every 5.0 s, 2026-01-01 00:00 to 2026-01-01 00:49") for text in texts
        )
        assert any("of the whole record, 2026-01-01 00:00 to 2026-01-01 00:49" in text for text in texts)
    row, detail = loop_health(web_backend, "LIC7"), verdict_detail(web_backend, "LIC7")
    assert periods(web_backend, "LIC7", row, detail).lines[1:] == ("All of it was audited.",)
    part = {"start_s": 0.0, "end_s": 995.0, "samples": 200}
    detail |= {
        "window": part | {"end_s": 1995.0, "samples": 400},
        "identified": part,
        "reasons": [{"code": "stretches"}],
    }
    told = periods(web_backend, "LIC7", row | {"window_end": "2026-01-01T00:33:15Z"}, detail)
    assert told.lines[1:] == (
        "Audited window: 400 samples, 2026-01-01 00:00 to 2026-01-01 00:33.",
        "The stretch that speaks for it: 200 samples, 2026-01-01 00:00 to 2026-01-01 00:16.",
    )
    assert told.of_figures.endswith("oscillation, Yper and band d are of what was judged")


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
    assert "by anyone on this machine" in page
    row = client.get("/v1/trail?action=repair.withdraw").json()["rows"][0]
    assert (row["who"], row["outcome"]) == ("anyone on this machine", "done")


def test_notes_are_written_and_repairs_withdrawn_over_the_api(client):
    path = f"/v1{HOSTILE_PAGE}/notes"
    said = {"text": "packing", "work_order": "WO-2", "repaired_at": "2025-12-30T06:00:00"}
    wrote = client.post(path, json=said)
    assert (wrote.status_code, wrote.json()["repaired_at"]) == (201, "2025-12-30T06:00:00Z")
    withdrawn = client.delete(f"{path}/{wrote.json()['id']}/repair").json()
    assert withdrawn["withdrawn_by"] == "anyone on this machine"
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
    assert "by anyone on this machine" in page
    assert href in worst.search(client.get("/").text)[0]
    row = client.get("/v1/trail?action=shelving.withdraw").json()["rows"][0]
    assert (row["who"], row["outcome"]) == ("anyone on this machine", "done")


def test_a_loop_is_shelved_over_the_api(client):
    path = "/v1/loops/FIC101/notes"
    moment = (datetime.now(UTC) + timedelta(days=30)).strftime("%Y-%m-%dT06:00:00")
    wrote = client.post(path, json={"text": "spare part", "shelved_until": moment})
    assert (wrote.status_code, wrote.json()["shelved_until"]) == (201, f"{moment}Z")
    assert client.delete(f"{path}/{wrote.json()['id']}/repair").json()["code"] == "no_such_repair"
    ended = client.delete(f"{path}/{wrote.json()['id']}/shelving").json()
    assert ended["withdrawn_by"] == "anyone on this machine"
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
    assert any(text.startswith("Not written down:") and why in text for text in found.texts)
    assert found.forbidden == []
    for typed in note.values():
        assert str(escape(typed)) in answer.text


def test_audit_again_starts_a_run_of_this_loop(client, web_backend):
    answer = client.post(f"{HOSTILE_PAGE}/audit")
    assert answer.status_code == 303
    run = answer.headers["location"]
    assert any("0 of 1 done" in text for text in seen(client, run).texts)
    audit_chunk(web_backend, int(run.rpartition("/")[2]), "test")
    found = seen(client, run)
    assert any("1 of 1 done" in text for text in found.texts)
    assert HOSTILE in found.texts  # among the slowest loops


def test_the_loops_of_an_upload_are_audited_from_its_page(client, web_backend):
    found = seen(client, "/uploads/1")
    assert "Audit these 3 loops now" in found.texts
    answer = client.post("/uploads/1/audit")
    assert answer.status_code == 303
    run = list_audits(web_backend).rows[0]
    assert answer.headers["location"] == f"/runs/{run.id}"
    assert run.total == 3
    cancel_audit(web_backend, run.id)


def test_a_loop_that_was_never_audited_says_what_brings_its_verdict(client, web_backend):
    head, *rows = wide("NEW1").decode().splitlines()
    with receive(web_backend, filename="new.csv") as receiving:
        receiving.write("\n".join([head, *rows]).encode())
        receipt = receiving.commit()
    read_upload(web_backend, int(receipt.upload.id), "test")
    found = seen(client, "/loops/NEW1")
    assert "This loop has not been audited yet: the next audit of the plant brings its verdict." in found.texts
    assert "Audit now" in found.texts
    assert "Audit this loop now" in seen(client, f"/uploads/{receipt.upload.id}").texts
    client.patch("/v1/loops/NEW1", json={"retired": True})
    assert "This loop has not been audited yet." in seen(client, "/loops/NEW1").texts
    assert not any("new verdict" in text for text in seen(client, f"/uploads/{receipt.upload.id}").texts)
    client.patch("/v1/loops/NEW1", json={"retired": False})


def test_what_a_loop_is_can_be_set(client):
    told = {"importance": "3", "unit": "<u>U1</u>", "op_low": "0", "op_high": "100,5", "type": "flow"}
    assert client.post("/loops/FIC101/settings", data=told).status_code == 303
    loop = client.get("/v1/loops/FIC101").json()
    assert (loop["importance"], loop["unit"], loop["op_high"], loop["pv_low"]) == (3.0, "<u>U1</u>", 100.5, None)
    assert "<u>U1</u>" in seen(client, "/").texts
    for said in ("x", "1e", "nan", "1_000", "1,000.5"):
        assert client.post("/loops/FIC101/settings", data=told | {"op_low": said}).status_code == 400


@pytest.mark.parametrize(
    ("typed", "wrong"),
    [
        ({"op_low": "<b-evil>x"}, {"op_low": "op_low is a number, got"}),
        ({"op_low": "x", "pv_high": "1,000.5"}, {"op_low": "a number", "pv_high": "without marks between thousands"}),
        ({"op_low": "80", "op_high": "20"}, {"op_low": "op_low must be below op_high"}),
        ({"pv_low": "1e999"}, {"pv_low": "finite"}),
        ({"type": 'of"f'}, {"type": "is no type of loop"}),
        ({"unit": "U" * 201}, {"unit": "at most 200 are kept"}),
        ({"importance": "-1"}, {"importance": "importance is 0 to 1000"}),
        ({"importance": ""}, {"importance": "importance is a number"}),
    ],
)
def test_settings_that_cannot_be_taken_are_shown_again_with_what_is_wrong_at_each_field(client, typed, wrong):
    before = client.get(f"/v1/loops/{tag_in_url(HOSTILE)}").json()
    told = {"importance": "2", "description": 'a "new" one', "moves_valve": "no", "retired": "yes"} | typed
    answer = client.post(f"{HOSTILE_PAGE}/settings", data=told, headers={"Accept": "text/html"})
    assert answer.status_code == 400
    assert answer.headers["content-type"].startswith("text/html")
    assert Seen(answer.text).forbidden == []
    assert '<details class="card" id="settings" open>' in answer.text
    for name, text in told.items():
        if name not in ("moves_valve", "retired"):
            assert re.search(rf'name="{name}"[^>]* value="{re.escape(str(escape(text)))}"', answer.text)
    assert '<option value="no" selected>' in answer.text
    assert 'name="retired" value="yes" checked' in answer.text
    said = dict(re.findall(r'<span class="error" id="wrong-(\w+)">([^<]*)</span>', answer.text))
    assert set(said) == set(wrong)
    assert all(part in said[name] for name, part in wrong.items())
    assert answer.text.count('aria-invalid="true"') == len(wrong)
    assert client.get(f"/v1/loops/{tag_in_url(HOSTILE)}").json() == before


@pytest.mark.parametrize(("said", "kept"), [("yes", True), ("no", False), ("", None)])
def test_what_its_op_moves_can_be_stated(client, said, kept):
    told = {"importance": "3", "moves_valve": said}
    assert client.post("/loops/FIC101/settings", data=told).status_code == 303
    assert client.get("/v1/loops/FIC101").json()["moves_valve"] is kept
    chosen = re.search(r'<option value="(\w*)" selected>', client.get("/loops/FIC101").text)
    assert chosen is not None
    assert chosen[1] == said
    assert client.post("/loops/FIC101/settings", data=told | {"moves_valve": "x"}).status_code == 422


def test_a_loop_is_retired_on_its_page_and_says_so(client):
    said, box = 'id="retired"', r'name="retired" value="yes" checked'
    told = {"importance": "1"}
    assert said not in client.get("/loops/LIC7").text
    try:
        assert client.post("/loops/LIC7/settings", data=told | {"retired": "yes"}).status_code == 303
        page = client.get("/loops/LIC7").text
        assert said in page
        assert box in page
        assert "Audit these 2 loops now" in seen(client, "/uploads/1").texts
        assert "LIC7" not in seen(client, "/").texts
        assert "/table?retired=true" in seen(client, "/").links
        assert "LIC7" not in seen(client, "/table").texts
        for shown in ("true", "any"):
            found = seen(client, f"/table?retired={shown}")
            assert "LIC7" in found.texts
            assert any(f"retired={shown}" in link for link in found.links if link.startswith("/v1/reliability"))
        assert ("FIC101" in seen(client, "/table?retired=true").texts) is False
    finally:
        assert client.post("/loops/LIC7/settings", data=told).status_code == 303
    assert said not in client.get("/loops/LIC7").text


def test_an_upload_shows_its_tags_and_what_was_refused(client):
    found = seen(client, "/uploads/1")
    assert "<i>plant.csv" in found.texts
    assert "FIC101.PV" in found.texts
    assert any("Bad <b>Input</b>" in text for text in found.texts)


def test_an_upload_that_waits_for_room_says_so_on_its_page_and_in_the_list(client, web_backend):
    answer = client.post("/v1/uploads", content=b"time,FIC9.PV,FIC9.OP\n0,1,2\n1,2,3\n").json()
    assert (answer["state"], answer["waits_for_room_since"]) == ("received", None)
    assert "no room" not in client.get(f"/uploads/{answer['id']}").text
    with web_backend.database.write() as connection:
        claim = stored_uploads.claim(connection, int(answer["id"]), "test", 40.0, 1)
        stored_uploads.wait_for_room(connection, claim, 20.0)
    since = client.get(f"/v1/uploads/{answer['id']}").json()["waits_for_room_since"]
    page = seen(client, f"/uploads/{answer['id']}").texts
    assert "waits for room on the disk" in page
    assert any(text.startswith(f"Since {since[:10]} {since[11:16]} there is no room to read it.") for text in page)
    assert "waits for room on the disk" in seen(client, "/uploads").texts
    read_upload(web_backend, int(answer["id"]), "test")
    assert "no room" not in client.get(f"/uploads/{answer['id']}").text


def test_a_file_is_read_again_with_another_mapping(client, web_backend):
    answer = client.post("/uploads/1/mapping", data={"mapping": "tag,loop,signal\nLIC7.PV,LIC8,PV\nLIC7.OP,LIC8,OP\n"})
    assert answer.status_code == 303
    number = answer.headers["location"].rpartition("/")[2]
    assert number != "1"
    read_upload(web_backend, int(number), "test")
    assert "LIC8" in client.get(f"/v1/uploads/{number}").json()["loops"]
    assert client.post("/uploads/1/mapping", data={"mapping": "tag,loop,signal\nX,Y,Z\n"}).status_code == 422


@pytest.mark.parametrize(
    ("first", "said"),
    [
        (
            "2026-03-01 12:00:00",
            "from 2026-03-01 12:00 to 2026-03-01 12:01; their times were read as those of UTC.",
        ),
        (
            "2026-03-01T12:00:00+01:00",
            "from 2026-03-01 11:00 to 2026-03-01 11:01; the file tells their time zone.",
        ),
        ("0", "Its times have no date."),
    ],
)
def test_an_upload_says_from_when_it_is_and_by_which_clock(client, web_backend, first, said):
    second = first.replace("12:00:", "12:01:") if ":" in first else "60"
    rows = f"time,T1.PV,T1.OP\n{first},1,2\n{second},2,3\n"
    number = client.post("/v1/uploads?filename=when.csv", content=rows).json()["id"]
    read_upload(web_backend, int(number), "test")
    assert said in client.get(f"/uploads/{number}").text


def test_a_mapping_is_kept_for_later_files_where_the_box_is_ticked_and_taken_back(client, web_backend):
    mapping = "tag,loop,signal\nLIC7.PV,LIC9,PV\nLIC7.OP,LIC9,OP\n"
    assert "For later files too" in client.get("/uploads/1").text
    client.post("/uploads/1/mapping", data={"mapping": mapping})
    assert "LIC7.PV as PV" not in client.get("/uploads").text
    client.post("/uploads/1/mapping", data={"mapping": mapping, "keep": "1"})
    assert "LIC7.OP as OP, LIC7.PV as PV" in client.get("/uploads").text
    assert client.post("/uploads/kept/forget", data={"loop": "LIC9", "file": ""}).status_code == 303
    assert "LIC7.PV as PV" not in client.get("/uploads").text
    assert client.post("/uploads/kept/forget", data={"loop": "LIC9", "file": ""}).status_code == 404


def test_a_file_can_be_sent_without_scripts(client, web_backend):
    answer = client.post("/uploads", files={"file": ("more.csv", b"time,PV,OP\n0,1,2\n1,2,3\n", "text/csv")})
    assert answer.status_code == 303
    assert list_uploads(web_backend).rows[0].filename == "more.csv"


def test_the_loops_of_a_cascade_are_linked_both_ways(client, monkeypatch):
    detail = loops.verdict_detail
    wired = {"moves_set_point_of": [HOSTILE, "FIC3"], "set_point_moved_by": ["AIC1"]}
    monkeypatch.setattr(loops, "verdict_detail", lambda b, t: detail(b, t) | wired)
    page = seen(client, "/loops/FIC101")
    told = " ".join(" ".join(page.texts).split())
    assert f"its OP is the set point of {HOSTILE} and of FIC3 ." in told
    assert "its set point is the OP of AIC1 ." in told
    assert {HOSTILE_PAGE, "/loops/FIC3", "/loops/AIC1"} <= set(page.links)


def test_the_glossary_defines_every_figure_of_a_loop(client):
    texts = seen(client, "/glossary").texts
    for field in ("health", "harris_index", "service_factor_pct", "response_time_s", "yper_pct"):
        assert field in texts


@pytest.mark.parametrize("path", ["/loops/nothing", "/runs/99", "/uploads/99", "/loops/nothing/charts"])
def test_what_is_not_there_is_not_found(client, path):
    assert client.get(path).status_code == 404


def test_a_winner_with_the_lower_score_is_explained(client, monkeypatch):
    detail, health = loops.verdict_detail, loops.loop_health

    def told(backend, tag):
        rivals = [
            {"code": "saturated_op", "score": 0.6, "applies": True, "text": "a"},
            {"code": "external_oscillation", "score": 0.9, "applies": True, "text": "b"},
        ]
        return detail(backend, tag) | {"rivals": rivals}

    monkeypatch.setattr(loops, "verdict_detail", told)
    monkeypatch.setattr(loops, "loop_health", lambda b, t: health(b, t) | {"rival_winner": "saturated_op"})
    assert "wins although “shaken from outside” scored higher" in client.get("/loops/FIC101").text
    assert "wins although" in client.get("/v1/loops/FIC101/report").text


def test_explanations_that_nothing_speaks_for_are_folded_away(client, monkeypatch):
    detail = loops.verdict_detail
    rivals = [
        {"code": "stiction", "score": 0.05, "applies": True, "text": "first in any case"},
        {"code": "saturated_op", "score": 0.1, "applies": True, "text": "seen a little"},
        {"code": "backlash", "score": 0.09, "applies": True, "text": "hardly seen"},
        {"code": "disturbance", "score": 0.9, "applies": False, "text": "not looked at"},
    ]
    monkeypatch.setattr(loops, "verdict_detail", lambda backend, tag: detail(backend, tag) | {"rivals": rivals})
    html = client.get("/loops/FIC101").text
    table, folded = html[html.index('id="rivals-head"') :].split("<summary>2 more that nothing speaks for", 1)
    assert "first in any case" in table
    assert "seen a little" in table
    assert "hardly seen" in folded
    assert "not looked at" in folded


def test_a_set_point_from_before_the_record_is_said_to_be_held(client, monkeypatch):
    detail = loops.verdict_detail
    assert "held since" not in client.get("/loops/FIC101").text
    held = {"held_since": {"sp": "2026-01-25T00:00:00Z", "automatic": "2026-01-26T00:00:00Z"}}
    monkeypatch.setattr(loops, "verdict_detail", lambda b, t: detail(b, t) | held)
    page = client.get("/loops/FIC101").text
    assert "Set point held since 2026-01-25 00:00" in page
    assert "Mode held since 2026-01-26 00:00" in page


def test_a_run_is_cancelled_from_its_page_while_it_goes_on(client):
    address = client.post("/runs").headers["location"]
    button = f'<form method="post" action="{address}/cancel">'
    assert button in client.get(address).text
    assert client.post(f"{address}/cancel").headers["location"] == address
    ended = client.get(address).text
    assert '<b id="state">cancelled</b>' in ended
    assert button not in ended
    late = client.post("/runs/1/cancel", headers={"Accept": "text/html"})
    assert late.status_code == 409
    assert "It is too late for that" in late.text


def test_runs_say_who_started_them_in_the_words_of_the_trail(client, web_backend):
    run = client.post("/v1/audits", json={"tags": ["FIC101"]}).json()
    again = client.post("/loops/FIC101/audit").headers["location"]
    whole = client.post("/runs").headers["location"]
    who = client.get("/v1/trail?action=audit.start").json()["rows"][0]["who"]
    assert run["started_by"] == who == "anyone on this machine"
    for address in (f"/runs/{run['id']}", again, whole):
        assert "by anyone on this machine" in " ".join(client.get(address).text.split())
    night = nightly(web_backend)
    assert night.started_by == "schedule"
    assert "by the nightly schedule" in client.get(f"/runs/{night.id}").text
    assert " by " not in client.get("/runs/1").text.partition("</p>")[0].partition("Started")[2]
    texts = seen(client, "/runs").texts
    assert {"anyone on this machine", "the nightly schedule", "not known"} <= set(texts)
    for ended in (run["id"], again.rpartition("/")[2], whole.rpartition("/")[2], night.id):
        audit_chunk(web_backend, int(ended), "test")


def test_the_loop_list_is_set_and_says_what_could_not_be(client):
    listed = b"tag;importance;P&ID\nFIC101;2,5;a<b>\nNO<b>WHERE;1;x\n"
    answer = client.post("/loop-list", files={"file": ("loops.csv", listed, "text/csv")})
    assert answer.status_code == 200
    assert "1 loop changed, 0 as before, 1 refused" in answer.text
    assert "NO&lt;b&gt;WHERE" in answer.text
    assert client.get("/v1/loops/FIC101").json()["importance"] == 2.5
    client.patch("/v1/loops/FIC101", json={"importance": 1})
    for files in ({"other": ("a.csv", b"", "text/csv")}, {"file": ("a.csv", b"tag\n", "text/csv")}):
        refused = client.post("/loop-list", files=files, headers={"Accept": "text/html"})
        assert refused.status_code in (400, 422)
        assert "<h1>" in refused.text


def test_the_table_has_what_to_do_and_the_work_order_for_who_asks(client):
    client.post("/v1/loops/FIC101/notes", json={"work_order": "WO-7"}).raise_for_status()
    shown = client.get("/table?column=next_step&column=work_order&column=repaired_at&search=FIC101").text
    assert "WO-7" in shown
    assert "What to do" in shown
    assert "columns=loop%2Cnext_step%2Cwork_order%2Crepaired_at&amp;" in shown
