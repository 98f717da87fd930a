"""The routes on an embedded backend; what a worker would do is done here by calling its services."""

import csv
import gzip
import io
import json
import re
from urllib.parse import quote

import pytest

from app.main import create_app
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.warming import warm_up
from app.services.backend import Backend
from app.services.intake.reading import read_upload
from app.settings import Settings
from app.storage import tables

TAGS = ["FIC101", "LIC7", "=AREA 1/<b>\"FIC' 1</b>?&#%2F"]
HOSTILE = TAGS[2]


def wide(*tags: str, samples: int = 400) -> bytes:
    """A wide export in which every loop swings, so that each can be audited."""
    text = io.StringIO()
    rows = csv.writer(text)
    rows.writerow(["DateTime", *(f"{tag}.{signal}" for tag in tags for signal in ("PV", "OP", "SP"))])
    for k in range(samples):
        minutes, seconds = divmod(k * 5, 60)
        swing = (k % 40) / 20 - 1
        stamp = f"2026-01-01T{minutes // 60:02d}:{minutes % 60:02d}:{seconds:02d}Z"
        rows.writerow([stamp, *(value for _ in tags for value in (50 + swing**2 + k % 3 * 0.1, 40 + 5 * swing, 50))])
    return text.getvalue().encode()


@pytest.fixture(scope="module")
def backend(open_plant) -> Backend:
    warm_up()  # compiled on first use, which is not a loop's time to lose
    return open_plant(max_upload_bytes=1_000_000)


@pytest.fixture(scope="module")
def client(serve, backend):
    with serve(create_app(backend.settings)) as connection:
        yield connection


def sent(client, body: bytes, **params) -> dict:
    answer = client.post("/v1/uploads", content=body, params=params, headers={"Content-Type": "text/csv"})
    assert answer.status_code == 202, answer.text
    return answer.json()


@pytest.fixture(scope="module")
def plant(client, backend):
    """Three loops, one with a hostile tag, uploaded and audited; the run."""
    upload = sent(client, wide(*TAGS), filename="plant.csv")
    read_upload(backend, int(upload["id"]), owner="test")
    run = client.post("/v1/audits", json={"tags": TAGS}).json()
    audit_chunk(backend, int(run["id"]), "test")
    return client.get(f"/v1/audits/{run['id']}").json()


# Uploads


def test_an_upload_is_stored_and_says_where_to_ask(client):
    answer = client.post(
        "/v1/uploads?filename=a.csv", content=b"time,PV,OP\n0,1,2\n", headers={"Content-Type": "text/csv"}
    )
    assert answer.status_code == 202
    upload = answer.json()
    assert answer.headers["location"] == f"/v1/uploads/{upload['id']}"
    assert (upload["state"], upload["filename"], upload["size_bytes"]) == ("received", "a.csv", 17)
    assert client.get(answer.headers["location"]).json()["fingerprint"] == upload["fingerprint"]


def test_the_same_content_is_the_same_upload_raw_or_as_a_form(client):
    body = wide("FIC9")
    raw = sent(client, body, filename="x.csv")
    form = client.post("/v1/uploads", files={"file": ("x.csv", body, "text/csv")})
    assert form.status_code == 202
    assert form.json()["id"] == raw["id"]


def test_gzip_is_read(client, backend):
    upload = sent(client, gzip.compress(wide("FIC_Z")), filename="z.csv.gz")
    read_upload(backend, int(upload["id"]), owner="test")
    assert client.get(f"/v1/uploads/{upload['id']}").json()["loops"] == ["FIC_Z"]


def test_the_list_of_uploads_counts_the_loops_and_leaves_naming_them_to_each(client, backend):
    body = re.sub(rb"(00:00:05Z),[^,]+", rb"\1,Bad Input", wide("FIC_L1", "FIC_L2"))
    upload = sent(client, body, filename="listed.csv")
    read_upload(backend, int(upload["id"]), owner="test")
    listed = client.get("/v1/uploads?limit=1").json()["rows"][0]
    assert (listed["id"], listed["loops_found"], listed["rows_refused"]) == (upload["id"], 2, 1)
    assert not {"loops", "rejects", "tags"} & set(listed)
    assert listed["tags_found"] == 6
    one = client.get(f"/v1/uploads/{upload['id']}").json()
    assert {name: one[name] for name in listed} == listed
    assert (one["loops"], len(one["rejects"])) == (["FIC_L1", "FIC_L2"], 1)
    assert [loop["loop"] for loop in one["tags"]] == ["FIC_L1", "FIC_L2"]


