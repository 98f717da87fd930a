"""The page of a loop: what it is accused of, what stands beside it, and what can be set on it."""

import re
from pathlib import Path

import pytest
from markupsafe import escape
from sqlalchemy import func, select, update

from app.services.addresses import tag_in_url
from app.services.auditing.chunks import audit_chunk
from app.services.intake.reading import read_upload
from app.services.intake.uploads import receive
from app.services.moments import UTC_CLOCK
from app.services.plant import loop_verdicts
from app.services.plant.arrivals import current_ns
from app.services.plant.listing import listing
from app.services.plant.loop_verdicts import loop_health, verdict_detail
from app.services.plant.periods import periods
from app.services.plant.worst import worst as worst_rows
from app.services.telling.next_steps import behind_source, next_step
from app.services.telling.wording import UNANSWERED
from app.storage.tables import loops as stored_loops
from app.storage.tables import newest_rows
from app.web import loop as loop_page
from tests.web.conftest import HOSTILE, HOSTILE_PAGE, Seen, seen, wide


def test_a_loop_s_page_leads_to_its_parts_and_to_the_loops_beside_it(client):
    page = client.get("/loops/LIC7").text
    places = re.findall(r'href="#([^"]+)"', page)
    assert places
    for place in places:
        assert f'id="{place}"' in page
    worst = [link for link in seen(client, "/").links if link.startswith("/loops/")][:3]
    assert len(worst) == 3
    for at, path in enumerate(worst):
        text = client.get(path).text
        assert re.findall(r'rel="prev" href="([^"]+)"', text) == worst[:at][-1:]
        assert re.findall(r'rel="next" href="([^"]+)"', text) == worst[at + 1 : at + 2]


def listed_now(backend):
    return listing(backend, current_ns(backend))


def test_the_loops_beside_a_loop_are_those_of_the_list_that_the_plant_s_page_shows(client, web_backend):
    """Neither what is to be looked at today is among them nor a loop whose record is old."""
    worst = [row["loop"] for row in worst_rows(web_backend, listed_now(web_backend))]
    assert loop_page._beside(web_backend, worst[1], listed_now(web_backend)) == (worst[0], worst[2])
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
        assert [loop_page._beside(web_backend, tag, listed_now(web_backend)) for tag in worst] == [(None, None)] * 3
    finally:
        store(newest_ns, **was._mapping)


def test_a_loop_says_how_large_its_stiction_is_or_why_not(client):
    assert "How large is the stiction" in seen(client, "/loops/LIC7").texts


def test_a_loop_says_what_to_do_next_and_which_end_of_a_figure_is_good(client):
    row = client.get("/v1/loops/FIC101/health").json()
    text = " ".join(" ".join(seen(client, "/loops/FIC101").texts).split())
    then = behind_source(next_step(row, UTC_CLOCK))
    (group,) = client.get("/v1/groups").json()["rows"]
    assert group["source"] != "FIC101"
    assert f"What to do: First look at {group['source']} , with which it oscillates in step. Then: {then}" in text
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


def test_charts_have_the_curves_of_the_verdict(client):
    told = client.get("/loops/FIC101/charts").json()
    assert told["rmse_d"] is not None
    assert len(told["rmse_d"]["d"]) == len(told["rmse_d"]["rmse"]) > 1
    assert told["valve"] is not None
    assert len(told["trend"]["valve"]) == len(told["trend"]["time"])


def test_the_period_of_each_figure_is_told(client, web_backend):
    for path in ("/loops/LIC7", "/v1/loops/LIC7/report"):
        texts = seen(client, path).texts
        assert any(
            text.startswith("Record: 600 samples every 5.0 s, 2026-01-01 00:00 to 2026-01-01 00:49") for text in texts
        )
        assert any("of the whole record, 2026-01-01 00:00 to 2026-01-01 00:49" in text for text in texts)
    row, detail = loop_health(web_backend, "LIC7"), verdict_detail(web_backend, "LIC7")
    assert periods(web_backend, "LIC7", row, detail).lines[1:] == ("All of it was looked at.",)
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
    assert told.of_figures.endswith("oscillation, Yper and band d are from what was judged")
    assert told.of_old == ""


def test_audit_again_starts_a_run_of_this_loop(client, web_backend):
    answer = client.post(f"{HOSTILE_PAGE}/audit")
    assert answer.status_code == 303
    run = answer.headers["location"]
    assert any("0 of 1 done" in text for text in seen(client, run).texts)
    audit_chunk(web_backend, int(run.rpartition("/")[2]), "test")
    found = seen(client, run)
    assert any("1 of 1 done" in text for text in found.texts)
    assert HOSTILE in found.texts  # among the slowest loops


