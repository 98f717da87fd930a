"""Recordings and simulations as they come from files and from the store, brought to one time base."""

import gzip
import re
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from app.engine.mismatch import Comparison, Controller, simulate_again
from app.engine.mismatch.compare.comparison import LEAST_SAMPLES
from app.engine.mismatch.judge.result import ExplainedModel, PartModel
from app.engine.recording import Recording
from app.errors import DataError, LoopauditError, RequestError
from app.ingest import IngestOptions, NamedTable
from app.services.explaining.comparisons import (
    Columns,
    comparison_of,
    measured_alone,
    read_comparison,
    read_table,
    seconds,
    uniform,
)
from app.services.explaining.given_model import simulation_from_json
from app.services.explaining.models import simulate_model


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def rows(n: int, step: float = 2.0, start: float = 0.0) -> str:
    return "\n".join(f"{start + step * k},{50 + k % 7},{40 + k % 5}" for k in range(n))


def test_a_file_becomes_evenly_sampled_signals(tmp_path: Path) -> None:
    lines = rows(200).split("\n")
    del lines[50:54]
    found = read_comparison(write(tmp_path / "F1.csv", "Time,PV,OP\n" + "\n".join(lines)), Columns(), None)
    assert found.name == "F1"
    assert found.sampling_interval_s == 2.0
    assert len(found.pv) == 200
    assert found.known is not None
    assert not found.known[51]


def test_how_many_samples_are_needed_is_what_is_said(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=f"has {LEAST_SAMPLES - 1} samples .* at least {LEAST_SAMPLES} are") as raised:
        read_comparison(write(tmp_path / "F1.csv", "time,PV,OP\n" + rows(LEAST_SAMPLES - 1)), Columns(), None)
    assert raised.value.code == "too_short"
    assert len(read_comparison(write(tmp_path / "F2.csv", "time,PV,OP\n" + rows(LEAST_SAMPLES)), Columns(), None).pv)


def test_a_simulation_of_another_time_is_refused(tmp_path: Path) -> None:
    recording = write(tmp_path / "F1.csv", "time,PV,OP\n" + rows(200))
    late = write(tmp_path / "sim.csv", "time,PV,OP\n" + rows(200, start=5000.0))
    short = write(tmp_path / "short.csv", "time,PV,OP\n" + rows(100))
    with pytest.raises(DataError) as raised:
        read_comparison(recording, Columns(), str(late))
    assert raised.value.code == "no_overlap"
    with pytest.raises(DataError) as raised:
        read_comparison(recording, Columns(), str(short))
    assert raised.value.code == "simulation_length"


def test_a_stored_recording_with_a_model() -> None:
    n = 150
    recording = Recording("FIC1", np.arange(n) * 10.0, np.arange(n) % 9.0, np.arange(n) % 4.0)
    simulation = simulation_from_json('{"gain": 1.5, "time_constants_s": [20, 4], "dead_time_s": 3}')
    found = comparison_of(recording, simulation=simulation)
    assert found.sampling_interval_s == 10.0
    assert found.simulation is not None
    assert found.simulation.time_constants_s == (20.0, 4.0)
    with pytest.raises(DataError):
        comparison_of(recording, trace=np.zeros(n - 1))