@pytest.mark.parametrize("names", [["file", "file"], ["file", "file", "file"], ["file", "mapping", "mapping"]])
def test_no_part_of_a_form_is_dropped_without_a_word(client, names):
    before = client.get("/v1/uploads?limit=1").json()["rows"]
    parts = [(name, (f"{number}.csv", wide(f"FIC_P{number}"), "text/csv")) for number, name in enumerate(names)]
    answer = client.post("/v1/uploads", files=parts)
    assert (answer.status_code, answer.json()["code"]) == (400, "several_files")
    assert f"`{names[-1]}`" in answer.json()["detail"]
    assert client.get("/v1/uploads?limit=1").json()["rows"] == before


def test_rows_that_cannot_be_read_are_told_with_line_and_reason(client, backend):
    body = re.sub(rb"(00:00:05Z),[^,]+", rb"\1,Bad Input", wide("FIC_R"))
    upload = sent(client, body, filename="r.csv")
    read_upload(backend, int(upload["id"]), owner="test")
    found = client.get(f"/v1/uploads/{upload['id']}").json()
    assert found["state"] == "done"
    assert found["rows_refused"] == 1
    assert found["rejects"][0]["line"] == 3
    assert "Bad Input" in found["rejects"][0]["text"]


@pytest.mark.parametrize(
    ("request_", "status", "code"),
    [
        ({"content": b""}, 400, "empty_upload"),
        ({"content": b"x" * 1_000_001}, 413, "upload_too_large"),
        ({"content": b"x" * 4_000_000}, 413, None),
        ({"content": iter([b"x" * 600_000] * 6)}, 413, None),
        ({"content": b"x", "headers": {"Content-Encoding": "br"}}, 415, "content_encoding"),
        ({"files": {"other": ("a.csv", b"x")}}, 400, "no_file"),
        ({"content": b"x", "headers": {"Content-Type": "multipart/form-data"}}, 400, None),
        ({"content": b"x", "headers": {"Content-Type": "multipart/form-data; boundary=x"}}, 400, None),
        ({"content": b"x", "params": {"time_zone": "Mars/Olympus"}}, 400, "unknown_time_zone"),
        ({"content": b"x", "params": {"filename": "n" * 300}}, 422, "invalid_request"),
        ({"content": b"x", "params": {"date_order": "year"}}, 422, "invalid_request"),
    ],
)
def test_uploads_that_are_refused(client, request_, status, code):
    answer = client.post("/v1/uploads", **request_)
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["code"] == (code or answer.json()["code"])


def test_nothing_is_left_of_a_refused_upload(client, backend):
    assert not list(backend.settings.uploads_dir.glob(".part-*"))


# Loops


def test_loops_come_page_by_page_in_the_order_of_their_tags(client, plant):
    tags, cursor = [], None
    while True:
        page = client.get("/v1/loops", params={"limit": 1, **({"cursor": cursor} if cursor else {})}).json()
        tags += [row["tag"] for row in page["rows"]]
        cursor = page["next_cursor"]
        if cursor is None:
            break
    assert tags == sorted(tags)
    assert {"FIC101", "LIC7", HOSTILE} <= set(tags)


@pytest.mark.parametrize("tag", ["FIC101", HOSTILE])
def test_a_loop_is_changed_and_read_back(client, plant, tag):
    url = f"/v1/loops/{quote(tag, safe='')}"
    changed = client.patch(
        url, json={"unit": "CRUDE", "importance": 3, "op_low": 0, "op_high": 100, "integrating": True}
    )
    assert changed.status_code == 200, changed.text
    loop = client.get(url).json()
    assert (loop["tag"], loop["unit"], loop["importance"], loop["op_high"]) == (tag, "CRUDE", 3, 100)
    assert client.patch(url, json={"unit": None}).json()["unit"] is None
    assert client.get(url).json()["importance"] == 3


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"colour": "red"}, 422),
        ({"importance": -1}, 422),
        ({"op_low": 5, "op_high": 5}, 400),
        ({"unit": "x" * 500}, 422),
        ({"unit": "a\x00b"}, 422),
        ({"integrating": 0}, 422),
        ({"op_high": False}, 422),
        ([], 422),
    ],
)
def test_changes_that_are_refused(client, plant, body, status):
    answer = client.patch("/v1/loops/FIC101", json=body)
    assert answer.status_code == status, answer.text
    assert answer.json()["code"]


