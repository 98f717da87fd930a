"""Which column of a file is its time, and how the stamps in it are read."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from app.ingest import IngestOptions, NamedTable
from app.services.explaining.comparisons import Columns, read_comparison, seconds
from tests.services.compared_files import rows, write


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


@pytest.mark.parametrize(
    ("heading", "interval"), [("Time [min]", 120.0), ("Time (s)", 2.0), ("TIME (h)", 7200.0), ("Timestamp (UTC)", 2.0)]
)
def test_a_time_may_have_its_unit_in_its_name(tmp_path: Path, heading: str, interval: float) -> None:
    path = write(tmp_path / "F1.csv", f"{heading},y1,u1\n" + rows(200))
    found = read_comparison(path, Columns(op="u1", pv="y1"), None)
    assert (found.sampling_interval_s, found.measured) == (interval, ())


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


@pytest.mark.parametrize("other", ["Ts", "T"])
def test_times_by_their_full_name_go_before_what_may_be_called_so(tmp_path: Path, other: str) -> None:
    lines = "\n".join(f"4,{k % 7},{k % 5},{2 * k}" for k in range(200))
    path = write(tmp_path / "F1.csv", f"{other},PV,OP,time\n{lines}")
    for columns in (Columns(), Columns(op="OP")):
        assert read_comparison(path, columns, None).sampling_interval_s == 2.0


@pytest.mark.parametrize("columns", [Columns(), Columns(op="OP", pv="PV")])
@pytest.mark.parametrize(("heading", "interval"), [("time_ms", 0.002), ("Zeit_min", 120.0), ("elapsed_ms", 0.002)])
def test_a_unit_behind_the_name_of_times_is_theirs(
    tmp_path: Path, heading: str, interval: float, columns: Columns
) -> None:
    found = read_comparison(write(tmp_path / "F1.csv", f"{heading},PV,OP\n" + rows(200)), columns, None)
    assert found.sampling_interval_s == pytest.approx(interval)
    told = [note.text for note in found.notes]
    assert not told if heading != "elapsed_ms" else told[0].endswith("were read as steps of 0.001 s")
