"""`loopaudit explain` answers in the contract's form, and says what is wrong with what it cannot read."""

import json
import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli.explain import as_text
from app.cli.main import cli
from app.errors import DataError, LoopauditError
from app.services.explaining.line import LINE_FIELDS
from app.services.explaining.wording import HELD, NO_SIZE, RANGES
from tests.engine.wandering import STICKY, TS, recorded

runner = CliRunner()


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A loop whose sensor stuck for a while, with the engineer's simulation beside it."""
    rng = np.random.default_rng(1)
    n = 600
    op = np.repeat(rng.uniform(40.0, 60.0, n // 40), 40)
    pv = np.full(n, 50.0)
    for t in range(1, n):
        pv[t] = 0.9 * pv[t - 1] + 0.1 * (50.0 + 0.8 * (op[t - 1] - 50.0))
    sim = pv.copy()
    pv = pv + 0.1 * rng.normal(size=n)
    pv[300:340] = pv[299]
    path = tmp_path_factory.mktemp("explain") / "FIC1.csv"
    columns = np.stack((np.arange(n), np.full(n, 50.0), op, pv, sim), axis=1)
    np.savetxt(path, columns, fmt="%.5f", delimiter=",", header="time,SP,OP,PV,PV_sim", comments="")
    return path


def test_json_has_the_form_of_the_contract(recording: Path, tmp_path: Path) -> None:
    trace, plot = tmp_path / "trace.csv", tmp_path / "plot.html"
    options = ["--sim", "PV_sim", "--format", "json", "--trace", str(trace), "--plot", str(plot)]
    result = runner.invoke(cli, ["explain", str(recording), *options])
    assert result.exit_code == 0, result.output
    line = json.loads(result.stdout)
    assert line["recording"] == "FIC1"
    assert line["verdict"] == "missing_physics"
    assert line["effects"][0]["effect"] == "sensor.stuck"
    assert line["effects"][0]["windows"] == [[300.0, 340.0]]
    assert set(line["fit"]) >= {"rmse_given", "rmse_refitted", "rmse_explained", "held_out"}
    assert line["validation"] is None
    assert trace.read_text().startswith("time,PV,PV_given,PV_refitted,PV_explained")
    assert "plotly" in plot.read_text(encoding="utf-8")[:20000].lower()


def written_to(path: Path, pv: Callable[[int], object], n: int) -> Path:
    rows = "".join(f"{t},50,{pv(t)},{40 + t % 9}\n" for t in range(n))
    path.write_text(f"time,SP,PV,OP\n{rows}")
    return path


@pytest.mark.parametrize(
    ("pv", "n", "code"),
    [
        (lambda t: 50, 400, "signal_constant"),
        (lambda t: 50 + t % 7, 20, "too_short"),
        (lambda t: "", 400, "not_numeric"),
    ],
)
@pytest.mark.parametrize("options", [[], ["--quick"], ["--sim-model", '{"gain": 1, "time_constants_s": [5]}']])
def test_a_recording_that_cannot_be_compared_is_answered_in_json_too(
    recording: Path, tmp_path: Path, pv: Callable[[int], object], n: int, code: str, options: list[str]
) -> None:
    poor, trace = written_to(tmp_path / "FIC7.csv", pv, n), tmp_path / "trace.csv"
    asked = options if "--quick" in options else [*options, "--validate", str(recording), "--trace", str(trace)]
    result = runner.invoke(cli, ["explain", str(poor), "--format", "json", *asked])
    assert isinstance(result.exception, LoopauditError)  # on stderr and as exit code 2
    line = json.loads(result.stdout)
    assert set(line) == set(LINE_FIELDS)
    assert (line["recording"], line["verdict"], line["effects"]) == ("FIC7", "inconclusive", [])
    assert [reason["code"] for reason in line["evidence"]] == [code] == [result.exception.code]
    assert line["located"]["block"] is line["fit"]["rmse_explained"] is None
    assert line["simulation"] == ("model" if "--sim-model" in options else "identified")
    assert not trace.exists()
    assert runner.invoke(cli, ["explain", str(poor), *options]).stdout == ""


def simulated(t: int) -> float:
    return 50 + t % 7 + t % 13 / 5


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("", "empty_file"),
        ("hello\n", "no_pv_op"),
        ("time,SP,PV,OP\n", "not_numeric"),
        *(
            ("time,PV,OP,PV_sim\n" + "".join(f"{t},{pv(t)},{40 + t % 9},{sim(t)}\n" for t in range(400)), code)
            for pv, sim, code in [
                (simulated, lambda t: 50, "simulation_constant"),
                (simulated, simulated, "simulation_is_pv"),
                (simulated, lambda t: "", "simulation_not_finite"),
            ]
        ),
    ],
)
@pytest.mark.parametrize("options", [[], ["--quick"]])
def test_whatever_of_the_data_cannot_be_compared_is_answered_in_json(
    tmp_path: Path, text: str, code: str, options: list[str]
) -> None:
    """A recording, its simulation or the file as a whole; how the command was called is told on stderr alone."""
    poor = tmp_path / "FIC7.csv"
    poor.write_text(text)
    result = runner.invoke(cli, ["explain", str(poor), "--format", "json", *options])
    assert isinstance(result.exception, LoopauditError)
    line = json.loads(result.stdout)
    assert (set(line), line["recording"], line["verdict"]) == (set(LINE_FIELDS), "FIC7", "inconclusive")
    assert [reason["code"] for reason in line["evidence"]] == [code] == [result.exception.code]


