"""Recordings and simulations as they come from files and from the store, brought to one time base."""

from pathlib import Path

import numpy as np
import pytest

from app.engine.recording import Recording
from app.errors import DataError
from app.services.comparisons import Columns, comparison_of, read_comparison, simulation_from_json


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