def test_a_loop_that_was_never_audited_says_what_brings_its_verdict(client, web_backend):
    head, *rows = wide("NEW1").decode().splitlines()
    with receive(web_backend, filename="new.csv") as receiving:
        receiving.write("\n".join([head, *rows]).encode())
        receipt = receiving.commit()
    read_upload(web_backend, int(receipt.upload.id), "test")
    found = seen(client, "/loops/NEW1")
    assert "This loop has not been audited yet: the next audit of the plant will bring its verdict." in found.texts
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


def test_the_loops_of_a_cascade_are_linked_both_ways(client, monkeypatch):
    detail = loop_verdicts.verdict_detail
    wired = {"moves_set_point_of": [HOSTILE, "FIC3"], "set_point_moved_by": ["AIC1"]}
    monkeypatch.setattr(loop_verdicts, "verdict_detail", lambda *asked: detail(*asked) | wired)
    page = seen(client, "/loops/FIC101")
    told = " ".join(" ".join(page.texts).split())
    assert f"its OP is the set point of {HOSTILE} and of FIC3 ." in told
    assert "its set point is the OP of AIC1 ." in told
    assert {HOSTILE_PAGE, "/loops/FIC3", "/loops/AIC1"} <= set(page.links)


def test_a_tag_that_is_read_from_the_right_keeps_its_place_in_the_reasons(client, monkeypatch):
    detail = loop_verdicts.verdict_detail
    reasons = [{"code": "shaken_by_neighbour", "text": "in step with \u05d7\u05dd-7 (0.9)"}]
    monkeypatch.setattr(loop_verdicts, "verdict_detail", lambda *asked: detail(*asked) | {"reasons": reasons})
    for address in ("/loops/FIC101", "/v1/loops/FIC101/report"):
        assert "in step with \u2068\u05d7\u05dd-7\u2069 (0.9)" in client.get(address).text


def test_a_winner_with_the_lower_score_is_explained(client, monkeypatch):
    detail, health = loop_verdicts.verdict_detail, loop_verdicts.loop_health

    def told(*asked):
        rivals = [
            {"code": "saturated_op", "score": 0.6, "applies": True, "text": "a"},
            {"code": "external_oscillation", "score": 0.9, "applies": True, "text": "b"},
        ]
        return detail(*asked) | {"rivals": rivals}

    monkeypatch.setattr(loop_verdicts, "verdict_detail", told)
    monkeypatch.setattr(loop_verdicts, "loop_health", lambda *asked: health(*asked) | {"rival_winner": "saturated_op"})
    assert "wins although “external oscillation” scored higher" in client.get("/loops/FIC101").text
    assert "wins although" in client.get("/v1/loops/FIC101/report").text


def test_a_health_that_could_not_be_had_is_called_so_with_the_reason(client, monkeypatch):
    detail, health = loop_verdicts.verdict_detail, loop_verdicts.loop_health
    because = "not evaluated, because too little was measured: 3 samples, at least 100 are needed"
    parts = [{"code": "stiction", "weight": 40.0, "lost": 0.0, "text": because}]
    monkeypatch.setattr(loop_verdicts, "verdict_detail", lambda *asked: detail(*asked) | {"health": parts})
    monkeypatch.setattr(loop_verdicts, "loop_health", lambda *asked: health(*asked) | {"health": None})
    page = client.get("/loops/FIC101").text
    assert '<h2 id="health-head">Health <span class="weak">not evaluated</span></h2>' in page
    assert f'<td class="number">–</td><td>{because}</td>' in page
    report = client.get("/v1/loops/FIC101/report").text
    assert "health not evaluated." in report
    assert f'<td class="number">–</td><td>{because}</td>' in report


def test_explanations_that_nothing_speaks_for_are_folded_away(client, monkeypatch):
    detail = loop_verdicts.verdict_detail
    rivals = [
        {"code": "stiction", "score": 0.05, "applies": True, "text": "first in any case"},
        {"code": "saturated_op", "score": 0.1, "applies": True, "text": "seen a little"},
        {"code": "backlash", "score": 0.09, "applies": True, "text": "hardly seen"},
        {"code": "disturbance", "score": 0.9, "applies": False, "text": "not looked at"},
    ]
    monkeypatch.setattr(loop_verdicts, "verdict_detail", lambda *asked: detail(*asked) | {"rivals": rivals})
    html = client.get("/loops/FIC101").text
    table, folded = html[html.index('id="rivals-head"') :].split("<summary>2 more that nothing speaks for", 1)
    assert "first in any case" in table
    assert "seen a little" in table
    assert "hardly seen" in folded
    assert "not looked at" in folded


