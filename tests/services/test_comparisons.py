"""Recordings and simulations as they come from files and from the store, brought to one time base."""

import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from app.engine.mismatch.compare.comparison import LEAST_SAMPLES
from app.engine.mismatch.compare.even_grid import uniform
from app.engine.recording import Recording
from app.errors import DataError, RequestError
from app.services.explaining.comparisons import Columns, measured_alone, read_comparison, read_table
from tests.services.compared_files import code_of, rows, simulated_rows, write


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
    with pytest.raises(DataError, match=r"holds 2 loops \(FIC1, FIC2\); name one with --loop"):
        read_comparison(path, Columns(), None)
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


def test_a_panic_of_the_reader_is_a_file_that_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def panics(*_: object, **__: object) -> pl.DataFrame:
        raise pl.exceptions.PanicException("index out of bounds")

    monkeypatch.setattr(pl, "read_csv", panics)
    with pytest.raises(DataError) as refused:
        read_table(write(tmp_path / "simulation.csv", "time,PV\n0,1\n"))
    assert refused.value.code == "not_a_table"


@pytest.mark.parametrize("names", ["F1\x07.PV,F1\x07.OP", "P\x01V,OP", "PV,O\0P"])
def test_columns_with_control_characters_in_their_names_are_found(tmp_path: Path, names: str) -> None:
    lines = [f"{k},{k % 7},{30 + k % 5}" for k in range(200)]
    found = read_table(write(tmp_path / "F1.csv", f"time,{names}\n" + "\n".join(lines)))
    assert [found.column_of("PV"), found.column_of("OP")] == names.split(",")
    assert found.numbers(names.split(",")[0])[:3].tolist() == [0.0, 1.0, 2.0]


def test_numbers_of_a_table_whose_columns_are_named_are_read_as_exports_have_them(tmp_path: Path) -> None:
    lines = [f"{k};{k % 7},25;{30 + k % 5},5 %" for k in range(200)]
    found = read_comparison(write(tmp_path / "F1.csv", "time;y1;u1\n" + "\n".join(lines)), Columns("u1", "y1"), None)
    assert (found.pv[:3].tolist(), found.op[:3].tolist()) == ([0.25, 1.25, 2.25], [30.5, 31.5, 32.5])


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
