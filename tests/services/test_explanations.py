"""From a request to its answer: what is told at once, what a worker finds, and what a night asks for."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from typing import Any, NoReturn

import numpy as np
import pytest
from sqlalchemy import Connection, update
from sqlalchemy.exc import OperationalError

from app.engine.mismatch import Comparison
from app.engine.signals.turning import since_reversal
from app.errors import DataError, LoopauditError, NotFoundError, RequestError
from app.services.auditing import audits, chunks
from app.services.backend import Backend
from app.services.explaining import explanations
from app.services.explaining import traces as explanation_traces
from app.services.explaining import working as explaining
from app.services.explaining.explanations import Wanted
from app.services.explaining.simulations import GivenSimulation, GivenTrace
from app.services.plant import loop_verdicts
from app.services.upkeep.sweep import sweep
from app.settings import Settings
from app.storage import explanations as stored
from app.storage import loops
from app.storage.samples import Samples
from app.storage.tables import explanations as explanations_table
from tests.services.explained_loops import (
    GAIN,
    INTERVAL_S,
    START,
    START_NS,
    TAU_S,
    N,
    keep,
    linear,
    model,
    record,
)
from tests.services.spoiled import loop_id_of, spoil


def instants(n: int = N) -> list[datetime]:
    return [START + timedelta(seconds=INTERVAL_S * k) for k in range(n)]


def trace(values: np.ndarray, time: list[datetime] | list[float] | None = None) -> Wanted:
    return Wanted(simulation=GivenSimulation(trace=GivenTrace(values.tolist(), time)))


def code_of(call: Callable[[], Any]) -> str:
    with pytest.raises(LoopauditError) as raised:
        call()
    return raised.value.code


def test_a_sample_ahead_of_the_clock_is_no_end_of_a_window(backend: Backend) -> None:
    """A window of some hours back from the newest sample held that one alone, and was refused."""
    keep(backend, "TIC1", record())
    ahead = {name: values[-1:] for name, values in record().items()}
    keep(backend, "TIC1", ahead, start_ns=2_000_000_000 * 10**9)
    for wanted in (Wanted(), Wanted(window_h=1.0)):
        asked = explanations.ask(backend, "TIC1", wanted)
        assert asked["window_end"] == "2026-03-01T01:06:30Z"


def test_a_step_of_the_sensor_is_found_against_a_trace(backend: Backend) -> None:
    signals = record(step=5.0)
    keep(backend, "TIC1", signals)
    asked = explanations.ask(backend, "TIC1", trace(linear(signals["op"]), instants()), asked_by="an engineer")
    assert (asked["state"], asked["simulation"], asked["verdict"], asked["effects"]) == ("open", "trace", None, [])
    assert (asked["window_start"], asked["asked_by"]) == ("2026-03-01T00:00:00Z", "an engineer")
    assert explaining.explain_next(backend, "w")
    assert not explaining.explain_next(backend, "w")
    found = explanations.get_explanation(backend, "TIC1", asked["id"])
    assert (found["state"], found["verdict"], found["recording"]) == ("done", "missing_physics", "TIC1")
    assert found["effect_codes"] == [effect["effect"] for effect in found["effects"]]
    assert found["effect_codes"][0] in ("sensor.step", "disturbance.step")
    assert found["fit"]["rmse_explained"] < 0.2 * found["fit"]["rmse_given"]
    assert found["located"]["windows"][0][0] == pytest.approx(N / 2 * INTERVAL_S, abs=5 * INTERVAL_S)


@pytest.mark.parametrize(
    "time",
    [
        instants(),
        [moment.replace(tzinfo=None) for moment in instants()],
        [float(INTERVAL_S * k) for k in range(N)],
        [START.timestamp() + INTERVAL_S * k for k in range(N)],
        None,
    ],
    ids=["instants", "instants of the plant", "from the start", "since 1970", "one a sample"],
)
def test_times_of_a_trace_may_be_told_in_any_of_these_ways(backend: Backend, time: Any) -> None:
    signals = record()
    keep(backend, "TIC1", signals)
    simulated = linear(signals["op"])
    explanations.ask(backend, "TIC1", trace(simulated, time))
    assert compared(backend) == pytest.approx(simulated, abs=1e-9)


def next_comparison(backend: Backend) -> Comparison:
    """What the next worker would be given."""
    with backend.database.write() as connection:
        claim = stored.claim_next(connection, "w", 60.0)
    task = explaining._load(backend, claim)
    return explaining.comparison_with(task.loop, task.samples, task.simulation)


def compared(backend: Backend) -> np.ndarray:
    return next_comparison(backend).trace


@pytest.mark.parametrize("stamp", ["%Y-%m-%dT%H:%M:%SZ", "%Y-%m-%d %H:%M:%S"])
def test_a_trace_may_come_as_csv(backend: Backend, stamp: str) -> None:
    signals = record()
    keep(backend, "TIC1", signals)
    simulated = linear(signals["op"])
    rows = [f"{moment:{stamp}};{value!r}" for moment, value in zip(instants(), simulated.tolist(), strict=True)]
    text = "time;PV_sim\n" + "\n".join(rows)
    explanations.ask(backend, "TIC1", Wanted(simulation=GivenSimulation(csv=text)))
    assert compared(backend) == pytest.approx(simulated, abs=1e-9)


@pytest.mark.parametrize(("decimals", "notes"), [(3, ["numbers_in_doubt"]), (4, [])])
def test_numbers_of_a_csv_that_may_be_read_in_two_ways_are_told(
    backend: Backend, decimals: int, notes: list[str]
) -> None:
    signals = record()
    keep(backend, "TIC1", signals)
    simulated = linear(signals["op"])
    told = zip(instants(), simulated, strict=True)
    text = "\n".join(["t;PV_sim", *(f"{moment:%Y-%m-%dT%H:%M:%SZ};{value:.{decimals}f}" for moment, value in told)])
    explanations.ask(backend, "TIC1", Wanted(simulation=GivenSimulation(csv=text)))
    comparison = next_comparison(backend)
    assert comparison.trace == pytest.approx(simulated, abs=1e-3)
    assert [note.code for note in comparison.notes] == notes
    assert all("read as decimals: PV_sim" in note.text for note in comparison.notes)


def test_a_recorded_column_is_the_simulation_and_no_measurement(backend: Backend) -> None:
    signals = record()
    simulated = linear(signals["op"])
    keep(backend, "TIC1", {**signals, "tag:PV_sim": simulated, "tag:TWIN": simulated + 1.0})
    first = explanations.ask(backend, "TIC1")
    second = explanations.ask(backend, "TIC1", Wanted(simulation=GivenSimulation(column="twin")))
    third = explanations.ask(backend, "TIC1", model(gain=GAIN, time_constants_s=[TAU_S]))
    assert [asked["simulation"] for asked in (first, second, third)] == ["column", "column", "model"]
    names = []
    for expected in (simulated, simulated + 1.0, None):
        with backend.database.write() as connection:
            task = explaining._load(backend, stored.claim_next(connection, "w", 60.0))
        found = explaining.comparison_with(task.loop, task.samples, task.simulation)
        names.append([name for name, _ in found.measured])
        assert found.trace is None if expected is None else np.allclose(found.trace, expected)
    assert names == [["TWIN"], [], ["TWIN"]]


def test_what_is_wrong_is_told_at_once(backend: Backend) -> None:
    signals = record()
    keep(backend, "TIC1", signals)
    keep(backend, "FLAT", {**signals, "op": np.full(N, 50.0)})
    keep(backend, "SHORT", record(n=60))
    with backend.database.write() as connection:
        loops.ensure(connection, ["EMPTY"])
    simulated = linear(signals["op"])
    later = [moment + timedelta(days=2) for moment in instants()]

    def ask(wanted: Wanted, tag: str = "TIC1") -> Callable[[], Any]:
        return lambda: explanations.ask(backend, tag, wanted)

    def csv(text: str) -> Wanted:
        return Wanted(simulation=GivenSimulation(csv=text))

    before_any = Wanted(end=datetime(1, 1, 1, tzinfo=UTC), window_h=65_839.0)
    column = Wanted(simulation=GivenSimulation(column="nothing"))
    two = Wanted(simulation=GivenSimulation(column="x", model={"gain": 1.0}))
    expected = {
        "unknown_loop": [ask(Wanted(), "NOBODY")],
        "no_samples": [ask(Wanted(), "EMPTY"), ask(Wanted(end=START - timedelta(days=9))), ask(before_any)],
        "too_short": [ask(Wanted(), "SHORT"), ask(Wanted(window_h=0.1))],
        "signal_constant": [ask(Wanted(), "FLAT")],
        "no_overlap": [ask(trace(simulated, later))],
        "simulation_length": [
            ask(trace(simulated[:-1])),
            ask(trace(simulated[:-50], instants()[:-50])),
            ask(trace(simulated, instants()[:-1])),
        ],
        "simulation_not_finite": [ask(trace(np.array([]), []))],
        "simulation_too_large": [ask(trace(np.zeros(200_001)))],
        "bad_times": [ask(trace(simulated, [np.inf] * N)), ask(csv("time,PV_sim\nx,1\ny,2"))],
        "not_a_table": [ask(csv(""))],
        "no_simulation": [ask(csv("time\n1\n2"))],
        "no_such_column": [ask(column)],
        "several_simulations": [ask(two)],
        "model_invalid": [
            ask(model(time_constants_s=[1])),
            ask(model(gain=0.0)),
            ask(model(gain=1.0, time_constants_s=[1, 2, 3])),
            ask(model(gain=float("inf"))),
            ask(model(gain=1.0, dead_time_s=-1)),
        ],
        "bad_window": [
            ask(Wanted(start=START, end=START)),
            ask(Wanted(start=START, window_h=1.0)),
            ask(Wanted(window_h=float("nan"))),
        ],
    }
    found = {code: [code_of(call) for call in calls] for code, calls in expected.items()}
    assert found == {code: [code] * len(calls) for code, calls in expected.items()}
    assert explanations.list_explanations(backend, "TIC1").rows == []


def test_a_window_may_be_told_by_its_ends_or_its_length(backend: Backend) -> None:
    keep(backend, "TIC1", record())
    whole = explanations.ask(backend, "TIC1")
    cut = explanations.ask(backend, "TIC1", Wanted(START + timedelta(minutes=10), START + timedelta(minutes=40)))
    hour = explanations.ask(backend, "TIC1", Wanted(window_h=0.5))
    windows = [(asked["window_start"][11:19], asked["window_end"][11:19]) for asked in (whole, cut, hour)]
    assert windows == [("00:00:00", "01:06:30"), ("00:10:00", "00:40:00"), ("00:36:30", "01:06:30")]


def test_a_window_with_too_many_samples(backend: Backend) -> None:
    settings = backend.settings.model_copy(update={"explanation_samples": 200})
    small = Backend(settings, backend.database, backend.queue)
    keep(small, "TIC1", record())
    assert explanations.ask(small, "TIC1")["window_start"] == "2026-03-01T00:33:20Z"
    with pytest.raises(DataError, match="400 samples, at most 200"):
        explanations.ask(small, "TIC1", Wanted(start=START))


def test_a_first_answer_comes_before_the_whole(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    signals = record(step=5.0)
    keep(backend, "TIC1", signals)
    asked = explanations.ask(backend, "TIC1", trace(linear(signals["op"])))
    assert asked["located"] is None
    seen, explain = [], explaining.explain

    def watched(comparison: Any) -> Any:
        seen.append(explanations.get_explanation(backend, "TIC1", asked["id"]))
        return explain(comparison)

    monkeypatch.setattr(explaining, "explain", watched)
    explaining.explain_next(backend, "w")
    assert seen[0]["state"] == "open"
    assert seen[0]["located"]["windows"]
    assert (seen[0]["fit"], seen[0]["verdict"]) == (None, None)
    assert explanations.get_explanation(backend, "TIC1", asked["id"])["fit"]["rmse_explained"] > 0


def test_an_explanation_that_is_asked_for_stands_with_its_answer(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise a database that goes away in between is told as `nothing was changed`, and it is asked for twice."""
    signals, write = record(step=5.0), backend.database.write
    keep(backend, "TIC1", signals)
    wanted = trace(linear(signals["op"]), instants())

    def away() -> NoReturn:
        raise OperationalError("SELECT 1", {}, Exception("the server is away"))

    @contextmanager
    def last() -> Iterator[Connection]:
        with write() as connection:
            yield connection
        monkeypatch.setattr(backend.database, "read", away)
        monkeypatch.setattr(backend.database, "write", away)

    monkeypatch.setattr(backend.database, "write", last)
    asked = explanations.ask(backend, "TIC1", wanted)
    monkeypatch.undo()
    assert asked == explanations.get_explanation(backend, "TIC1", asked["id"])