def test_a_number_that_is_none_is_refused(client, plant):
    answer = client.patch("/v1/loops/FIC101", content=b'{"pv_low": NaN}', headers={"Content-Type": "application/json"})
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("tag", ["FIC101", HOSTILE])
def test_health_trend_and_history_of_a_loop(client, plant, tag):
    url = f"/v1/loops/{quote(tag, safe='')}"
    health = client.get(f"{url}/health").json()
    assert health["loop"] == tag
    assert health["audit_id"] == plant["id"]
    assert not [name for name, value in health.items() if isinstance(value, dict | list)]
    history = client.get(f"{url}/verdicts").json()
    assert [row["audit_id"] for row in history["rows"]] == [plant["id"]]
    assert history["next_cursor"] is None
    trend = client.get(f"{url}/trend", params={"points": 100}).json()
    assert trend["samples"] == 400
    assert len(trend["time"]) == len(trend["pv"]) == len(trend["op"]) == len(trend["sp"]) <= 120
    part = client.get(f"{url}/trend", params={"start": "2026-01-01T00:10:00Z", "end": "2026-01-01T00:15:00Z"}).json()
    same = client.get(f"{url}/trend", params={"from": "2026-01-01T00:10:00Z", "to": "2026-01-01T00:15:00Z"}).json()
    assert same == part
    assert part["samples"] in (60, 61)
    assert part["time"][0] == "2026-01-01T00:10:00Z"
    again = {"start": "2026-01-01T00:10:00Z", "from": "2026-01-01T00:10:00", "end": "2026-01-01T00:15:00Z"}
    assert client.get(f"{url}/trend", params=again).json() == part


@pytest.mark.parametrize(("name", "other"), [("start", "from"), ("end", "to")])
def test_one_bound_of_a_trend_is_given_once(client, plant, name, other):
    params = {name: "2026-01-01T00:10:00Z", other: "2026-01-01T00:11:00Z"}
    answer = client.get("/v1/loops/FIC101/trend", params=params)
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")
    assert answer.json()["errors"][0]["where"] == f"query.{name}"


# Table


def test_the_table_has_every_field_of_the_contract(client, plant):
    row = client.get("/v1/reliability").json()["rows"][0]
    wanted = (
        "recording loop samples sampling_interval_s verdict stiction_probability reliability yper_pct yper_raw_pct "
    )
    wanted += "table2_reading hammerstein_d hammerstein_S hammerstein_J hammerstein_na hammerstein_nb hammerstein_nc "
    wanted += "hammerstein_rmse hammerstein_rmse_without_stiction hammerstein_search_space hammerstein_widenings unit "
    wanted += "stiction_band_pct_of_op_range likely_cause engine_version elapsed_s window_start window_end audited_at "
    wanted += "audit_id"
    assert set(wanted.split()) <= set(row)
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?Z", row["audited_at"])


@pytest.mark.parametrize("sort", ["loop", "-loop", "-stiction_probability", "yper_pct", "unit"])
def test_pages_of_the_table_put_together_are_the_table(client, plant, sort):
    whole = client.get("/v1/reliability", params={"sort": sort}).json()
    assert whole["next_cursor"] is None
    rows, cursor = [], None
    while True:
        params = {"sort": sort, "limit": 1} | ({"cursor": cursor} if cursor else {})
        page = client.get("/v1/reliability", params=params).json()
        rows += page["rows"]
        cursor = page["next_cursor"]
        if cursor is None:
            break
    assert rows == whole["rows"]
    assert len(rows) == 3


def test_filters(client, plant):
    rows = client.get("/v1/reliability").json()["rows"]
    verdicts = {row["verdict"] for row in rows}
    for verdict in verdicts:
        found = client.get("/v1/reliability", params={"verdict": verdict}).json()["rows"]
        assert [row["loop"] for row in found] == [row["loop"] for row in rows if row["verdict"] == verdict]
    assert client.get("/v1/reliability", params={"search": "lic"}).json()["rows"][0]["loop"] == "LIC7"
    assert client.get("/v1/reliability", params={"unit": "NOWHERE"}).json() == {"rows": [], "next_cursor": None}
    assert len(client.get("/v1/reliability", params={"audit_id": plant["id"]}).json()["rows"]) == 3
    assert client.get("/v1/reliability", params={"audit_id": "none"}).json()["rows"] == []


