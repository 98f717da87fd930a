"""The page of the reliability table: sorted, filtered, with columns to choose, and exported."""

import re
from html import unescape
from urllib.parse import parse_qs

import pytest
from sqlalchemy import select, update

from app.main import create_app
from app.services.cursors import LONGEST
from app.services.telling.asked_wording import asked_words
from app.services.telling.wording import CAUSE_WORDS, VERDICT_WORDS
from app.storage.asked_rows import RowFilter
from app.storage.tables import loops as stored_loops
from app.storage.tables import newest_rows, verdicts
from app.storage.word_order import BY_CAUSE_WORDS, BY_VERDICT_WORDS
from app.web import pages
from app.web.columns import COLUMNS
from app.web.rendering import TEMPLATES
from tests.web.conftest import Seen, seen


def test_the_table_is_filtered_sorted_and_shows_the_columns_that_were_chosen(client):
    found = seen(client, "/table?search=fic&column=yper_pct&sort=loop")
    assert "/loops/FIC101" in found.links
    assert "/loops/LIC7" not in found.links
    assert "Yper, %" in found.texts
    assert "/v1/reliability?search=fic&sort=loop&format=csv&columns=all&limit=20000" in found.links
    assert client.get("/v1/reliability?search=fic&sort=loop&format=csv&columns=all&limit=20000").text.count("\n") == 2


def test_what_a_loop_is_and_whose_stands_on_its_pages_and_is_found(client):
    assert 'name="owner"' not in client.get("/table").text
    told = {"description": "Reflux <b-evil>", "owner": "crew & A"}
    client.patch("/v1/loops/FIC101", json=told).raise_for_status()
    try:
        page = seen(client, "/table?search=reflux")
        assert ("/loops/FIC101" in page.links, "/loops/LIC7" in page.links) == (True, False)
        assert "Reflux <b-evil>" in page.texts
        assert "Reflux <b-evil>" in seen(client, "/").texts
        assert "Reflux <b-evil>" in [text.strip() for text in seen(client, "/table?column=description").texts]
        found = seen(client, "/table?owner=crew+%26+A&column=owner")
        assert [link for link in found.links if link.startswith("/loops/")] == ["/loops/FIC101"]
        assert "/v1/reports?owner=crew+%26+A&sort=-priority" in found.links
        loop = seen(client, "/loops/FIC101")
        assert "/table?owner=crew%20%26%20A" in loop.links
        for report in ("/v1/loops/FIC101/report", "/v1/reports?search=reflux"):
            assert "crew &amp; A" in client.get(report).text
    finally:
        client.patch("/v1/loops/FIC101", json=dict.fromkeys(told)).raise_for_status()


def test_the_table_is_of_a_run_where_that_is_asked(client):
    run = seen(client, "/runs/1")
    assert "/table?audit_id=1&verdict=stiction&retired=any" in run.links
    page = seen(client, "/table?audit_id=1&sort=loop")
    assert {"/loops/FIC101", "/loops/LIC7", "/runs/1"} <= set(page.links)
    assert [link for link in page.links if link.startswith("/table?sort=loop&column=unit")], "the newest ones"
    assert "/v1/reliability?retired=false&audit_id=1&sort=loop&format=csv&columns=all&limit=20000" in page.links
    assert any(text.strip() == "of run 1" or "of run 1" in text for text in page.texts)
    for unknown, status in (("777", 404), ("x", 404)):
        assert client.get(f"/table?audit_id={unknown}").status_code == status


def test_what_is_exported_of_a_run_is_what_the_table_shows(client):
    def shown_and_exported(asked: str) -> tuple[int, int]:
        page = seen(client, f"/table?audit_id=1{asked}")
        (export,) = (link for link in page.links if link.startswith("/v1/") and "columns=all" in link and "csv" in link)
        rows = client.get(export).text.count("\n") - 1
        return sum(link.startswith("/loops/") for link in page.links), rows

    client.patch("/v1/loops/LIC7", json={"retired": True}).raise_for_status()
    try:
        assert shown_and_exported("") == (2, 2)
        assert shown_and_exported("&retired=any") == (3, 3)
    finally:
        client.patch("/v1/loops/LIC7", json={"retired": False}).raise_for_status()


