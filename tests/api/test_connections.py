"""What dashboards rest on: every route and field of the ready dashboard, the CSV twin, times in ms, ETags."""

import csv
import io
import json
import re
import time
from datetime import datetime
from pathlib import Path
from urllib.parse import parse_qsl, quote, urlsplit

import pytest

from app.main import create_app
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.warming import warm_up
from app.services.backend import Backend
from app.services.digests.sending import Post
from app.services.digests.webhooks import signature
from app.services.intake.reading import read_upload
from app.services.upkeep.metrics import metrics
from tests.swinging import wide

DOCS = Path(__file__).resolve().parents[2] / "docs"
DASHBOARD = json.loads((DOCS / "grafana" / "loopaudit.json").read_text(encoding="utf-8"))
TARGETS = [target for panel in DASHBOARD["panels"] for target in panel["targets"]]
VARIABLES = [v["query"]["infinityQuery"] for v in DASHBOARD["templating"]["list"] if v["type"] == "query"]
INFINITY = [target for target in TARGETS if "url" in target] + VARIABLES
PROMETHEUS = [target["expr"] for target in TARGETS if "expr" in target]
TAGS = ("FIC101", "=LIC 7/A")


@pytest.fixture(scope="module")
def backend(open_plant) -> Backend:
    warm_up()  # compiled on first use, which is not a loop's time to lose
    return open_plant()


@pytest.fixture(scope="module")
def client(serve, backend):
    with serve(create_app(backend.settings)) as connection:
        upload = connection.post(
            "/v1/uploads?filename=a.csv", content=wide(*TAGS), headers={"Content-Type": "text/csv"}
        )
        read_upload(backend, int(upload.json()["id"]), owner="test")
        run = connection.post("/v1/audits", json={}).json()
        audit_chunk(backend, int(run["id"]), "test")
        yield connection


def rows_of(target: dict, answer: dict) -> list[dict]:
    root = target["root_selector"]
    return answer[root] if root else [answer]


@pytest.mark.parametrize("target", INFINITY, ids=lambda target: target["url"])
def test_every_route_and_field_of_the_dashboard_is_there(client, target):
    url = target["url"].replace("${loop:percentencode}", quote(TAGS[1], safe=""))
    assert "$" not in url
    answer = client.get(url)
    assert answer.status_code == 200, answer.text
    found = rows_of(target, answer.json())
    if "verdict=" in url:  # neither loop need stick: any row of the table shows the fields
        found = rows_of(target, client.get("/v1/reliability").json())
    assert found
    assert {column["selector"] for column in target["columns"]} <= set(found[0])
    if "pagination_mode" in target:
        assert target["pagination_param_cursor_extraction_path"] in answer.json()


@pytest.mark.parametrize("expression", PROMETHEUS)
def test_every_metric_of_the_dashboard_is_there(backend, expression):
    assert expression in {metric.name for metric in metrics(backend)}


def test_metrics_of_the_page_are_there(backend):
    named = set(re.findall(r"loopaudit_[a-z_]+", (DOCS / "CONNECTIONS.md").read_text(encoding="utf-8")))
    assert named
    assert named <= {metric.name for metric in metrics(backend)}


def test_an_alarm_on_a_moment_goes_off_where_there_was_none_yet(backend):
    page = (DOCS / "CONNECTIONS.md").read_text(encoding="utf-8")
    moments = re.findall(r"`time\(\) - (loopaudit_\w+) > [^`]*`", page)
    assert len(moments) == 2
    assert all(re.search(rf"`time\(\) - {name} > [^`]* or absent\({name}\)`", page) for name in moments)


@pytest.mark.parametrize("secret", ["a plain secret", "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"])
def test_the_receiver_of_the_page_knows_our_signature(secret):
    page = (DOCS / "CONNECTIONS.md").read_text(encoding="utf-8")
    sample: dict = {}
    exec(re.search(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)[1], sample)  # noqa: S102 - of our own page
    sent, moment = Post("msg_1", b'{"loops": 2}'), int(time.time())
    headers = {"webhook-id": sent.id, "webhook-timestamp": str(moment)}
    headers["webhook-signature"] = signature(secret, sent, moment)
    assert sample["verified"](secret, headers, sent.body)
    assert not sample["verified"](secret, headers, sent.body + b" ")
    assert not sample["verified"](secret, headers | {"webhook-timestamp": str(moment - 400)}, sent.body)


def test_the_dashboard_names_no_server_of_its_own():
    assert {target["datasource"]["uid"] for target in TARGETS} == {"${infinity}", "${prometheus}"}
    assert all(not urlsplit(target["url"]).netloc for target in INFINITY)
    assert all(dict(parse_qsl(urlsplit(target["url"]).query)).keys() <= {"sort", "limit", "verdict", "reliability"}
               for target in INFINITY)  # fmt: skip


