"""Explanations over HTTP: what a client sends and gets; what a worker would do is done here by calling its service."""

import json
from datetime import UTC, datetime, timedelta
from urllib.parse import quote

import pytest

from app.cli.explain import as_json
from app.main import create_app
from app.services.backend import Backend
from app.services.explaining import explanations, working
from app.services.explaining.comparisons import Columns, read_comparison
from app.services.explaining.line import explanation_line
from app.services.explaining.simulations import LARGEST_TRACE
from app.services.explaining.working import explain_next
from app.services.intake.reading import read_upload

TAG = 'AREA 1/<b>"TIC" 7%2F'
URL = f"/v1/loops/{quote(TAG, safe='')}/explanations"
N = 300
TIMES = [f"2026-01-01T00:{k // 60:02d}:{k % 60:02d}Z" for k in range(N)]
OP = [50.0 + (k // 20 % 5) * 2.0 + 0.1 * (k * 7 % 5) for k in range(N)]
PV = [20.0 + 0.5 * op + 0.05 * (k * 11 % 7) for k, op in enumerate(OP)]
SIMULATED = [20.0 + 0.5 * op for op in OP]


@pytest.fixture(scope="module")
def backend(open_plant) -> Backend:
    return open_plant(explanation_samples=5000)


@pytest.fixture(scope="module")
def client(serve, backend):
    with serve(create_app(backend.settings)) as connection:
        yield connection


def uploaded(client, backend, body: str, filename: str) -> str:
    answer = client.post("/v1/uploads", params={"filename": filename}, content=body.encode())
    read_upload(backend, int(answer.json()["id"]), owner="test")
    return client.get(answer.headers["location"]).json()["loops"][0]


@pytest.fixture(scope="module")
def tag(client, backend) -> str:
    name = TAG.replace('"', '""')
    rows = "\n".join(f"{time},{pv},{op}" for time, pv, op in zip(TIMES, PV, OP, strict=True))
    return uploaded(client, backend, f'time,"{name}.PV","{name}.OP"\n{rows}\n', "plant.csv")


def test_a_request_says_where_to_ask_and_ends_with_the_answer(client, backend, tag):
    answer = client.post(URL, json={"trace": {"time": TIMES, "values": SIMULATED}})
    assert answer.status_code == 202, answer.text
    asked = answer.json()
    assert answer.headers["location"] == f"{URL}/{asked['id']}"
    assert (asked["state"], asked["loop"], asked["simulation"], asked["verdict"]) == ("open", tag, "trace", None)
    assert client.get(f"{URL}/{asked['id']}/trace").json()["code"] == "not_explained"
    while explain_next(backend, "test"):
        pass
    found = client.get(answer.headers["location"]).json()
    assert (found["state"], found["error_code"]) == ("done", None)
    assert found["verdict"] in ("missing_physics", "consistent", "inconclusive")
    assert set(found["fit"]) >= {"rmse_given", "rmse_refitted", "rmse_explained", "held_out"}
    assert found["model"]["sampling_interval_s"] == 1.0

    trace = client.get(f"{URL}/{asked['id']}/trace")
    assert trace.headers["content-type"].startswith("text/csv")
    assert trace.text.splitlines()[0].startswith("time,PV,PV_given,PV_refitted,PV_explained,residual_given")
    assert len(trace.text.splitlines()) == N + 1
    plot = client.get(f"{URL}/{asked['id']}/plot", params={"points": 100}).json()
    assert len(plot["time_s"]) == len(plot["explained"]) <= 150
    listed = client.get(URL).json()
    assert [row["id"] for row in listed["rows"]] == [asked["id"]]
    assert listed["next_cursor"] is None


@pytest.mark.parametrize(
    ("body", "status", "code"),
    [
        ({"trace": {"time": ["2027-01-01T00:00:00Z", "2027-01-01T00:00:01Z"], "values": [1, 2]}}, 422, "no_overlap"),
        ({"trace": {"values": [1.0, 2.0]}}, 422, "simulation_length"),
        ({"trace": {"values": ["1.0"]}}, 422, "invalid_request"),
        ({"trace": {"values": [None] * N}}, 422, "simulation_not_finite"),
        ({"csv": "time\n1"}, 422, "no_simulation"),
        ({"csv": "time,PV_sim\nnever,1\nor,2"}, 422, "bad_times"),
        ({"column": "PV_sim"}, 400, "no_such_column"),
        ({"model": {"time_constants_s": [1]}}, 422, "model_invalid"),
        ({"model": {"gain": 1.0, "time_constants_s": [-3]}}, 422, "model_invalid"),
        ({"model": {"gain": 1.0, "time_constants_s": [1e30]}}, 422, "model_invalid"),
        ({"model": {"gain": 1.0, "dead_time_s": 1e30}}, 422, "model_invalid"),
        ({"model": {"gain": 10**400}}, 422, "model_invalid"),
        ({"model": {"gain": "nan"}}, 422, "model_invalid"),
        ({"model": {"gain": 1.0, "integrating": "no"}}, 422, "model_invalid"),
        ({"model": {"gain": 1.0}, "column": "x"}, 400, "several_simulations"),
        ({"window_h": 0}, 422, "invalid_request"),
        ({"window_h": 0.01}, 422, "too_short"),
        ({"from": "2026-01-02T00:00:00Z", "to": "2026-01-01T00:00:00Z"}, 400, "bad_window"),
        ({"from": "2020-01-01T00:00:00", "to": "2020-01-02T00:00:00"}, 422, "no_samples"),
        ({"something": 1}, 422, "invalid_request"),
        ([], 422, "invalid_request"),
    ],
)
def test_what_cannot_be_compared_is_a_problem_with_a_code(client, tag, body, status, code):
    answer = client.post(URL, json=body)
    assert (answer.status_code, answer.json()["code"]) == (status, code), answer.text
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("sent", [{}, {"json": {}}, {"headers": {"Content-Type": "application/json"}}])
def test_no_body_asks_for_what_an_empty_one_does(client, tag, sent):
    answer = client.post(URL, **sent)
    assert answer.status_code == 202, answer.text
    assert (answer.json()["loop"], answer.json()["simulation"]) == (tag, client.post(URL, json={}).json()["simulation"])


def test_unknown_loops_and_explanations(client, tag):
    assert client.post("/v1/loops/NOBODY/explanations", json={}).json()["code"] == "unknown_loop"
    assert client.get("/v1/loops/NOBODY/explanations").json()["code"] == "unknown_loop"
    for wrong in ("999", "x", "-1", "9" * 30):
        for part in ("", "/trace", "/plot"):
            answer = client.get(f"{URL}/{wrong}{part}")
            assert (answer.status_code, answer.json()["code"]) == (404, "unknown_explanation")
    assert client.get(URL, params={"cursor": "?"}).json()["code"] == "bad_cursor"


def test_not_a_number_is_refused(client, tag):
    body = '{"trace": {"values": [NaN, Infinity]}}'
    answer = client.post(URL, content=body, headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")


@pytest.mark.parametrize(
    ("half", "code"), [("PV_sim", "no_simulation"), ("time,PV_sim", "simulation_not_finite"), ("", "simulation_length")]
)
def test_half_a_letter_in_a_simulation_is_no_fault(client, tag, half, code):
    """JSON can name it, and no encoding of text has it."""
    rows = "".join(f"{time},\\ud800\\n" for time in TIMES)
    lines = {"PV_sim": "time\\ud800\\n", "time,PV_sim": f"time,PV_sim\\n{rows}", "": "PV_sim\\n\\ud800\\n"}
    body = f'{{"csv": "{lines[half]}"}}'
    answer = client.post(URL, content=body, headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["code"]) == (422, code), answer.text


@pytest.mark.parametrize("name", ["P\x07V", "PV_\x07", "TIC7\0.PV"])
def test_control_characters_in_the_name_of_a_simulated_column_are_no_fault(client, tag, name):
    rows = "".join(f"{time},{value}\n" for time, value in zip(TIMES, SIMULATED, strict=True))
    answer = client.post(URL, json={"csv": f"time,{name}\n{rows}"})
    assert (answer.status_code, answer.json().get("simulation")) == (202, "trace"), answer.text


@pytest.mark.parametrize("model", ['{"gain": NaN}', '{"gain": 1.0, "name": NaN}', '{"gain": 1.0, "name": [-Infinity]}'])
def test_a_model_with_no_number_is_refused(client, tag, model):
    body = f'{{"model": {model}}}'
    answer = client.post(URL, content=body, headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["code"]) == (422, "model_invalid"), answer.text


def test_a_body_that_is_too_large(client, tag):
    answer = client.post(URL, json={"csv": "x" * (10 << 20)})
    assert (answer.status_code, answer.json()["code"]) == (413, "body_too_large")
    answer = client.post(URL, json={"trace": {"values": [0] * 200_001}})
    assert (answer.status_code, answer.json()["code"]) == (413, "simulation_too_large")


def test_the_longest_trace_can_be_sent(client):
    begin = datetime(2026, 1, 1, tzinfo=UTC)
    times = [(begin + timedelta(seconds=k)).isoformat().replace("+00:00", "Z") for k in range(LARGEST_TRACE)]
    trace = {"values": [50.123456 + k % 7 for k in range(LARGEST_TRACE)], "time": times}
    body = json.dumps({"trace": trace})
    assert len(body) > 6e6
    answer = client.post("/v1/loops/none/explanations", content=body, headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["code"]) == (404, "unknown_loop")  # read, and nothing to compare it with


# The page


def test_the_button_asks_once(client, backend):
    for name, op in (("TIC1", lambda k: k % 7), ("FLAT", lambda k: 1)):
        rows = "\n".join(f"{k},{k % 5},{op(k)}" for k in range(200))
        uploaded(client, backend, f"time,PV,OP\n{rows}\n", f"{name}.csv")
    assert "has been compared" in client.get("/loops/TIC1").text
    for _ in range(2):
        answer = client.post("/loops/TIC1/explanations")
        assert (answer.status_code, answer.headers["location"]) == (303, "/loops/TIC1#explanation")
    assert len(explanations.list_explanations(backend, "TIC1").rows) == 1
    shown = client.get("/loops/TIC1").text.partition('id="explanation"')[2].partition("</section>")[0]
    assert 'data-state="open"' in shown
    assert "<button" not in shown
    assert 'data-state="open"' in client.get("/loops/TIC1/explanation").text
    refused = client.post("/loops/FLAT/explanations")
    assert (refused.status_code, "OP is constant" in refused.text) == (422, True)
    assert client.post("/loops/NOBODY/explanations").status_code == 404


# Three cases of different kinds: a limit in time, a friction, nothing at all.
@pytest.mark.shared
@pytest.mark.parametrize("case", ["case000", "case003", "case005"])
def test_a_recording_over_http_gets_the_answer_of_the_command_line(client, backend, shared_dir, case):
    path = shared_dir / "concealed" / f"{case}.csv"
    if not path.is_file():
        pytest.skip("no folder ../shared/concealed beside the project")
    loop = uploaded(client, backend, path.read_text(), path.name)
    asked = client.post(f"/v1/loops/{loop}/explanations", json={}).json()
    assert asked["simulation"] == "column"
    while explain_next(backend, "test"):
        pass
    found = client.get(f"/v1/loops/{loop}/explanations/{asked['id']}").json()
    comparison = read_comparison(path, Columns(), "PV_sim")
    expected = json.loads(as_json(explanation_line(working.explain(comparison), simulation="column")))
    assert {name: found[name] for name in expected if name != "elapsed_s"} == {
        name: value for name, value in expected.items() if name != "elapsed_s"
    }