def test_the_table_says_how_many_loops_fit_and_which(client, monkeypatch):
    def counted(query: str) -> str:
        return re.search(r'<p id="counted">(.*?)</p>', client.get(f"/table?{query}").text)[1]

    assert counted("") == counted("audit_id=1") == "<b>3</b> loops"
    assert counted("search=fic") == "<b>1</b> loop: with “fic” in tag, description or owner"
    assert counted("search=101&retired=any").endswith("owner; retired or not")
    monkeypatch.setattr(pages, "ROWS_A_PAGE", 2)
    assert counted("sort=loop") == '<b>3</b> loops <span class="weak">(rows 1 to 2)</span>'
    asked = RowFilter(("stiction",), "reliable", "U1", owner="crew", min_probability=0.5)
    of_these = "probability of 0.5 or more; of unit U1; looked after by crew"
    assert asked_words(asked) == f"valve sticks; reliable when judged; {of_these}"


ROW_OF_LOOP = re.compile(r'<tr><td class="tag"><a href="/loops/([^"]+)"')


def linked(html: str, words: str) -> str:
    return unescape(re.search(rf'<a[^>]* href="([^"]+)">{words}</a>', html)[1])


@pytest.mark.parametrize("asked", ["sort=loop", "sort=-yper_pct", "sort=-priority&audit_id=1", "sort=unit&search=1"])
def test_rows_are_turned_over_forth_and_back_under_the_same_filter_and_order(client, monkeypatch, asked):
    whole = ROW_OF_LOOP.findall(client.get(f"/table?{asked}&column=yper_pct").text)
    monkeypatch.setattr(pages, "ROWS_A_PAGE", 1)
    address, seen_there = f"/table?{asked}&column=yper_pct", []
    for number in range(1, len(whole) + 1):
        html = client.get(address).text
        assert f"row {number} of {len(whole)}" in html
        seen_there.append((address, ROW_OF_LOOP.findall(html)))
        address = linked(html, "Next rows") if number < len(whole) else address
    assert [tag for _, tags in seen_there for tag in tags] == whole
    for number in range(len(whole), 1, -1):
        html = client.get(address).text
        assert "First rows" in html
        address = linked(html, "Previous rows")
        assert parse_qs(asked).items() <= parse_qs(address.partition("?")[2]).items()
        html = client.get(address).text
        assert ROW_OF_LOOP.findall(html) == seen_there[number - 2][1]
    assert "Previous rows" not in html


def test_a_page_says_which_rows_it_has_of_how_many(client, monkeypatch):
    monkeypatch.setattr(pages, "ROWS_A_PAGE", 2)
    first = client.get("/table?sort=loop").text
    assert "rows 1 to 2 of 3" in first
    assert "row 3 of 3" in client.get(linked(first, "Next rows")).text
    turned = linked(first, "Next rows").replace("sort=loop", "sort=-loop")
    assert "rows 1 to 2 of 3" in client.get(turned).text, "another order begins at its head"
    assert 'class="pager"' not in client.get("/table?search=fic").text, "all of them are there"


def test_an_order_that_is_left_empty_is_the_usual_one(client):
    page = client.get("/table?sort=")
    assert (page.status_code, page.text) == (200, client.get("/table").text)


def test_columns_without_an_order_have_no_link(client):
    html = client.get("/table?column=stiction_S&column=health").text
    assert '<th scope="col" class="number">Size S, units of OP</th>' in html
    assert "sort=stiction_S" not in html
    assert "sort=health" in html


@pytest.mark.parametrize(
    ("ordered", "words"), [(BY_VERDICT_WORDS, VERDICT_WORDS), (BY_CAUSE_WORDS, CAUSE_WORDS)], ids=["verdict", "cause"]
)
def test_codes_are_in_the_order_of_their_words(ordered, words):
    told = [{words[code].casefold() for code in codes} for codes in ordered]
    assert all(len(alike) == 1 for alike in told)
    assert [alike.pop() for alike in told] == sorted({one.casefold() for one in words.values()})
    assert sorted(code for codes in ordered for code in codes) == sorted(words)