def test_who_lost_the_claim_writes_nothing(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    keep(backend, "TIC1", record())
    asked, explain = explanations.ask(backend, "TIC1"), explaining.explain

    def overtaken(comparison: Any) -> Any:
        with backend.database.write() as connection:
            connection.execute(update(explanations_table).values(owner="other", attempts=2))
        return explain(comparison)

    monkeypatch.setattr(explaining, "explain", overtaken)
    explaining.explain_next(backend, "w")
    found = explanations.get_explanation(backend, "TIC1", asked["id"])
    assert (found["state"], found["fit"]) == ("open", None)


@pytest.mark.parametrize(
    ("raised", "code"),
    [(ValueError("odd"), "fault"), (DataError("model_invalid", "none"), "model_invalid"), (MemoryError(), "memory")],
)
def test_what_cannot_be_explained_fails_with_a_code(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, raised: Exception, code: str
) -> None:
    keep(backend, "TIC1", record())
    asked = explanations.ask(backend, "TIC1")

    def fails(comparison: Any) -> Any:
        raise raised

    monkeypatch.setattr(explaining, "explain", fails)
    explaining.explain_next(backend, "w")
    found = explanations.get_explanation(backend, "TIC1", asked["id"])
    assert (found["state"], found["error_code"], found["located"]) == ("failed", code, None)
    assert code_of(lambda: explanation_traces.trace_csv(backend, "TIC1", asked["id"])) == "not_explained"


def test_a_damaged_simulation_fails_at_the_first_attempt(backend: Backend) -> None:
    """Retried, it would only lose one worker's time after another, and be told as `worker_lost`."""
    keep(backend, "TIC1", record())
    asked = explanations.ask(backend, "TIC1", model(gain=GAIN, time_constants_s=[TAU_S]))
    with backend.database.write() as connection:
        connection.execute(update(explanations_table).values(simulation_packed=b"\x01damaged"))
    assert explaining.explain_next(backend, "w")
    found = explanations.list_explanations(backend, "TIC1").rows[0]
    assert (found["id"], found["state"], found["error_code"]) == (asked["id"], "failed", "fault")


# Where the alarm hits while memory is tidied up, Python passes over it; it rings again.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_explanation_that_takes_too_long_is_cut_off(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    keep(backend, "TIC1", record())
    asked = explanations.ask(backend, "TIC1")

    def forever(comparison: Any) -> Any:
        while True:
            os.getpid()

    monkeypatch.setattr(explaining, "explain", forever)
    quick = Backend(backend.settings.model_copy(update={"explanation_limit_s": 2.0}), backend.database, backend.queue)
    explaining.explain_next(quick, "w")
    assert explanations.get_explanation(backend, "TIC1", asked["id"])["error_code"] == "time_limit"


def test_the_trace_is_that_of_the_command_line_and_the_plot_is_thinner(backend: Backend) -> None:
    signals = record(step=5.0)
    keep(backend, "TIC1", signals)
    asked = explanations.ask(backend, "TIC1", trace(linear(signals["op"])))
    explaining.explain_next(backend, "w")
    lines = explanation_traces.trace_csv(backend, "TIC1", asked["id"]).splitlines()
    header = lines[0].split(",")
    assert header[:5] == ["time", "PV", "PV_given", "PV_refitted", "PV_explained"]
    values = np.array([[float(value) for value in line.split(",")] for line in lines[1:]])
    assert values.shape == (N, len(header))
    assert values[:, 1] == pytest.approx(signals["pv"], rel=1e-7)
    residual = header.index("residual_explained")
    assert values[:, residual] == pytest.approx(values[:, 1] - values[:, 4], abs=1e-6)
    found = explanation_traces.plot(backend, "TIC1", asked["id"], points=60)
    assert 20 < len(found["time_s"]) <= 60
    assert found["start"] == "2026-03-01T00:00:00Z"
    assert len(found["trigger"]) == len(found["residual_after"]) <= 60
    assert np.ptp(found["residual_after"]) < np.ptp(found["residual_before"])


def test_lists_are_newest_first_and_know_their_loop(backend: Backend) -> None:
    keep(backend, "TIC1", record())
    keep(backend, "TIC2", record())
    asked = [explanations.ask(backend, "TIC1")["id"] for _ in range(3)]
    other = explanations.ask(backend, "TIC2")["id"]
    first = explanations.list_explanations(backend, "TIC1", limit=2)
    rest = explanations.list_explanations(backend, "TIC1", limit=2, cursor=first.next_cursor)
    assert [row["id"] for row in (*first.rows, *rest.rows)] == asked[::-1]
    assert rest.next_cursor is None
    with pytest.raises(NotFoundError):
        explanations.get_explanation(backend, "TIC1", other)
    with pytest.raises(RequestError):
        explanations.list_explanations(backend, "TIC1", cursor="x")


def test_the_sweeper_gives_lost_work_to_others(backend: Backend) -> None:
    keep(backend, "TIC1", record())
    asked = explanations.ask(backend, "TIC1")
    for _ in range(backend.settings.max_attempts):
        with backend.database.write() as connection:
            assert stored.claim_next(connection, "dead", -1.0)
        sweep(backend)
    found = explanations.get_explanation(backend, "TIC1", asked["id"])
    assert (found["state"], found["error_code"]) == ("failed", "worker_lost")


def test_a_night_explains_its_worst_loops_once(backend: Backend, add_loops: Callable[..., dict[str, int]]) -> None:
    add_loops("FIC1", "FIC2", "FIC3")
    two = Backend(backend.settings.model_copy(update={"nightly_explanations": 2}), backend.database, backend.queue)
    run = audits.start_audit(backend, trigger="nightly")
    assert sweep(two).announced == 0
    while chunks.audit_chunk(backend, int(run.id), "w"):
        pass
    assert sweep(two).announced == 2
    assert sweep(two).announced == 0
    tags = ("FIC1", "FIC2", "FIC3")
    asked = [row for tag in tags for row in explanations.list_explanations(backend, tag).rows]
    assert [(row["state"], row["audit_id"]) for row in asked] == [("open", run.id)] * 2
    found = loop_verdicts.loop_health(backend, asked[0]["loop"])
    assert (asked[0]["window_start"], asked[0]["window_end"]) == (found["window_start"], found["window_end"])
    assert len(compared_samples(backend)) == 300


def compared_samples(backend: Backend) -> Samples:
    with backend.database.write() as connection:
        return explaining._load(backend, stored.claim_next(connection, "w", 60.0)).samples


def test_a_night_may_explain_nothing(backend: Backend, add_loops: Callable[..., dict[str, int]]) -> None:
    add_loops("FIC1")
    run = audits.start_audit(backend, trigger="nightly")
    chunks.audit_chunk(backend, int(run.id), "w")
    none = Backend(backend.settings.model_copy(update={"nightly_explanations": 0}), backend.database, backend.queue)
    assert sweep(none).announced == 0


def test_travel_since_a_reversal() -> None:
    op = np.array([0.0, 1.0, 2.0, 1.95, 2.0, 3.0, 1.0, 0.0, 2.0])
    assert since_reversal(op) == pytest.approx([0.0, 1.0, 2.0, 1.95, 2.0, 3.0, -2.0, -3.0, 2.0])


def test_the_watchdog_ends_before_the_task_does() -> None:
    from app.services.auditing.limits import WATCHDOG_AFTER
    from app.settings import TASK_LIMIT_S

    longest = next(m.le for m in Settings.model_fields["explanation_limit_s"].metadata if hasattr(m, "le"))
    assert WATCHDOG_AFTER * longest < TASK_LIMIT_S


def test_of_a_window_with_a_damaged_stretch_the_rest_is_explained(backend: Backend) -> None:
    signals = record(step=5.0, n=500)
    keep(backend, "TIC1", {name: values[:400] for name, values in signals.items()})
    later_ns = START_NS + 400 * INTERVAL_S * 1_000_000_000
    keep(backend, "TIC1", {name: values[400:] for name, values in signals.items()}, later_ns)
    spoil(backend, loop_id_of(backend, "TIC1"), later_ns)
    asked = explanations.ask(backend, "TIC1", model(gain=GAIN, time_constants_s=[TAU_S]))
    while explaining.explain_next(backend, "test"):
        pass
    found = explanations.get_explanation(backend, "TIC1", asked["id"])
    assert (found["state"], found["verdict"]) == ("done", "missing_physics")
    told = {reason["code"]: reason["text"] for reason in found["evidence"]}
    assert told["samples_damaged"].startswith("What was stored from 2026-03-01 01:06 to 2026-03-01 01:2")
    spoil(backend, loop_id_of(backend, "TIC1"), START_NS)
    assert code_of(lambda: explanations.ask(backend, "TIC1")) == "damaged_samples"
    again = explanations.get_explanation(backend, "TIC1", asked["id"])
    assert again["state"] == "done"


def test_samples_that_are_damaged_after_the_request_end_it_with_a_reason(backend: Backend) -> None:
    keep(backend, "TIC1", record())
    asked = explanations.ask(backend, "TIC1")
    spoil(backend, loop_id_of(backend, "TIC1"), START_NS)
    while explaining.explain_next(backend, "test"):
        pass
    found = explanations.get_explanation(backend, "TIC1", asked["id"])
    assert (found["state"], found["error_code"]) == ("failed", "damaged_samples")
    assert "cannot be read" in found["error_text"]


def test_no_more_explanations_wait_than_anybody_looks_at(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(explanations, "MOST_OPEN", 2)
    keep(backend, "TIC1", record())
    for _ in range(2):
        explanations.ask(backend, "TIC1")
    assert code_of(lambda: explanations.ask(backend, "TIC1")) == "too_many_open"
    with backend.database.write() as connection:
        connection.execute(update(explanations_table).values(state="failed"))
    assert explanations.ask(backend, "TIC1")["state"] == "open"