def test_a_model_may_bring_its_controller() -> None:
    told = '{"gain": 1.5, "controller": {"gain": 0.4, "integral_time_s": 30, "derivative_time_s": 2}}'
    assert simulation_from_json(told).controller == Controller(0.4, 30.0, 2.0)
    assert simulation_from_json('{"gain": 1.5, "controller": {"Kc": 0.4}}').controller == Controller(0.4)
    assert simulation_from_json('{"gain": 1.5, "controller": null}').controller is None


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ('{"gain": 1.5, "time_constnat_s": 30}', "'time_constnat_s'"),
        ('{"gain": 1.5, "controller": {"gain": 1, "integral": 30}}', "'integral'"),
        ('{"gain": "1.5"}', "a number is needed"),
        ('{"gain": true}', "a number is needed"),
        ('{"gain": 1.5, "controller": "pid"}', "not an object"),
        ('{"gain": 1.5, "controller": {}}', "its controller has no gain"),
        ('{"gain": 1.5, "time_constants_s": [[3]]}', "a time constant is"),
        ("{}", "the model has no gain"),
    ],
)
def test_a_slip_in_a_model_is_said(told: str, words: str) -> None:
    with pytest.raises(DataError, match=re.escape(words)) as refused:
        simulation_from_json(told)
    assert refused.value.code == "model_invalid"


def test_a_model_with_other_values_than_its_parts_take_is_refused() -> None:
    n = 150
    part = PartModel("sensor.sample_hold/pattern", "sensor.sample_hold", (float("nan"),))
    model = ExplainedModel(4.0, 40.0, 50.0, 5.0, 5.0, (("K", 1.0), ("tau", 20.0), ("theta", 0.0)), (part,), ())
    for values in ((float("nan"),), (), (4.0, 5.0)):
        wrong = replace(model, parts=(replace(part, values=values),))
        with pytest.raises(DataError) as refused:
            simulate_again(wrong, 40.0 + np.arange(n) % 7.0)
        assert refused.value.code == "model_invalid"


def code_of(path: Path, columns: Columns, simulated: str | None = None) -> str:
    with pytest.raises(LoopauditError) as raised:
        read_comparison(path, columns, simulated)
    return raised.value.code


def test_an_export_of_any_layout_is_read(tmp_path: Path) -> None:
    lines = ["DateTime;FIC1.PV;FIC1.OP;FIC1.SP"]
    lines += [f"08.06.2000 12:{k // 60:02d}:{k % 60:02d};{50 + k % 7},5;{40 + k % 5},25;50,0" for k in range(300)]
    found = read_comparison(write(tmp_path / "export.csv", "\n".join(lines)), Columns(), None)
    assert found.sampling_interval_s == 1.0
    assert found.pv[:3].tolist() == [50.5, 51.5, 52.5]
    assert found.op[0] == 40.25


def test_an_export_of_several_loops_asks_which(tmp_path: Path) -> None:
    lines = ["DateTime,FIC1.PV,FIC1.OP,FIC2.PV,FIC2.OP"]
    lines += [f"2024-06-13 12:{k // 60:02d}:{k % 60:02d},{k % 7},{k % 5},{k % 11},{k % 3}" for k in range(300)]
    path = write(tmp_path / "plant.csv", "\n".join(lines))
    assert code_of(path, Columns()) == "several_loops"
    assert code_of(path, Columns(loop="FIC9")) == "no_such_loop"
    assert read_comparison(path, Columns(loop="FIC2"), None).pv.max() == 10.0


def test_columns_that_cannot_be_used_are_said(tmp_path: Path) -> None:
    path = write(tmp_path / "F1.csv", "time,PV,OP,note\n" + "\n".join(f"{k},{k % 7},{k % 5},open" for k in range(200)))
    assert code_of(path, Columns(op="PV", pv="PV")) == "same_column"
    assert code_of(path, Columns(op="note", pv="PV")) == "not_numeric"
    assert code_of(path, Columns(), "PV_other") == "no_such_column"
    assert code_of(tmp_path / "nothing.csv", Columns()) == "no_such_file"
    assert code_of(write(tmp_path / "words.csv", "a,b\nx,y\n"), Columns()) in ("no_pv_op", "too_short")