@pytest.mark.parametrize("name", ["verdict", "likely_cause"])
@pytest.mark.parametrize("of_run", ["", "&audit_id=1"])
def test_verdicts_and_causes_are_sorted_by_the_words_that_are_shown(client, web_backend, name, of_run):
    said = {"verdict": ("stiction", "no_stiction", "inconclusive"), "likely_cause": ("stiction", "backlash", None)}
    kept = []
    with web_backend.database.write() as connection:
        for table in (verdicts, newest_rows):
            rows = connection.execute(select(table.c.loop_id, table.c[name])).all()
            kept += [(table, loop_id, value) for loop_id, value in rows]
            for (loop_id, _), code in zip(sorted(rows), said[name], strict=True):
                connection.execute(update(table).where(table.c.loop_id == loop_id).values({name: code}))
    try:
        page = seen(client, f"/table?sort={name}_words&column={name}{of_run}")
        words = ["cannot tell", "no stiction", "valve sticks"] if name == "verdict" else ["backlash", "the valve"]
        cells = [text for text in page.texts if text.startswith(tuple(words)) and not text.startswith(", ")]
        shown = [text for text in cells[-len(words) :]]
        assert all(text.startswith(word) for text, word in zip(shown, words, strict=True)), cells
        html = client.get(f"/table?sort=-{name}_words&column={name}").text
        assert f'aria-sort="descending"><a href="/table?sort={name}_words&amp;' in html
        assert f"selected>{COLUMNS[name].label}, greatest first<" in html
    finally:
        with web_backend.database.write() as connection:
            for table, loop_id, value in kept:
                connection.execute(update(table).where(table.c.loop_id == loop_id).values({name: value}))


def test_the_health_of_an_old_record_is_of_then():
    macros = TEMPLATES.get_template("_macros.html").module
    row = {"of_old_record": True, "health": 78.2}
    assert str(macros.cell(row, "health", COLUMNS["health"])) == '<span class="weak">78 then</span>'
    assert "<meter" in macros.cell(row | {"of_old_record": False}, "health", COLUMNS["health"])
    assert "not evaluated" in macros.cell(row | {"health": None}, "health", COLUMNS["health"])


def test_what_is_seen_of_the_table_can_be_exported(client):
    links = seen(client, "/table?search=fic&column=yper_pct&column=verdict&sort=-yper_pct").links
    as_seen = next(link for link in links if "columns=" in link)
    lines = client.get(as_seen).text.removeprefix("\ufeff").splitlines()
    assert lines[0] == "loop,yper_pct,verdict"
    assert len(lines) == 2
    assert lines[1].startswith("FIC101,")


def test_every_column_of_the_table_can_be_exported(client):
    every = "&".join(f"column={name}" for name in COLUMNS)
    as_seen = next(link for link in seen(client, f"/table?{every}").links if "columns=" in link)
    assert client.get(as_seen).text.removeprefix("\ufeff").splitlines()[0] == ",".join(["loop", *COLUMNS])
    one = client.get("/v1/reliability?format=csv&columns=loop,importance,type,priority&search=LIC7").text.splitlines()[
        1
    ]
    assert one.startswith("LIC7,1.0,,")
    assert float(one.rpartition(",")[2]) > 0


@pytest.mark.parametrize("query", ["sort=nonsense", "cursor=nonsense"])
def test_a_table_that_there_is_not_is_refused_in_words(client, query):
    assert client.get(f"/table?{query}").status_code in (400, 422)


def test_columns_that_there_are_not_are_left_out(client):
    assert "Verdict" in seen(client, "/table?column=nonsense").texts


def test_the_table_has_what_to_do_and_the_work_order_for_who_asks(client):
    client.post("/v1/loops/FIC101/notes", json={"work_order": "WO-7"}).raise_for_status()
    shown = client.get("/table?column=next_step&column=work_order&column=repaired_at&search=FIC101").text
    assert "WO-7" in shown
    assert "What to do" in shown
    assert "columns=loop%2Cnext_step%2Cwork_order%2Crepaired_at&amp;" in shown


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


def test_an_importance_that_orders_loops_is_shown_where_it_is_not_the_usual_one(client):
    def told() -> list[bool]:
        return [
            "importance 2.5" in client.get(f"/table?search=FIC101{more}").text for more in ("", "&column=importance")
        ]

    assert "worst first: health, importance" in client.get("/table").text
    assert told() == [False, False]
    client.patch("/v1/loops/FIC101", json={"importance": 2.5}).raise_for_status()
    try:
        assert told() == [True, False]
    finally:
        client.patch("/v1/loops/FIC101", json={"importance": 1}).raise_for_status()


@pytest.mark.parametrize("query", ["likely_cause=nothing", "unit=Elsewhere", "retired=true", "search=nothing"])
def test_a_filter_that_leaves_no_loop_says_nothing_of_audits(client, query):
    texts = seen(client, f"/table?{query}").texts
    assert "No loop matches." in texts
    assert not any("been audited yet" in text for text in texts)