def test_a_set_point_from_before_the_record_is_said_to_be_held(client, monkeypatch):
    detail = loop_verdicts.verdict_detail
    assert "held since" not in client.get("/loops/FIC101").text
    held = {"held_since": {"sp": "2026-01-25T00:00:00Z", "automatic": "2026-01-26T00:00:00Z"}}
    monkeypatch.setattr(loop_verdicts, "verdict_detail", lambda *asked: detail(*asked) | held)
    page = client.get("/loops/FIC101").text
    assert "Set point held since 2026-01-25 00:00" in page
    assert "Mode held since 2026-01-26 00:00" in page


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


def test_settings_that_somebody_else_has_changed_meanwhile_are_not_overwritten(client):
    def version() -> str:
        return re.search(r'name="version" value="(\w{32})"', client.get("/loops/LIC7").text)[1]

    before = client.get("/v1/loops/LIC7").json()
    seen_first = version()
    client.patch("/v1/loops/LIC7", json={"unit": "U<9>", "description": "by another"})
    told = {"importance": "1", "unit": "U8", "version": seen_first}
    answer = client.post("/loops/LIC7/settings", data=told, headers={"Accept": "text/html"})
    assert answer.status_code == 409
    assert '<details class="card" id="settings" open>' in answer.text
    assert "somebody else has changed these settings" in answer.text
    assert "<li>unit: U&lt;9&gt;</li>" in answer.text
    assert re.search(r'name="unit"[^>]* value="U8"', answer.text)
    assert client.get("/v1/loops/LIC7").json()["unit"] == "U<9>"
    again = re.search(r'name="version" value="(\w{32})"', answer.text)[1]
    assert again == version()
    assert client.post("/loops/LIC7/settings", data=told | {"version": again}).status_code == 303
    after = client.get("/v1/loops/LIC7").json()
    assert (after["unit"], after["description"]) == ("U8", None)
    client.patch("/v1/loops/LIC7", json={name: before[name] for name in ("unit", "description", "importance")})


def test_what_is_not_shown_of_a_loop_has_its_address(client, monkeypatch):
    before = client.get("/loops/LIC7").text
    assert "older-nights" not in before
    assert "older-notes" not in before
    monkeypatch.setattr("app.services.plant.loop_sheet.NIGHTS", 1)
    monkeypatch.setattr("app.services.stating.notes.SHOWN", 1)
    written = [client.post("/v1/loops/LIC7/notes", json={"text": text}) for text in ("one", "two")]
    assert [answer.status_code for answer in written] == [201, 201]
    page = client.get("/loops/LIC7").text
    assert '<p class="weak" id="older-nights">The last 1; <a href="/v1/loops/LIC7/verdicts">' in page
    assert 'id="older-notes">Older ones: <a href="/v1/loops/LIC7/notes">' in page


def test_what_has_no_vote_is_folded_away_from_what_was_seen(client):
    page = client.get("/loops/LIC7").text
    heard, _, rest = page.partition('<details id="also-heard">')[2].partition("</details>")
    assert "published method" in heard
    assert "; it does not affect the verdict" not in rest
    assert "; they do not affect the verdict" not in rest


def test_the_glossary_has_the_size_and_the_words_of_reliability(client):
    texts = seen(client, "/glossary").texts
    assert {"S", "J", "Rely on it? look first", "Also heard"} <= set(texts)
    guide = (Path(__file__).parents[2] / "docs/guides/OPERATOR.md").read_text()
    assert "| cannot tell | the record speaks neither for nor against it |" in guide
    assert texts[texts.index("cannot tell") + 1].startswith("The record speaks neither for nor against it.")


def test_a_stretch_of_days_ago_is_told_with_its_age(client, web_backend):
    row, detail = loop_health(web_backend, "LIC7"), verdict_detail(web_backend, "LIC7")
    part = {"start_s": 0.0, "end_s": 5940.0, "samples": 200}
    detail |= {"window": part | {"samples": 400}, "identified": part, "reasons": [{"code": "stretches"}]}
    early = row | {"window_start": "2025-12-29T12:40:00Z", "window_end": "2025-12-29T14:19:00Z"}
    found = periods(web_backend, "LIC7", early, detail)
    assert found.of_old == "2025-12-29 12:40 to 14:19, 2.4 days before the newest sample"


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


def test_an_importance_is_typed_as_it_is_told(client):
    client.patch("/v1/loops/FIC101", json={"importance": 4}).raise_for_status()
    page = client.get("/loops/FIC101").text
    client.patch("/v1/loops/FIC101", json={"importance": 1}).raise_for_status()
    assert "importance 4" in page
    assert re.search(r'id="importance"[^>]* value="4"', page)
