"""Simulations laid onto recordings: by their times where both tell them, else sample by sample, and never cut in
silence.
"""

from pathlib import Path

import numpy as np
import pytest

from app.engine.mismatch.compare.aligning import onto, sample_by_sample
from app.errors import DataError
from app.services.explaining.comparisons import Columns, read_comparison

N = 200


def table(path: Path, header: str, *columns: np.ndarray) -> Path:
    np.savetxt(path, np.stack(columns, axis=1), fmt="%.6g", delimiter=",", header=header, comments="")
    return path


def recording(path: Path, *, times: bool = True) -> Path:
    k = np.arange(N)
    signals = (50.0 + k % 7, 40.0 + k % 5)
    return table(path, "time,PV,OP", 2.0 * k, *signals) if times else table(path, "PV,OP", *signals)


def test_a_simulation_that_covers_more_time_is_laid_by_its_times_and_said(tmp_path: Path) -> None:
    at = np.arange(-20.0, 500.0)
    simulated = table(tmp_path / "sim.csv", "time,PV_sim", at, 0.5 * at)
    found = read_comparison(recording(tmp_path / "F1.csv"), Columns(), str(simulated))
    assert found.trace == pytest.approx(np.arange(N))
    assert [note.code for note in found.notes] == ["simulation_cut"]
    assert "115 of its samples" in found.notes[0].text


def test_a_column_that_goes_on_after_pv_is_cut_with_a_word(tmp_path: Path) -> None:
    k = np.arange(float(N))
    pv = np.where(k < N - 30, 50.0 + k % 7, np.nan)
    found = read_comparison(table(tmp_path / "F1.csv", "time,PV,OP,PV_sim", k, pv, 40.0 + k % 5, k), Columns(), None)
    assert len(found.pv) == N - 30
    assert [note.code for note in found.notes] == ["simulation_cut"]
    assert "30 of its samples" in found.notes[0].text


@pytest.mark.parametrize("length", [N - 1, N + 1, 2 * N])
@pytest.mark.parametrize("timed", [True, False])
def test_without_times_another_length_is_an_error(tmp_path: Path, length: int, timed: bool) -> None:
    """Whichever of the two lacks them."""
    k = np.arange(float(length))
    columns = ("PV_sim", k) if timed else ("time,PV_sim", k, k)
    simulated = table(tmp_path / "sim.csv", *columns)
    with pytest.raises(DataError) as raised:
        read_comparison(recording(tmp_path / "F1.csv", times=timed), Columns(), str(simulated))
    assert raised.value.code == "simulation_length"
    assert f"{length:,} samples" in raised.value.message


def test_without_times_each_sample_belongs_to_one(tmp_path: Path) -> None:
    simulated = table(tmp_path / "sim.csv", "PV_sim", np.arange(float(N)))
    found = read_comparison(recording(tmp_path / "F1.csv"), Columns(), str(simulated))
    assert found.trace == pytest.approx(np.arange(N))
    assert found.notes == ()


def test_a_simulation_whose_rows_are_out_of_order_is_sorted() -> None:
    at = np.random.default_rng(1).permutation(50).astype(np.float64)
    assert onto(np.arange(50.0), at, 3.0 * at).trace == pytest.approx(3.0 * np.arange(50.0))


def test_holes_of_a_simulation_are_not_filled_in() -> None:
    trace = np.arange(50.0)
    trace[20] = np.nan
    with pytest.raises(DataError) as raised:
        sample_by_sample(50, trace)
    assert raised.value.code == "simulation_not_finite"