@pytest.mark.parametrize("name", ["verdict", "reliability"])
def test_a_verdict_that_there_is_none_of_is_not_said_to_fit_no_loop(client, name):
    page = client.get(f"/table?{name}=b%3Cad%3E")
    texts = Seen(page.text).texts
    assert f"There is no {name} 'b<ad>'." in texts
    assert "No loop matches." not in texts
    assert "<option selected>b&lt;ad&gt;</option>" in page.text


def test_a_unit_that_is_asked_for_is_shown_though_no_loop_names_it(client):
    assert "<option selected>Else&lt;where&gt;</option>" in client.get("/table?unit=Else%3Cwhere%3E").text


def test_a_plant_without_an_audit_says_so(serve, open_plant):
    with serve(create_app(open_plant().settings)) as empty:
        assert "No loop in service has been audited yet." in seen(empty, "/table").texts
        assert "No loop has been audited yet." in seen(empty, "/table?retired=any").texts


def test_what_a_spreadsheet_opens_begins_with_its_mark(client):
    (link,) = [link for link in seen(client, "/table").links if "byte_order_mark" in link]
    assert client.get(link).content.startswith(b"\xef\xbb\xbfloop,unit,verdict")
    others = [link for link in seen(client, "/table").links if "format=csv" in link and "byte_order_mark" not in link]
    assert [client.get(other).content[:10] for other in others] == [b"recording,"]


def test_a_small_importance_is_not_none_and_a_reading_is_in_words(client):
    client.patch("/v1/loops/FIC101", json={"importance": 0.04})
    try:
        path = "/table?search=FIC101&column=importance&column=table2_reading"
        texts = [text.strip() for text in seen(client, path).texts]
        assert "0.04" in texts
        assert not any("_stiction" in text for text in texts)
        assert any(text.startswith(("high ", "low ")) for text in texts)
        assert "importance 0.04" in client.get("/loops/FIC101").text
    finally:
        client.patch("/v1/loops/FIC101", json={"importance": 1})


def test_a_cursor_as_long_as_they_are_made_is_taken(client):
    assert client.get("/table?cursor=" + "x" * LONGEST).status_code != 422
    assert client.get("/table?cursor=" + "x" * (LONGEST + 1)).status_code == 422


def test_all_columns_are_exported_with_those_of_the_loop(client):
    whole = [link for link in seen(client, "/table").links if "columns=all" in link]
    assert len(whole) == 2
    assert {"importance", "priority", "description"} <= set(client.get(whole[0]).text.splitlines()[0].split(","))


def test_every_order_that_a_head_leads_to_can_be_chosen_without_heads(client):
    """On a telephone there are none."""
    shown = "column=health&column=stiction_probability&column=stiction_S"
    html = client.get(f"/table?{shown}").text
    choice = html.split('name="sort">')[1].split("</select>")[0]
    offered = re.findall(r'<option value="([^"]+)"( selected)?>([^<]+)<', choice)
    assert offered == [
        ("-priority", " selected", "worst first: health, importance"),
        ("loop", "", "by tag"),
        ("health", "", "Health"),
        ("-stiction_probability", "", "Probability of stiction, greatest first"),
    ]
    turned = client.get(f"/table?{shown}&sort=-health").text
    assert '<option value="-health" selected>Health, greatest first</option>' in turned
    assert turned.count(" selected>Health") == 1
    assert '<option value="-loop" selected>by tag, last first</option>' in client.get("/table?sort=-loop").text


def test_rows_are_narrowed_by_the_likely_cause(client):
    page = client.get("/table?likely_cause=data")
    assert '<option value="data" selected>too little usable data</option>' in page.text
    assert "No loop matches." in page.text
    assert '<option value="own" selected>own</option>' in client.get("/table?likely_cause=own").text


def test_every_head_that_is_a_link_leads_to_rows_in_that_order(client):
    every = "&".join(f"column={name}" for name in COLUMNS)
    heads = client.get(f"/table?{every}").text.split("<thead>")[1].split("</thead>")[0]
    orders = re.findall(r'<a href="/table\?sort=([^&"]+)', heads)
    assert len(orders) > 15
    for order in orders:
        page = client.get(f"/table?sort={order}&{every}")
        assert (order, page.status_code) == (order, 200)
        assert "aria-sort" in page.text