def test_pages_follow_the_cursor_as_a_query_parameter(client):
    first = client.get("/v1/reliability?limit=1").json()
    second = client.get("/v1/reliability", params={"limit": 1, "cursor": first["next_cursor"]}).json()
    assert [row["loop"] for row in (*first["rows"], *second["rows"])] == sorted(TAGS)
    assert second["next_cursor"] is None


@pytest.mark.parametrize("listed", ["reliability", "loops", f"loops/{TAGS[0]}/verdicts", "audits", "uploads"])
def test_an_empty_cursor_is_that_of_the_first_page(client, listed):
    asked = {"limit": 1}
    assert (
        client.get(f"/v1/{listed}", params=asked | {"cursor": ""}).json()
        == client.get(f"/v1/{listed}", params=asked).json()
    )


def test_times_are_told_twice(client):
    row = client.get("/v1/reliability").json()["rows"][0]
    for name in ("audited_at", "window_start", "window_end"):
        assert row[f"{name}_ms"] == pytest.approx(datetime.fromisoformat(row[name]).timestamp() * 1000, abs=1)
    trend = client.get(f"/v1/loops/{TAGS[0]}/trend?points=20").json()
    moments = [round(datetime.fromisoformat(moment).timestamp() * 1000) for moment in trend["time"]]
    assert moments
    assert trend["time_ms"] == moments


@pytest.mark.parametrize("name", ["audited_at_ms", "-window_end_ms"])
def test_rows_can_be_sorted_by_a_time_in_ms_page_by_page(client, name):
    first = client.get(f"/v1/reliability?sort={name}&limit=1").json()
    second = client.get(f"/v1/reliability?sort={name}&limit=1&cursor={quote(first['next_cursor'])}").json()
    assert {first["rows"][0]["loop"], second["rows"][0]["loop"]} == set(TAGS)


def test_the_csv_twin_has_the_same_cells(client):
    json_rows = client.get("/v1/reliability").json()["rows"]
    csv_rows = list(csv.DictReader(io.StringIO(client.get("/v1/reliability?format=csv").text)))
    assert [set(row) for row in csv_rows] == [set(row) for row in json_rows]
    assert [int(row["audited_at_ms"]) for row in csv_rows] == [row["audited_at_ms"] for row in json_rows]


@pytest.mark.parametrize(
    "url", ["/v1/reliability", "/v1/reliability?format=csv", "/v1/loops/FIC101/health", "/v1/loops/FIC101"]
)
def test_what_has_not_changed_is_not_sent_again(client, url):
    tag = client.get(url).headers["ETag"]
    for known in (tag, tag.removeprefix("W/"), f'"other", {tag}', "*"):
        again = client.get(url, headers={"If-None-Match": known})
        assert (again.status_code, again.content, again.headers["ETag"]) == (304, b"", tag)
    assert client.get(url, headers={"If-None-Match": '"other"'}).status_code == 200


def test_a_change_of_a_loop_changes_the_tag(client):
    before = client.get("/v1/reliability").headers["ETag"]
    client.patch("/v1/loops/FIC101", json={"unit": "area 9"})
    after = client.get("/v1/reliability", headers={"If-None-Match": before})
    assert (after.status_code, after.headers["ETag"] != before) == (200, True)


def test_a_change_answers_with_the_tag_that_the_loop_has_then(client):
    before = client.get("/v1/loops/FIC101").headers["ETag"]
    changed = client.patch("/v1/loops/FIC101", json={"unit": "area 7"})
    after = client.get("/v1/loops/FIC101")
    assert changed.headers["ETag"] == after.headers["ETag"] != before
    assert changed.json() == after.json()


def test_a_loop_is_changed_only_as_it_was_known(client):
    known = client.get("/v1/loops/FIC101").headers["ETag"]
    first = client.patch("/v1/loops/FIC101", json={"unit": "area 5"}, headers={"If-Match": known})
    late = client.patch("/v1/loops/FIC101", json={"description": "late"}, headers={"If-Match": known})
    assert (first.status_code, late.status_code, late.json()["code"]) == (200, 412, "changed_meanwhile")
    loop = client.get("/v1/loops/FIC101").json()
    assert (loop["unit"], loop["description"]) == ("area 5", None)
    again = {"If-Match": f'"other", {first.headers["ETag"]}'}
    assert client.patch("/v1/loops/FIC101", json={"description": "now"}, headers=again).status_code == 200
    assert client.patch("/v1/loops/FIC101", json={"unit": None}, headers={"If-Match": "*"}).status_code == 200
    assert client.patch("/v1/loops/none", json={"unit": None}, headers={"If-Match": "*"}).status_code == 404


def test_a_run_changes_the_tag(client, backend):
    before = client.get("/v1/loops/FIC101/health").headers["ETag"]
    run = client.post("/v1/audits", json={"tags": ["FIC101"]}).json()
    audit_chunk(backend, int(run["id"]), "test")
    assert client.get("/v1/loops/FIC101/health", headers={"If-None-Match": before}).status_code == 200
