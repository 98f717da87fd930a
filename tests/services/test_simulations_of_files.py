"""Simulations that come in a column or in a file of their own: which are taken, and which refused."""

from pathlib import Path

import pytest

from app.errors import DataError
from app.services.explaining.comparisons import Columns, read_comparison
from tests.services.compared_files import code_of, rows, simulated_rows, write


def seconds_of(n: int = 200) -> list[str]:
    return [f"{k},{50 + k % 7},{40 + k % 5},{45 + k % 6}" for k in range(n)]


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


def test_a_simulation_with_a_hole_is_refused(tmp_path: Path) -> None:
    recording = write(tmp_path / "F1.csv", "Time,PV,OP\n" + rows(200))
    lines = rows(200).split("\n")
    holed = [line if not 80 <= k < 90 else line.split(",")[0] + ",," for k, line in enumerate(lines)]
    other = write(tmp_path / "sim.csv", "Time,PV,OP\n" + "\n".join(holed))
    with pytest.raises(DataError) as raised:
        read_comparison(recording, Columns(), str(other))
    assert raised.value.code == "simulation_not_finite"
    assert "10 samples" in str(raised.value)


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


@pytest.mark.parametrize("columns", [Columns(), Columns(op="OP", pv="PV")])
@pytest.mark.parametrize("name", ["PV_sim", "Mode"])
def test_a_simulation_or_a_mode_that_rises_is_no_time(tmp_path: Path, name: str, columns: Columns) -> None:
    lines = "\n".join(f"{5 * k},{50 + k % 7},{40 + k % 5}" for k in range(200))
    found = read_comparison(write(tmp_path / "F1.csv", f"{name},PV,OP\n{lines}"), columns, None)
    assert found.sampling_interval_s == 1.0
    assert "1 s apart" in found.notes[0].text


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
