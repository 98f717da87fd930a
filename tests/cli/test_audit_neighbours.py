"""`loopaudit audit` of a file with several loops: which of them may only be shaken by another one's valve."""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy.io import savemat
from typer.testing import CliRunner

from app.cli.main import cli
from app.engine.simulate import SimulatedLoop
from app.lab.testbench import neighbours
from app.services.audit_json.line import flat_reasons
from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.hearing import SHAKEN_BY_NEIGHBOUR
from app.services.intake import reading, uploads
from tests.table_rows import table_page

START = np.datetime64("2026-11-01T00:00:00", "ms")
SOURCE, TAGS = "FIC0", ("FIC0", "FIC1", "FIC2")
LATE_ROWS = 720


@cache
def simulated() -> Mapping[str, SimulatedLoop]:
    """A valve that sticks, and two healthy loops that it shakes and that their own records accuse reliably."""
    return dict(zip(TAGS, list(neighbours.plant(1010).values()), strict=False))


def columns(tag: str, late_rows: int = 0) -> dict[str, Any]:
    loop, rows = simulated()[tag], np.arange(neighbours.SAMPLES)
    return {
        f"{tag}.{name}": pl.Series(np.where(rows < late_rows, np.nan, signal)).fill_nan(None)
        for name, signal in (("PV", loop.pv), ("OP", loop.op))
    }


def written(path: Path, *signals: dict[str, Any]) -> Path:
    time = START + (1000 * simulated()[SOURCE].time_s).astype("timedelta64[ms]")
    together = {name: values for one in signals for name, values in one.items()}
    pl.DataFrame({"time": time, **together}).write_csv(path)
    return path


def audited(*paths: Path) -> dict[str, dict[str, Any]]:
    done = CliRunner().invoke(cli, ["audit", *map(str, paths), "--format", "jsonl", "--jobs", "1"])
    assert done.exit_code == 0, done.stderr
    return {line["loop"]: line for line in map(json.loads, done.stdout.splitlines())}


@pytest.fixture(scope="module")
def export(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("export") / "unit.csv", *map(columns, TAGS))


def test_loops_of_one_file_are_heard_beside_each_other(export: Path) -> None:
    lines = audited(export)
    assert {line["verdict"] for line in lines.values()} == {"stiction"}
    assert lines[SOURCE]["reliability"] == "reliable"
    for tag in TAGS[1:]:
        assert lines[tag]["reliability"] == "not_reliable"
        assert lines[tag]["reasons"][0]["code"] == SHAKEN_BY_NEIGHBOUR
        assert f"in step with {SOURCE}" in lines[tag]["reasons"][0]["text"]
        lost = sum(part["lost"] for part in lines[tag]["health_parts"])
        assert lines[tag]["health"] == pytest.approx(100.0 - lost, abs=0.05)


def test_the_service_says_the_same_of_the_file(export: Path, open_plant: Any, warm_kernels: None) -> None:
    backend = open_plant()
    with uploads.receive(backend, filename=export.name) as receiving:
        receiving.write(export.read_bytes())
        received = receiving.commit().upload
    reading.read_upload(backend, int(received.id), owner="test")
    audit_chunk(backend, int(start_audit(backend).id), "test")
    rows = {row["loop"]: row for row in table_page(backend).rows}
    alone = audited(export)
    assert alone.keys() == rows.keys()
    for tag, line in alone.items():
        alike = ("verdict", "stiction_probability", "reliability", "health")
        assert {name: rows[tag][name] for name in alike} == {name: line[name] for name in alike}
        assert rows[tag]["reasons_text"] == flat_reasons(line["reasons"])["reasons_text"]


def test_a_loop_that_was_recorded_later_is_heard_on_the_clock_of_the_file(tmp_path: Path) -> None:
    later = written(tmp_path / "unit.csv", columns(SOURCE), columns(TAGS[1], LATE_ROWS))
    line = audited(later)[TAGS[1]]
    assert line["samples"] == neighbours.SAMPLES - LATE_ROWS
    assert line["reasons"][0]["code"] == SHAKEN_BY_NEIGHBOUR


def structures(*tags: str) -> dict[str, Any]:
    loops = {tag: simulated()[tag] for tag in tags}
    return {tag: {"PV": loop.pv, "OP": loop.op, "Ts": neighbours.INTERVAL_S} for tag, loop in loops.items()}


def test_loops_that_count_their_own_seconds_may_be_of_two_plants(tmp_path: Path) -> None:
    savemat(tmp_path / "cdata.mat", structures(*TAGS[:2]))
    assert [line["reliability"] for line in audited(tmp_path / "cdata.mat").values()] == ["reliable", "reliable"]


def test_seconds_of_one_column_are_of_one_clock(tmp_path: Path) -> None:
    together = pl.DataFrame({"time": simulated()[SOURCE].time_s, **columns(SOURCE), **columns(TAGS[1])})
    together.write_csv(tmp_path / "unit.csv")
    assert audited(tmp_path / "unit.csv")[TAGS[1]]["reasons"][0]["code"] == SHAKEN_BY_NEIGHBOUR


def test_loops_of_two_files_may_be_of_two_plants(tmp_path: Path) -> None:
    files = [written(tmp_path / f"{tag}.csv", columns(tag)) for tag in TAGS[:2]]
    assert [line["reliability"] for line in audited(*files).values()] == ["reliable", "reliable"]
