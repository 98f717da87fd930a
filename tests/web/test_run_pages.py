"""The pages of runs: who started them, and how one is called off."""

import re

from app.engine.audit import audit
from app.services.auditing import chunks
from app.services.auditing.audits import LoopFilter, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.nightly import nightly
from tests.web.conftest import seen


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
    assert run["started_by"] == who == "a local user without a key"
    for address in (f"/runs/{run['id']}", again, whole):
        assert "by a local user without a key" in " ".join(client.get(address).text.split())
    night = nightly(web_backend)
    assert night.started_by == "schedule"
    assert "by the nightly schedule" in client.get(f"/runs/{night.id}").text
    assert " by " not in client.get("/runs/1").text.partition("</p>")[0].partition("Started")[2]
    texts = seen(client, "/runs").texts
    assert {"a local user without a key", "the nightly schedule", "not known"} <= set(texts)
    for ended in (run["id"], again.rpartition("/")[2], whole.rpartition("/")[2], night.id):
        audit_chunk(web_backend, int(ended), "test")


def test_the_plant_is_told_night_by_night(client, web_backend):
    run = client.post("/runs").headers["location"].rpartition("/")[2]
    audit_chunk(web_backend, int(run), "test")
    html = client.get("/nights").text
    assert f'<a href="/runs/{run}">{run}</a>' in html
    assert "No run of the whole plant has ended yet" not in html
    assert '<th scope="col" class="number">Not judged: not in automatic</th>' in html
    assert "went to manual and was judged on data from before counts as judged" in html
    assert '<th scope="col" class="number">no unit</th>' in html
    assert 'href="/nights"' in client.get("/").text


def test_the_work_of_a_short_run_is_more_than_nothing(client, web_backend, monkeypatch):
    monkeypatch.setattr(chunks, "audit", audit)  # what a test before it has asked of is not known already
    run = start_audit(web_backend, LoopFilter()).id
    audit_chunk(web_backend, int(run), "test")
    figures = re.search(r"longest ([\d.]+) s, together ([\d.]+) s of work", client.get(f"/runs/{run}").text)
    assert 0 < float(figures[1]) <= float(figures[2])