@pytest.mark.parametrize(
    ("where", "options"),
    [
        ("app.services.explaining.files.check", []),
        ("app.engine.mismatch.explain", []),
        ("app.engine.mismatch.locate", ["--quick"]),
    ],
)
def test_whatever_step_finds_it_is_answered_in_json_too(
    recording: Path, monkeypatch: pytest.MonkeyPatch, where: str, options: list[str]
) -> None:
    def refuse(*_: object) -> None:
        raise DataError("signal_too_large", "SP has a value of 1e+101")

    monkeypatch.setattr(where, refuse)
    line = json.loads(runner.invoke(cli, ["explain", str(recording), "--format", "json", *options]).stdout)
    assert line["evidence"] == [{"code": "signal_too_large", "text": "SP has a value of 1e+101"}]


@pytest.mark.parametrize("n", [20, 400])
@pytest.mark.parametrize("options", [[], ["--quick"], ["--sim", "PV_sim"]])
def test_a_simulation_beside_a_recording_that_cannot_be_compared_is_told_as_such(
    tmp_path: Path, n: int, options: list[str]
) -> None:
    poor = tmp_path / "FIC7.csv"
    rows = "".join(f"{t},50,50,{40 + t % 9},{50 + t % 7}\n" for t in range(n))
    poor.write_text(f"time,SP,PV,OP,PV_sim\n{rows}")
    line = json.loads(runner.invoke(cli, ["explain", str(poor), "--format", "json", *options]).stdout)
    assert (line["verdict"], line["simulation"]) == ("inconclusive", "column")


def test_a_second_recording_that_cannot_be_compared_is_not_said_of_the_first(recording: Path, tmp_path: Path) -> None:
    poor = written_to(tmp_path / "FIC7.csv", lambda t: 50 + t % 7, 20)
    result = runner.invoke(cli, ["explain", str(recording), "--format", "json", "--validate", str(poor)])
    assert (result.exception.code, result.stdout) == ("too_short", "")