def test_the_table_as_csv_opens_safely(client, plant):
    answer = client.get("/v1/reliability", params={"format": "csv"})
    assert answer.headers["content-type"].startswith("text/csv")
    rows = list(csv.DictReader(io.StringIO(answer.text, newline="")))
    assert {row["loop"] for row in rows} == {"FIC101", "LIC7", "'" + HOSTILE}
    numbers = {row["loop"]: row["yper_pct"] for row in client.get("/v1/reliability").json()["rows"]}
    assert {row["loop"].removeprefix("'"): float(row["yper_pct"]) for row in rows} == pytest.approx(numbers)


@pytest.mark.parametrize(
    ("params", "status", "code"),
    [
        ({"limit": 0}, 422, "invalid_request"),
        ({"limit": 20001}, 422, "invalid_request"),
        ({"sort": "colour"}, 400, "bad_sort"),
        ({"sort": "loop; DROP TABLE loops"}, 400, "bad_sort"),
        ({"cursor": "nonsense"}, 400, "bad_cursor"),
        ({"cursor": "A" * 4500}, 400, "bad_cursor"),
        ({"verdict": "perhaps"}, 422, "invalid_request"),
        ({"format": "xml"}, 422, "invalid_request"),
        ({"colour": "red"}, 422, "invalid_request"),
    ],
)
def test_questions_to_the_table_that_are_refused(client, plant, params, status, code):
    answer = client.get("/v1/reliability", params=params)
    assert (answer.status_code, answer.json()["code"]) == (status, code)


# Runs


def test_a_run_counts_its_loops(client, plant):
    assert (plant["state"], plant["total"], plant["done"], plant["failed"], plant["open"]) == ("done", 3, 3, 0, 0)
    runs = client.get("/v1/audits").json()
    assert plant["id"] in [run["id"] for run in runs["rows"]]


def test_a_run_over_some_loops(client, plant, backend):
    answer = client.post("/v1/audits", json={"tags": ["FIC101"]})
    assert answer.status_code == 202
    assert answer.json()["total"] == 1
    audit_chunk(backend, int(answer.json()["id"]), "test")
    assert client.get(answer.headers["location"]).json()["state"] == "done"
    assert client.post("/v1/audits", json={"tags": ["NOWHERE"]}).json()["code"] == "unknown_loops"


def test_a_run_without_a_body_is_one_over_the_plant(client, plant, backend):
    answer = client.post("/v1/audits")
    assert (answer.status_code, answer.json()["total"]) == (202, client.post("/v1/audits", json={}).json()["total"])


@pytest.mark.parametrize("wanted", [{"unit": "nosuch"}, {"type": "nosuch"}, {"tags": []}], ids=str)
def test_a_filter_that_no_loop_fits_starts_no_run(client, plant, wanted):
    before = client.get("/v1/audits?limit=1").json()["rows"]
    answer = client.post("/v1/audits", json=wanted)
    assert (answer.status_code, answer.json()["code"]) == (400, "no_loops")
    assert client.get("/v1/audits?limit=1").json()["rows"] == before


def test_a_trend_that_ends_before_it_begins_is_refused(client, plant):
    backwards = {"from": "2026-01-02T00:00:00Z", "to": "2026-01-01T00:00:00Z"}
    answer = client.get("/v1/loops/FIC101/trend", params=backwards)
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")
    assert "begins before it ends" in answer.text
    later = client.get("/v1/loops/FIC101/trend", params={"from": "2030-01-01T00:00:00Z"})
    assert (later.status_code, later.json()["samples"]) == (200, 0)


@pytest.mark.parametrize(
    "path", ["/", "/healthz", "/readyz", "/metrics", "/openapi.json", "/v1/loops", "/v1/loops/FIC101/health", "/table"]
)
def test_every_route_that_is_got_answers_head_without_a_body(client, plant, path):
    got, head = client.get(path), client.head(path)
    assert (head.status_code, head.content) == (got.status_code, b"")
    assert head.headers["content-type"] == got.headers["content-type"]


def test_head_of_a_stream_ends_and_of_what_is_not_there_is_not_found(client, plant):
    run = client.post("/v1/audits", json={"tags": ["LIC7"]}).json()
    assert client.head(f"/v1/audits/{run['id']}/events", timeout=5).status_code == 200
    assert client.head("/v1/loops/NOWHERE").status_code == 404
    assert client.head("/nowhere").status_code == 404


def test_what_is_said_of_a_loop_is_stripped_and_its_type_known(client, plant):
    def patched(**changes):
        return client.patch("/v1/loops/LIC7", json=changes)

    assert patched(unit=" CRUDE ", type="level").json()["unit"] == "CRUDE"
    assert patched(unit="  ").json()["unit"] is None
    refused = patched(type="rocket")
    assert (refused.status_code, refused.json()["code"]) == (400, "unknown_type")
    assert "flow, pressure, level" in refused.json()["detail"]
    assert patched(type=None).json()["type"] is None