def test_samples_that_came_on_change_get_a_grid_of_their_own_distance(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    gaps = np.where(rng.random(400) < 0.7, 1.0, 30.0)
    at = np.cumsum(gaps)
    path = write(tmp_path / "F1.csv", "time,PV,OP\n" + "\n".join(f"{t},{np.sin(t / 50)},{np.cos(t / 50)}" for t in at))
    found = read_comparison(path, Columns(), None)
    assert len(found.pv) == 400


def test_a_model_runs_along_a_faster_recording_only_where_it_fits(tmp_path: Path) -> None:
    model = ExplainedModel(4.0, 40.0, 50.0, 5.0, 5.0, (("K", 1.0), ("tau", 20.0), ("theta", 0.0)), (), ())
    op = np.repeat([40.0, 42.0], 200)
    slow = simulate_model(model, Comparison("F1", 4.0, op, op))
    fast = simulate_model(model, Comparison("F1", 2.0, np.repeat(op, 2), np.repeat(op, 2)))
    assert slow.pv[-1] == pytest.approx(52.0, abs=0.01)
    assert fast.pv == pytest.approx(slow.pv)
    with pytest.raises(DataError) as raised:
        simulate_model(model, Comparison("F1", 3.0, op, op))
    assert raised.value.code == "interval_differs"


@pytest.mark.parametrize("stamps", [["first", "second", "third"], ["", "", ""], ["99/99/9999", "x", "1e400"]])
def test_stamps_that_are_none_leave_the_order_of_rows(stamps):
    table = NamedTable(pl.DataFrame({"time": stamps, "PV": [1.0, 2.0, 3.0]}), IngestOptions())
    found, said = seconds(table)
    assert found.tolist() == [0.0, 1.0, 2.0]
    assert [reason.code for reason in said] == ["times_assumed"]


def test_a_stamp_that_is_none_among_others_is_not_known():
    stamps = ["2024-03-01 00:00:00", "later", "2024-03-01 00:00:20"]
    found, said = seconds(NamedTable(pl.DataFrame({"time": stamps, "PV": [1.0, 2.0, 3.0]}), IngestOptions()))
    assert said == ()
    assert np.isnan(found[1])
    assert found[2] - found[0] == 20.0


def test_a_clock_that_went_back_and_times_that_come_twice_are_said() -> None:
    time = np.concatenate((np.arange(100.0), np.arange(60.0, 200.0)))
    noise = np.random.default_rng(1).normal(size=len(time))
    found = uniform("clock", time, {"pv": noise, "op": noise}, {})
    assert [note.code for note in found.notes] == ["time_runs_back", "times_repeated"]
    assert "40 samples" in found.notes[1].text
    even = uniform("even", np.arange(240.0), {"pv": noise, "op": noise}, {})
    assert even.notes == ()


def test_the_set_point_holds_over_holes_and_pv_does_not() -> None:
    time = np.delete(np.arange(200.0) / 3.0, np.arange(95, 100))
    rows = np.round(time * 3.0)
    noise = np.random.default_rng(1).normal(size=len(time))
    found = uniform("loop", time, {"pv": rows, "op": noise, "sp": np.where(rows < 100, 20.0, 30.0)}, {})
    assert np.array_equal(found.sp, np.where(np.arange(200) < 100, 20.0, 30.0))
    assert found.pv == pytest.approx(np.arange(200.0))


def test_a_simulation_with_a_hole_is_refused(tmp_path: Path) -> None:
    recording = write(tmp_path / "F1.csv", "Time,PV,OP\n" + rows(200))
    lines = rows(200).split("\n")
    holed = [line if not 80 <= k < 90 else line.split(",")[0] + ",," for k, line in enumerate(lines)]
    other = write(tmp_path / "sim.csv", "Time,PV,OP\n" + "\n".join(holed))
    with pytest.raises(DataError) as raised:
        read_comparison(recording, Columns(), str(other))
    assert raised.value.code == "simulation_not_finite"
    assert "10 samples" in str(raised.value)


def test_a_panic_of_the_reader_is_a_file_that_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def panics(*_: object, **__: object) -> pl.DataFrame:
        raise pl.exceptions.PanicException("index out of bounds")

    monkeypatch.setattr(pl, "read_csv", panics)
    with pytest.raises(DataError) as refused:
        read_table(write(tmp_path / "simulation.csv", "time,PV\n0,1\n"))
    assert refused.value.code == "not_a_table"


@pytest.mark.parametrize("form", ["%m/%d/%Y %I:%M:%S %p", "%d.%m.%Y %H:%M", "%Y-%m-%dT%H:%M:%SZ"])
def test_a_table_whose_columns_are_named_tells_times_as_exports_do(tmp_path: Path, form: str) -> None:
    start = datetime(2024, 1, 31, 23, 30)
    lines = [f"{start + timedelta(minutes=k):{form}},{k % 7},{k % 5}" for k in range(200)]
    path = write(tmp_path / "F1.csv", "time,y1,u1\n" + "\n".join(lines))
    found = read_comparison(path, Columns(op="u1", pv="y1"), None)
    assert (found.sampling_interval_s, len(found.pv)) == (60.0, 200)


@pytest.mark.parametrize("times", ["{0}", "{0}.25", "{0}000", "{0}000000000"])
def test_times_that_count_from_1970_are_told_by_their_size(tmp_path: Path, times: str) -> None:
    lines = [f"{times.format(1_700_000_000 + 5 * k)},{k % 7},{k % 5}" for k in range(200)]
    path = write(tmp_path / "F1.csv", "time,y1,u1\n" + "\n".join(lines))
    assert read_comparison(path, Columns(op="u1", pv="y1"), None).sampling_interval_s == 5.0


def test_days_of_a_spreadsheet_are_days(tmp_path: Path) -> None:
    lines = [f"{45000 + k / 8640:.9f},{k % 7},{k % 5}" for k in range(200)]
    path = write(tmp_path / "F1.csv", "time,y1,u1\n" + "\n".join(lines))
    found = read_comparison(path, Columns(op="u1", pv="y1"), None)
    assert found.sampling_interval_s == pytest.approx(10.0, abs=1e-3)


def test_a_typed_time_of_a_table_is_in_seconds(tmp_path: Path) -> None:
    stamps = [datetime(2024, 1, 1) + timedelta(seconds=10 * k) for k in range(200)]
    path = tmp_path / "F1.parquet"
    pl.DataFrame({"time": stamps, "y1": [k % 7 for k in range(200)], "u1": [k % 5 for k in range(200)]}).write_parquet(
        path
    )
    assert read_comparison(path, Columns(op="u1", pv="y1"), None).sampling_interval_s == 10.0


@pytest.mark.parametrize("columns", [Columns(), Columns(op="OP", pv="PV")])
def test_local_times_are_read_in_the_zone_that_is_named(tmp_path: Path, columns: Columns) -> None:
    stamps = [f"2024-10-27 {hour:02d}:{k:02d}:00" for hour in (1, 2, 2, 3) for k in range(60)]
    path = write(tmp_path / "F1.csv", "time,PV,OP\n" + "\n".join(f"{t},{k % 7},{k % 5}" for k, t in enumerate(stamps)))
    found = read_comparison(path, columns, None, IngestOptions(time_zone="Europe/Berlin"))
    assert (found.sampling_interval_s, len(found.pv), found.notes) == (60.0, 240, ())


def test_numbers_of_a_table_whose_columns_are_named_are_read_as_exports_have_them(tmp_path: Path) -> None:
    lines = [f"{k};{k % 7},25;{30 + k % 5},5 %" for k in range(200)]
    found = read_comparison(write(tmp_path / "F1.csv", "time;y1;u1\n" + "\n".join(lines)), Columns("u1", "y1"), None)
    assert (found.pv[:3].tolist(), found.op[:3].tolist()) == ([0.25, 1.25, 2.25], [30.5, 31.5, 32.5])


@pytest.mark.parametrize(
    ("heading", "interval"), [("Time [min]", 120.0), ("Time (s)", 2.0), ("TIME (h)", 7200.0), ("Timestamp (UTC)", 2.0)]
)
def test_a_time_may_have_its_unit_in_its_name(tmp_path: Path, heading: str, interval: float) -> None:
    path = write(tmp_path / "F1.csv", f"{heading},y1,u1\n" + rows(200))
    found = read_comparison(path, Columns(op="u1", pv="y1"), None)
    assert (found.sampling_interval_s, found.measured) == (interval, ())


@pytest.mark.parametrize(
    ("pv", "op", "expected", "told"),
    [
        (("999", "1.000"), ("40", "41"), (999, 1000), "thousands: y1"),
        (("50", "50.125"), ("40", "41"), (50, 50.125), "decimals: y1"),
        (("50,123", "51,871"), ("40.1", "40.3"), (50123, 51871), "thousands: y1"),
        (("50,12", "51,871"), ("40.1", "40.3"), (50.12, 51.871), "decimal commas: y1"),
    ],
)
def test_numbers_of_a_table_that_may_be_read_in_two_ways_are_told(
    tmp_path: Path, pv: tuple[str, str], op: tuple[str, str], expected: tuple[float, float], told: str
) -> None:
    lines = "\n".join(f"{k};{pv[k % 2]};{op[k // 2 % 2]}" for k in range(200))
    path = write(tmp_path / "F1.csv", "time;y1;u1\n" + lines)
    found = read_comparison(path, Columns("u1", "y1"), None)
    assert found.pv[:2].tolist() == list(expected)
    (note,) = found.notes
    assert (note.code, told in note.text) == ("numbers_in_doubt", True)


def test_numbers_of_an_export_that_may_be_read_in_two_ways_are_told(tmp_path: Path) -> None:
    lines = "\n".join(f"{k};{('999', '1.000')[k % 2]};{40 + k // 2 % 2}" for k in range(200))
    found = read_comparison(write(tmp_path / "F1.csv", "time;PV;OP\n" + lines), Columns(), None)
    assert found.pv[:2].tolist() == [999, 1000]
    assert [note.code for note in found.notes] == ["numbers_in_doubt"]


def simulated_rows(simulated: list[str]) -> str:
    lines = [f"{line},{cell}" for line, cell in zip(rows(len(simulated)).split("\n"), simulated, strict=True)]
    return "time,PV,OP,PV_sim\n" + "\n".join(lines)


@pytest.mark.parametrize("columns", [Columns(), Columns(op="OP", pv="PV")])
def test_a_recorded_simulation_that_ends_early_is_refused_and_one_with_a_hole_is_bridged(
    tmp_path: Path, columns: Columns
) -> None:
    simulated = [str(40 + k % 5) for k in range(200)]
    ends = write(tmp_path / "F1.csv", simulated_rows(simulated[:120] + [""] * 80))
    with pytest.raises(DataError, match=r"the simulation covers 0 to 238 s .* the recording 0 to 398 s") as raised:
        read_comparison(ends, columns, None)
    assert raised.value.code == "simulation_length"
    hole = write(tmp_path / "F2.csv", simulated_rows([*simulated[:60], *[""] * 20, *simulated[80:199], ""]))
    found = read_comparison(hole, columns, None)
    assert [note.code for note in found.notes] == ["simulation_bridged"]
    assert "20 samples of the simulation have no value" in found.notes[0].text


def test_one_column_is_not_two_signals(tmp_path: Path) -> None:
    path = write(tmp_path / "F1.csv", simulated_rows([str(40 + k % 5) for k in range(200)]))
    for columns, simulated in [
        (Columns(op="PV"), None),
        (Columns(op="OP", sp="OP"), None),
        (Columns(op="PV_sim"), "PV_sim"),
    ]:
        with pytest.raises(RequestError, match="both taken from the column") as raised:
            read_comparison(path, columns, simulated)
        assert raised.value.code == "same_column"
    assert read_comparison(path, Columns(op="PV_sim"), None).trace is None


@pytest.mark.parametrize(
    "header",
    ["Zeit,Istwert,Stellwert,Sollwert", "utc,PV,CV,SP", "LocalTime,ProcessValue,Output,SetPoint", "t,y,u,r"],
)
def test_a_file_whose_columns_are_named_is_read_by_the_names_that_exports_are_read_by(
    tmp_path: Path, header: str
) -> None:
    """What names a column must not hang on whether one of the others was named by the user."""
    lines = "\n".join(f"{2 * k},{50 + k % 7},{40 + k % 5},{50 + k // 60}" for k in range(200))
    path = write(tmp_path / "F1.csv", f"{header}\n{lines}")
    pv, op = header.split(",")[1:3]
    for columns in (Columns(), Columns(op=op), Columns(pv=pv), Columns(op=op, pv=pv)):
        found = read_comparison(path, columns, None)
        assert (found.sampling_interval_s, found.measured, found.notes) == (2.0, (), ())
        assert (found.pv[:3].tolist(), found.op[:3].tolist()) == ([50, 51, 52], [40, 41, 42])
        assert found.sp is not None


def test_date_and_clock_apart_are_one_time_where_columns_are_named(tmp_path: Path) -> None:
    lines = "\n".join(f"12.11.2026;05:{k // 60:02d}:{k % 60:02d};{k % 7};{k % 5}" for k in range(200))
    path = write(tmp_path / "F1.csv", f"Datum;Uhrzeit;Istwert;Stellwert\n{lines}")
    for columns in (Columns(), Columns(op="Stellwert")):
        found = read_comparison(path, columns, None)
        assert (found.sampling_interval_s, found.measured, found.notes) == (1.0, (), ())


@pytest.mark.parametrize("columns", [Columns(), Columns(op="OP", pv="PV")])
def test_a_file_without_times_is_told_to_be_taken_for_a_sample_a_second(tmp_path: Path, columns: Columns) -> None:
    lines = "\n".join(f"{50 + k % 7},{40 + k % 5}" for k in range(200))
    found = read_comparison(write(tmp_path / "F1.csv", f"PV,OP\n{lines}"), columns, None)
    assert found.sampling_interval_s == 1.0
    assert [note.code for note in found.notes] == ["times_assumed"]
    assert "1 s apart" in found.notes[0].text


@pytest.mark.parametrize("columns", [Columns(), Columns(op="OP", pv="PV")])
def test_numbers_that_no_name_calls_times_are_some_where_they_rise_and_that_is_told(
    tmp_path: Path, columns: Columns
) -> None:
    lines = "\n".join(f"{3 * k},{50 + k % 7},{40 + k % 5}" for k in range(200))
    found = read_comparison(write(tmp_path / "F1.csv", f"Laufzeit,PV,OP\n{lines}"), columns, None)
    assert (found.sampling_interval_s, found.measured) == (3.0, ())
    assert [note.code for note in found.notes] == ["times_assumed"]
    assert "'Laufzeit'" in found.notes[0].text
    turns = "\n".join(f"{20 + k % 9},{50 + k % 7},{40 + k % 5}" for k in range(200))
    found = read_comparison(write(tmp_path / "F2.csv", f"TI7,PV,OP\n{turns}"), columns, None)
    assert (found.sampling_interval_s, len(found.pv)) == (1.0, 200)
    assert [name for name, _ in found.measured] == ["TI7"]
    assert "1 s apart" in found.notes[0].text


@pytest.mark.parametrize("name", ["", "index", "Laufzeit"])
def test_which_numbers_are_times_is_one_thing_whichever_way_a_file_is_read(tmp_path: Path, name: str) -> None:
    lines = "\n".join(f"{5 * k},{50 + k % 7},{40 + k % 5}" for k in range(200))
    path = write(tmp_path / "F1.csv", f"{name},PV,OP\n{lines}")
    for columns in (Columns(), Columns(op="OP"), Columns(op="OP", pv="PV")):
        found = read_comparison(path, columns, None)
        assert (found.sampling_interval_s, [note.code for note in found.notes]) == (5.0, ["times_assumed"])


@pytest.mark.parametrize("columns", [Columns(), Columns(op="OP", pv="PV")])
@pytest.mark.parametrize("name", ["PV_sim", "Mode"])
def test_a_simulation_or_a_mode_that_rises_is_no_time(tmp_path: Path, name: str, columns: Columns) -> None:
    lines = "\n".join(f"{5 * k},{50 + k % 7},{40 + k % 5}" for k in range(200))
    found = read_comparison(write(tmp_path / "F1.csv", f"{name},PV,OP\n{lines}"), columns, None)
    assert found.sampling_interval_s == 1.0
    assert "1 s apart" in found.notes[0].text


def test_a_column_that_is_named_as_a_signal_is_not_the_time_as_well(tmp_path: Path) -> None:
    path = write(tmp_path / "F1.csv", "T,OP\n" + "\n".join(f"{50 + k % 7},{40 + k % 5}" for k in range(200)))
    found = read_comparison(path, Columns(pv="T"), None)
    assert (found.sampling_interval_s, len(found.pv)) == (1.0, 200)


def test_what_else_was_measured_is_one_thing_whichever_way_a_file_is_read(tmp_path: Path) -> None:
    header = "time,PV,OP,PV_sim [t/h],sim,Mode,Status,index,T,FI7"
    lines = "\n".join(f"{k},{k % 7},{k % 5},{k % 6},{k % 6},1,192,{k},{k % 9},{k % 11}" for k in range(200))
    path = write(tmp_path / "F1.csv", f"{header}\n{lines}")
    for columns in (Columns(), Columns(op="OP", pv="PV")):
        for simulated in (None, "PV_sim [t/h]", "sim"):
            found = read_comparison(path, columns, simulated)
            assert [name for name, _ in found.measured] == ["T", "FI7"]
            assert found.trace is not None
    recording = Recording("F1", np.arange(200.0), np.arange(200.0) % 7, np.arange(200.0) % 5)
    others = dict.fromkeys(header.split(",")[3:], np.arange(200.0) % 11)
    assert list(measured_alone(replace(recording, others=others), None).others) == ["T", "FI7"]


@pytest.mark.parametrize("other", ["Ts", "T"])
def test_times_by_their_full_name_go_before_what_may_be_called_so(tmp_path: Path, other: str) -> None:
    lines = "\n".join(f"4,{k % 7},{k % 5},{2 * k}" for k in range(200))
    path = write(tmp_path / "F1.csv", f"{other},PV,OP,time\n{lines}")
    for columns in (Columns(), Columns(op="OP")):
        assert read_comparison(path, columns, None).sampling_interval_s == 2.0


def seconds_of(n: int = 200) -> list[str]:
    return [f"{k},{50 + k % 7},{40 + k % 5},{45 + k % 6}" for k in range(n)]


@pytest.mark.parametrize("simulated", [None, "PV_sim"])
def test_a_simulation_that_is_no_signal_of_the_one_loop_is_found_in_the_table(
    tmp_path: Path, simulated: str | None
) -> None:
    path = write(tmp_path / "F1.csv", "time,FIC1.PV,FIC1.OP,PV_sim\n" + "\n".join(seconds_of()))
    found = read_comparison(path, Columns(), simulated)
    assert (found.pv[0], found.op[0], found.measured) == (50.0, 40.0, ())
    assert found.trace is not None
    assert found.trace[0] == 45.0


def test_a_simulation_in_a_file_is_laid_onto_a_loop_of_any_export(tmp_path: Path) -> None:
    stamps = [f"2026-03-01 12:{k // 60:02d}:{k % 60:02d}" for k in range(300)]
    lines = [f"{at},{k % 7},{k % 5},{k % 11},{k % 3}" for k, at in enumerate(stamps)]
    plant = write(
        tmp_path / "plant.csv", "Export,of,PI\n\nTimestamp,FIC1.PV,FIC1.OP,FIC2.PV,FIC2.OP\n" + "\n".join(lines)
    )
    simulated = write(tmp_path / "s.csv", "Zeit;PV_sim\n" + "\n".join(f"{at};{k},5" for k, at in enumerate(stamps)))
    found = read_comparison(plant, Columns(loop="FIC2"), str(simulated))
    assert found.pv.max() == 10.0
    assert found.trace is not None
    assert found.trace[:2].tolist() == [0.5, 1.5]


@pytest.mark.parametrize("encoding", ["utf-16", "cp1252", "gzip"])
def test_a_table_whose_columns_are_named_may_be_in_any_encoding_and_packed(tmp_path: Path, encoding: str) -> None:
    text = "Zeit;Temp (°C);Größe\n" + "\n".join(f"{k};{k % 7},5;{k % 5}" for k in range(200))
    path = tmp_path / "F1.csv"
    path.write_bytes(gzip.compress(text.encode()) if encoding == "gzip" else text.encode(encoding))
    found = read_comparison(path, Columns(pv="Temp (°C)", op="Größe"), None)
    assert found.pv[:2].tolist() == [0.5, 1.5]
    other = tmp_path / "sim.csv"
    other.write_bytes(path.read_bytes())
    with pytest.raises(DataError, match="PV itself") as refused:
        read_comparison(path, Columns(pv="Größe", op="Temp (°C)"), str(other))
    assert refused.value.code == "simulation_is_pv"


def test_a_packed_file_that_was_cut_is_told(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).normal(size=(4000, 2))
    lines = "\n".join(f"{k},{a:.9f},{b:.9f}" for k, (a, b) in enumerate(noise))
    path = tmp_path / "F1.csv.gz"
    whole = gzip.compress(f"time,PV,OP\n{lines}".encode())
    path.write_bytes(whole[: len(whole) * 3 // 4])
    for columns in (Columns(), Columns(op="OP")):
        found = read_comparison(path, columns, None)
        assert [note.code for note in found.notes] == ["samples_damaged"]


@pytest.mark.parametrize("simulated", [None, "copy"])
def test_a_simulation_that_is_pv_itself_is_refused(tmp_path: Path, simulated: str | None) -> None:
    name = simulated or "PV_sim"
    lines = "\n".join(f"{k},{k % 7},{k % 5},{k % 7}" for k in range(200))
    assert (
        code_of(write(tmp_path / "F1.csv", f"time,PV,OP,{name}\n{lines}"), Columns(), simulated) == "simulation_is_pv"
    )


def test_a_simulation_named_by_a_text_too_long_for_a_file_is_no_column(tmp_path: Path) -> None:
    path = write(tmp_path / "F1.csv", "time,PV,OP\n" + rows(200))
    assert code_of(path, Columns(), "x" * 5000) == "no_such_column"


@pytest.mark.parametrize("columns", [Columns(), Columns(op="OP", pv="PV")])
@pytest.mark.parametrize(("heading", "interval"), [("time_ms", 0.002), ("Zeit_min", 120.0), ("elapsed_ms", 0.002)])
def test_a_unit_behind_the_name_of_times_is_theirs(
    tmp_path: Path, heading: str, interval: float, columns: Columns
) -> None:
    found = read_comparison(write(tmp_path / "F1.csv", f"{heading},PV,OP\n" + rows(200)), columns, None)
    assert found.sampling_interval_s == pytest.approx(interval)
    told = [note.text for note in found.notes]
    assert not told if heading != "elapsed_ms" else told[0].endswith("were read as steps of 0.001 s")