def test_a_second_recording_that_is_of_no_use_in_the_end_is_not_said_of_the_first_either(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise DataError("signal_missing", "the second recording lacks the signals of valve")

    monkeypatch.setattr("app.engine.mismatch.second_recording.validate", refuse)
    second = other_recording(recording, tmp_path, columns=4)
    result = runner.invoke(cli, ["explain", str(recording), "--format", "json", "--validate", str(second)])
    assert isinstance(result.exception, DataError)
    assert (result.exception.code, result.stdout) == ("signal_missing", "")


@pytest.mark.parametrize(
    ("options", "code"),
    [
        (["--sim", "NO_SUCH"], "no_such_column"),
        (["--op", "NO_SUCH"], "no_such_column"),
        (["--sim", "PV_sim", "--sim-model", '{"gain": 1}'], "several_simulations"),
        (["--validate-op", "FOO"], "no_validation"),
        (["--quick", "--plot", "plot.svg"], "quick_alone"),
        (["--quick", "--trace", "trace.csv"], "quick_alone"),
        (["--quick", "--validate", "other.csv"], "quick_alone"),
        (["--sim", "PV_sim", "--judged"], "judged_alone"),
        (["--sim-model", "{}"], "model_invalid"),
        (["--sim-model", '{"plant": {"K": 1}}'], "model_invalid"),
        (["--sim-model", '{"gain": NaN}'], "model_invalid"),
        (["--sim-model", '{"gain": 1, "time_constants_s": [-5]}'], "model_invalid"),
        (["--sim-model", '{"gain": 1, "time_constants_s": [Infinity]}'], "model_invalid"),
        (["--sim-model", '{"gain": 1, "dead_time_s": 1e9}', "--quick"], "model_invalid"),
        (["--sim-model", '{"gain": 1, "controller": {}}'], "model_invalid"),
        (["--sim-model", '{"gain": 1, "controller": 3}'], "model_invalid"),
        (["--sim-model", '{"gain": 1, "controller": {"gain": 0}}'], "model_invalid"),
        (["--sim-model", '{"gain": 1, "controller": {"gain": 1, "integral_time_s": "fast"}}'], "model_invalid"),
        (["--sim-model", f'{{"gain": 1{"0" * 400}}}'], "model_invalid"),
    ],
)
def test_what_cannot_be_done_is_said(recording: Path, options: list[str], code: str) -> None:
    result = runner.invoke(cli, ["explain", str(recording), *options])
    assert isinstance(result.exception, LoopauditError)
    assert result.exception.code == code


def test_a_model_that_was_written_is_simulated_to_the_same_trace(recording: Path, tmp_path: Path) -> None:
    model, trace, again = tmp_path / "model.json", tmp_path / "trace.csv", tmp_path / "again.csv"
    options = ["--sim", "PV_sim", "--model", str(model), "--trace", str(trace), "--plot", str(tmp_path / "p.svg")]
    assert runner.invoke(cli, ["explain", str(recording), *options]).exit_code == 0
    options = ["--model", str(model), "--recording", str(recording), "--out", str(again)]
    result = runner.invoke(cli, ["simulate", *options])
    assert result.exit_code == 0, result.output
    explained = np.genfromtxt(trace, delimiter=",", names=True)["PV_explained"]
    assert np.genfromtxt(again, delimiter=",", names=True)["PV"] == pytest.approx(explained, rel=1e-6)
    assert (tmp_path / "p.svg").read_text(encoding="utf-8").startswith("<svg")


def test_a_model_that_was_written_may_be_the_simulation(recording: Path, tmp_path: Path) -> None:
    """Its own trace is what it is compared by, at once from the answer that holds it too."""
    model, answer, trace = tmp_path / "model.json", tmp_path / "answer.json", tmp_path / "trace.csv"
    first = ["--sim", "PV_sim", "--format", "json", "--model", str(model), "--trace", str(trace)]
    answered = runner.invoke(cli, ["explain", str(recording), *first])
    answer.write_text(answered.stdout)
    explained = np.genfromtxt(trace, delimiter=",", names=True)["PV_explained"]
    for written in (model, answer):
        options = ["--sim-model", str(written), "--format", "json", "--trace", str(trace)]
        result = runner.invoke(cli, ["explain", str(recording), *options])
        assert result.exit_code == 0, result.output
        given = np.genfromtxt(trace, delimiter=",", names=True)["PV_given"]
        assert given == pytest.approx(explained, rel=1e-6)


def test_a_model_is_simulated_along_local_times(recording: Path, tmp_path: Path) -> None:
    """The hour that comes twice is no hole."""
    model, again = tmp_path / "model.json", tmp_path / "again.csv"
    assert runner.invoke(cli, ["explain", str(recording), "--model", str(model)]).exit_code == 0
    start = datetime(2024, 10, 27, 0, 55, tzinfo=UTC)
    _, *rows = recording.read_text().splitlines()
    stamps = [(start + timedelta(seconds=k)).astimezone(ZoneInfo("Europe/Berlin")) for k in range(len(rows))]
    local = [f"{at:%Y-%m-%d %H:%M:%S},{row.partition(',')[2]}" for at, row in zip(stamps, rows, strict=True)]
    autumn = tmp_path / "autumn.csv"
    autumn.write_text("\n".join([recording.read_text().splitlines()[0], *local]) + "\n")
    options = ["--model", str(model), "--recording", str(autumn), "--out", str(again)]
    assert runner.invoke(cli, ["simulate", *options, "--time-zone", "Europe/Berlin"]).exit_code == 0
    assert np.genfromtxt(again, delimiter=",", names=True)["time"].tolist() == list(range(len(rows)))


def test_a_model_without_a_recording_is_refused(tmp_path: Path) -> None:
    broken = tmp_path / "model.json"
    broken.write_text("{}")
    for options in (["--model", str(broken)], ["--model", str(broken), "--recording", str(broken)]):
        result = runner.invoke(cli, ["simulate", *options])
        assert isinstance(result.exception, LoopauditError)
        assert result.exception.code == "model_invalid"


def test_a_trace_leaves_the_simulation_empty_that_was_not_given(recording: Path, tmp_path: Path) -> None:
    alone, trace = tmp_path / "FIC1.csv", tmp_path / "trace.csv"
    lines = recording.read_text().splitlines()
    alone.write_text("\n".join(line.rpartition(",")[0] for line in lines) + "\n")
    assert runner.invoke(cli, ["explain", str(alone), "--trace", str(trace)]).exit_code == 0
    header, *rows = (line.split(",") for line in trace.read_text().splitlines())
    empty = {name for name, *cells in zip(header, *rows, strict=True) if not any(cells)}
    assert empty == {"PV_given", "residual_given"}
    assert len(rows) == 600
    assert all(cell == "" or np.isfinite(float(cell)) for row in rows for cell in row)


def test_of_a_long_record_the_part_that_is_judged_may_be_explained(tmp_path: Path) -> None:
    loop, path = recorded(STICKY, 6500, seed=2), tmp_path / "FIC9.csv"
    columns = np.stack((loop.time_s, loop.op, loop.pv), axis=1)
    np.savetxt(path, columns, fmt="%.2f", delimiter=",", header="time,OP,PV", comments="")
    trace = tmp_path / "trace.csv"
    result = runner.invoke(cli, ["explain", str(path), "--judged", "--format", "json", "--trace", str(trace)])
    assert result.exit_code == 0, result.output
    line = json.loads(result.stdout)
    assert [effect["effect"] for effect in line["effects"]] == ["valve.stiction"]
    part = next(reason["text"] for reason in line["evidence"] if reason["code"] == "part_explained")
    first = round(float(part.split("from ")[1].split()[0]) / TS)
    rows = trace.read_text().splitlines()[1:]
    assert len(rows) < 2000
    assert [float(row.split(",")[1]) for row in rows] == loop.pv[first : first + len(rows)].tolist()
    whole = runner.invoke(cli, ["explain", str(path), "--quick"])
    assert "--judged takes those that an audit judges" in whole.output


def test_a_first_look_comes_without_names(recording: Path) -> None:
    result = runner.invoke(cli, ["explain", str(recording), "--sim", "PV_sim", "--quick", "--format", "json"])
    assert result.exit_code == 0, result.output
    line = json.loads(result.stdout)
    assert line["located"]["block"] == "sensor"
    assert line["located"]["windows"] == [[300.0, 340.0]]
    assert "effects" not in line
    text = runner.invoke(cli, ["explain", str(recording), "--quick"])
    assert "sensor" in text.stdout


def test_a_first_look_says_that_numbers_may_be_read_in_two_ways(recording: Path, tmp_path: Path) -> None:
    columns = np.loadtxt(recording, delimiter=",", skiprows=1)[:, [0, 2, 3]]
    path = tmp_path / "FIC2.csv"
    np.savetxt(path, columns, fmt=("%d", "%.3f", "%.3f"), delimiter=";", header="time;OP;PV", comments="")
    result = runner.invoke(cli, ["explain", str(path), "--quick", "--format", "json"])
    said = json.loads(result.stdout)["evidence"][0]
    assert said["code"] == "numbers_in_doubt"
    assert said["text"].endswith("read as decimals: PV, OP")
    assert said["text"] in runner.invoke(cli, ["explain", str(path), "--quick"]).stdout


LAGGED = '{"gain": 0.8, "time_constants_s": [9.5]}'


def other_recording(recording: Path, tmp_path: Path, *, columns: int = 5, every: int = 1, scale: float = 1.0) -> Path:
    """A later hour of the same loop, its first columns alone, so many samples a sample, PV in another unit."""
    names = recording.read_text().splitlines()[0].split(",")
    rows = np.loadtxt(recording, delimiter=",", skiprows=1)
    rows[:, 3] = scale * (rows[:, 3] + np.random.default_rng(4).normal(scale=0.05, size=len(rows)))
    path = tmp_path / "second.csv"
    kept = rows[::every, :columns]
    np.savetxt(path, kept, fmt="%.5f", delimiter=",", header=",".join(names[:columns]), comments="")
    return path


@pytest.mark.parametrize("every", [1, 2])
def test_a_given_model_is_simulated_on_the_second_recording_too(recording: Path, tmp_path: Path, every: int) -> None:
    options = ["--sim-model", LAGGED, "--validate", str(other_recording(recording, tmp_path, columns=4, every=every))]
    result = runner.invoke(cli, ["explain", str(recording), *options, "--format", "json"])
    assert result.exit_code == 0, result.output
    line = json.loads(result.stdout)
    assert line["simulation"] == "model"
    assert line["figures_of"]["given"] == "the given model"
    assert line["figures_of"]["refitted"] == "the given model, its parameters fitted to FIC1"
    assert line["validation"]["recording"] == "second"
    assert line["validation"]["given_of"] == "the given model"
    assert line["validation"]["rmse_given"] == pytest.approx(line["validation"]["rmse_refitted"], rel=0.2)


def test_a_model_that_was_written_is_simulated_on_the_second_recording_too(recording: Path, tmp_path: Path) -> None:
    model, second = tmp_path / "model.json", other_recording(recording, tmp_path, columns=4)
    runner.invoke(cli, ["explain", str(recording), "--sim-model", LAGGED, "--model", str(model)])
    options = ["--sim-model", str(model), "--validate", str(second), "--format", "json"]
    line = json.loads(runner.invoke(cli, ["explain", str(recording), *options]).stdout)
    assert line["simulation"] == "model"
    assert line["validation"]["rmse_given"] == pytest.approx(0.11, abs=0.02)  # the noise of PV


def test_the_text_says_whose_figures_it_has_and_none_that_there_are_not(recording: Path, tmp_path: Path) -> None:
    second = other_recording(recording, tmp_path)
    by_model = runner.invoke(cli, ["explain", str(recording), "--sim-model", LAGGED, "--validate", str(second)]).stdout
    assert re.search(r"\n  given: the given model[;\n]", by_model)
    assert re.search(r"\n  refitted: the given model, its parameters fitted to FIC1[;\n]", by_model)
    assert "\nvalidation     given 0." in by_model
    assert "  on second, seen by no fit; given there: the given model\n" in by_model
    assert "None" not in by_model
    without = other_recording(recording, tmp_path, columns=4)
    by_column = runner.invoke(cli, ["explain", str(recording), "--validate", str(without)]).stdout
    assert "\nvalidation     refitted 0." in by_column
    assert "there is a simulation for the first recording but none for the second" in by_column
    assert "None" not in by_column


def test_what_is_wrong_with_the_second_recording_is_said_of_it(recording: Path, tmp_path: Path) -> None:
    second = other_recording(recording, tmp_path, columns=4)
    second.write_text(second.read_text().replace("PV", "PX"))
    result = runner.invoke(cli, ["explain", str(recording), "--op", "OP", "--pv", "PV", "--validate", str(second)])
    assert isinstance(result.exception, LoopauditError)
    assert result.exception.code == "no_such_column"
    assert result.exception.message.startswith("in the second recording, ")
    assert "there is no column PV" in result.exception.message


def written_model(recording: Path, tmp_path: Path) -> dict[str, Any]:
    path = tmp_path / "written.json"
    runner.invoke(cli, ["explain", str(recording), "--sim-model", LAGGED, "--model", str(path)])
    told: dict[str, Any] = json.loads(path.read_text())
    return told


def test_a_model_that_was_changed_by_hand_is_refused_and_no_fault(recording: Path, tmp_path: Path) -> None:
    model = written_model(recording, tmp_path)
    changes: dict[str, dict[str, Any]] = {
        "its plant has X": {"plant": {**model["plant"], "X": 1.0}},
        "its plant lacks K": {"plant": {"tau": 9.0, "theta": 0.0}},
        "tau must be more than 0": {"plant": {**model["plant"], "tau": 0.0}},
        "theta must not be less than 0": {"plant": {**model["plant"], "theta": -5.0}},
        "its dead time of 1e+18 s": {"plant": {**model["plant"], "theta": 1e18}},
        "op_mid are no finite numbers": {"op_mid": float("nan")},
        "op_span must be more than 0": {"op_span": 0.0},
        "fitted at 0 s": {"sampling_interval_s": 0.0},
        "fitted at nan s": {"sampling_interval_s": float("nan")},
    }
    for told, changed in changes.items():
        result = runner.invoke(cli, ["explain", str(recording), "--sim-model", json.dumps(model | changed)])
        assert isinstance(result.exception, LoopauditError), (told, result.exception)
        assert (result.exception.code, told in result.exception.message) == ("model_invalid", True), told


def test_a_second_recording_in_another_unit_is_said_to_be_far_off(recording: Path, tmp_path: Path) -> None:
    second = other_recording(recording, tmp_path, columns=4, scale=1000.0)
    options = ["--sim-model", LAGGED, "--validate", str(second)]
    shown = runner.invoke(cli, ["explain", str(recording), *options]).stdout
    assert "the second recording is far from the first: PV runs from 4" in shown
    alike = ["--sim-model", LAGGED, "--validate", str(other_recording(recording, tmp_path))]
    assert "far from the first" not in runner.invoke(cli, ["explain", str(recording), *alike]).stdout


def test_numbers_are_told_with_the_caution_that_pages_have(recording: Path) -> None:
    result = runner.invoke(cli, ["explain", str(recording), "--sim", "PV_sim", "--format", "json"])
    line = json.loads(result.stdout)
    width = {"width": {"value": 2.0, "low": 1.9, "high": 2.1, "unit": "OP"}}
    sized = line["effects"][0] | {"effect": "valve.deadband", "parameters": width}
    told = as_text(line | {"effects": [sized]})
    assert f"    {NO_SIZE}\n" in told
    assert f"  {RANGES}: {HELD}.\n" in told
    drifting = as_text(line | {"effects": [sized | {"effect": "sensor.drift"}]})
    assert f"  {RANGES}.\n" in drifting
    assert "true S" not in drifting
    stuck = as_text(line | {"effects": [line["effects"][0] | {"parameters": {}}]})
    assert NO_SIZE not in stuck
    assert RANGES not in stuck