def test_a_type_that_the_plants_mapping_gave_is_known(client, plant, backend):
    with backend.database.write() as connection:
        loops = tables.loops
        connection.execute(loops.update().where(loops.c.tag == "FIC101").values(type="Durchfluss"))
    assert client.patch("/v1/loops/LIC7", json={"type": "Durchfluss"}).json()["type"] == "Durchfluss"
    client.patch("/v1/loops/LIC7", json={"type": None})


def test_events_tell_the_progress_and_the_end(client, plant, backend):
    run = client.post("/v1/audits", json={"tags": ["LIC7"]}).json()
    with client.stream("GET", f"/v1/audits/{run['id']}/events") as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        lines = stream.iter_lines()
        assert next(lines) == "event: progress"
        assert json.loads(next(lines).removeprefix("data: "))["open"] == 1
        audit_chunk(backend, int(run["id"]), "test")
        rest = list(lines)
    assert "event: end" in rest
    assert json.loads(rest[-2].removeprefix("data: "))["state"] == "done"


@pytest.mark.parametrize(
    "path",
    ["/v1/uploads/7777", "/v1/uploads/x", "/v1/loops/NOWHERE", "/v1/loops/NOWHERE/health", "/v1/loops/NOWHERE/trend",
     "/v1/loops/NOWHERE/verdicts", "/v1/audits/7777", "/v1/audits/-1", "/v1/audits/7777/events", "/loops/NOWHERE"],
)  # fmt: skip
def test_what_is_not_there(client, plant, path):
    answer = client.get(path)
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "application/problem+json"


def test_a_body_that_is_too_large_is_a_problem_too(client):
    answer = client.post("/v1/audits", content=b" " * 5_000_000, headers={"Content-Type": "application/json"})
    assert answer.status_code == 413
    assert answer.headers["content-type"] == "application/problem+json"


# Operations and pages


def test_liveness_readiness_and_metrics(client, plant):
    assert client.get("/healthz").json() == {"state": "alive"}
    assert client.get("/readyz").json()["checks"]["database"] == "ok"
    text = client.get("/metrics").text
    for line in text.splitlines():
        assert re.fullmatch(r'# (HELP|TYPE) \w+ .+|\w+(\{\w+="[^"]*"(,\w+="[^"]*")*\})? [-+.\deE]+', line), line


def test_pages_carry_hostile_names_as_text(client, plant):
    page = client.get("/")
    assert page.status_code == 200
    assert HOSTILE not in page.text
    assert "&lt;b&gt;" in page.text
    loop = client.get(f"/loops/{quote(HOSTILE, safe='')}")
    assert loop.status_code == 200
    assert HOSTILE not in loop.text
    assert f"/loops/{quote(HOSTILE, safe='')}/charts" in loop.text
    assert client.get(f"/loops/{quote(HOSTILE, safe='')}/charts").status_code == 200


def test_pages_take_nothing_from_elsewhere(client, plant):
    for path in ("/", "/loops/FIC101", "/static/plant.js", "/static/loop.js", "/static/loopaudit.css"):
        answer = client.get(path)
        assert answer.status_code == 200
        assert not re.search(r"(src|href|url|import)\s*[=(]\s*[\"']?(https?:)?//", answer.text), path
    assert len(client.get("/static/plotly.min.js").content) > 1_000_000
    assert client.get("/static/../main.py").status_code == 404


# OpenAPI


def test_openapi_describes_every_field_and_parameter(client):
    schema = client.get("/openapi.json").json()
    models = schema["components"]["schemas"]
    bare = [
        f"{model}.{name}"
        for model, body in models.items()
        if "ValidationError" not in model
        for name, field in body.get("properties", {}).items()
        if not field.get("description")
    ]
    assert not bare
    for path, operations in schema["paths"].items():
        for method, operation in operations.items():
            assert operation.get("summary"), (method, path)
            assert not [p["name"] for p in operation.get("parameters", ()) if not p.get("description")], (method, path)


def test_a_refusal_is_no_longer_than_what_was_wrong(client):
    asked = "&".join(f"{k}{'x' * 1000}" for k in range(50))
    answer = client.get(f"/v1/reliability?{asked}")
    assert answer.json()["code"] == "invalid_request"
    assert len(answer.content) < len(asked)


def test_a_parameter_that_a_route_does_not_know_is_refused_by_each_of_the_api(client):
    taking = {
        (method, path): operation
        for path, operations in client.get("/openapi.json").json()["paths"].items()
        for method, operation in operations.items()
        if path.startswith("/v1/")
    }
    for (method, path), operation in taking.items():
        assert "422" in operation["responses"], path
        known = [one["name"] for one in operation.get("parameters", ()) if one["in"] == "query"]
        answer = client.request(method, re.sub(r"{\w+}", "x", path), params={"limt": 5})
        assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request"), path
        (error,) = (one for one in answer.json()["errors"] if one["where"].startswith("query."))
        told = f"there is {', '.join(known)}" if known else "this takes no parameters"
        assert (error["where"], error["what"].endswith(told)) == ("query.limt", True), path


@pytest.mark.parametrize("path", ["/healthz", "/readyz", "/metrics"])
def test_probes_may_add_parameters(client, path):
    assert client.get(path, params={"target": "plant"}).status_code == 200


def test_openapi_says_that_errors_are_problems_and_refers_to_what_is_there(client):
    schema = client.get("/openapi.json").json()
    text = json.dumps(schema)
    assert "Problem" in schema["components"]["schemas"]
    for reference in re.findall(r'"#/components/schemas/([^"]+)"', text):
        assert reference in schema["components"]["schemas"]
    for path, operations in schema["paths"].items():
        for method, operation in operations.items():
            for status, answer in operation["responses"].items():
                if status.startswith("4"):
                    assert list(answer["content"]) == ["application/problem+json"], (method, path, status)
    operations = [o["operationId"] for methods in schema["paths"].values() for o in methods.values()]
    assert len(set(operations)) == len(operations)


def test_documentation_from_elsewhere_is_off(client):
    assert client.get("/docs").status_code == 404
    assert client.get("/redoc").status_code == 404


def test_a_data_base_that_is_away_is_503_and_nothing_of_it_is_told(serve, tmp_path):
    settings = Settings(data_dir=tmp_path, database_url="postgresql+psycopg://who:secret@127.0.0.1:1/none")
    with serve(create_app(settings)) as client:
        answer = client.get("/v1/loops")
        assert (answer.status_code, answer.json()["code"]) == (503, "database_away")
        assert answer.headers["retry-after"]
        assert "secret" not in answer.text
        ready = client.get("/readyz")
        assert (ready.status_code, ready.json()["state"]) == (503, "not_ready")
        assert client.get("/healthz").status_code == 200


def test_the_csv_has_the_columns_that_are_asked_for_in_their_order(client):
    answer = client.get("/v1/reliability?format=csv&columns=verdict,loop,%20verdict&sort=-loop")
    lines = list(csv.reader(io.StringIO(answer.text)))
    assert lines[0] == ["verdict", "loop"]
    assert {line[1] for line in lines[1:]} >= {"FIC101", "LIC7"}
    assert all(len(line) == 2 for line in lines)


@pytest.mark.parametrize("query", ["format=csv&columns=loop,colour", "format=csv&columns=", "columns=loop"])
def test_columns_that_there_are_not_or_that_json_has_anyway_are_refused(client, query):
    answer = client.get(f"/v1/reliability?{query}")
    assert (answer.status_code, answer.json()["code"]) == (400, "bad_columns")


def test_a_wrong_method_is_told_every_method_of_the_path(client):
    answer = client.delete("/v1/loops/FIC101")
    assert (answer.status_code, answer.json()["code"]) == (405, "method_not_allowed")
    assert {"GET", "PATCH"} <= set(answer.headers["allow"].split(", "))


def test_a_part_of_a_file_is_not_asked_for_in_bare_text(client):
    answer = client.get("/static/loopaudit.css", headers={"Range": "bytes=9-1"})
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/css")


def test_the_schema_says_where_a_key_is_needed(client):
    paths = client.get("/openapi.json").json()["paths"]
    assert paths["/v1/loops"]["get"]["security"]
    assert {"401", "403", "429"} <= set(paths["/v1/loops/{tag}"]["patch"]["responses"])
    assert "security" not in paths["/healthz"]["get"]


@pytest.mark.parametrize("start", ["20240301", "0.5", "nan", "1e3"])
def test_a_number_is_no_time(client, start):
    answer = client.get("/v1/loops/FIC101/trend", params={"start": start})
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")
    assert client.post("/v1/loops/FIC101/explanations", json={"from": 20240301}).status_code == 422
