"""Files to recordings, on small files and on the real ones beside the project."""

import csv
from pathlib import Path

import numpy as np
import pytest

from app.errors import DataError
from app.ingest import IngestOptions, LoopReport, inspect, is_export_name, read_named, read_recordings


def test_one_loop_is_named_by_its_file(tmp_path: Path) -> None:
    path = tmp_path / "FC1.csv"
    path.write_text("Time,sp,pv,op,Mode,AUX\n10,5,1,2,AUTO,7\n11,5,2,3,MAN,8\n12,5,3,4,,9\n")
    content = read_recordings(path)
    (recording,) = content.recordings
    assert recording.name == "FC1"
    assert recording.time_s.tolist() == [0, 1, 2]
    assert recording.automatic.tolist() == [True, False, False]
    assert recording.others["AUX"].tolist() == [7, 8, 9]


def test_the_mode_of_another_loop_does_not_take_a_loop_out_of_automatic(tmp_path: Path) -> None:
    path = tmp_path / "FC1.csv"
    path.write_text("time,PV2,Mode2,SP,PV,OP\n" + "".join(f"{i},7,MAN,5,{i},2\n" for i in range(3)))
    content = read_recordings(path)
    (recording,) = content.recordings
    assert recording.automatic is None
    assert (recording.pv.tolist(), recording.others["PV2"].tolist()) == ([0, 1, 2], [7, 7, 7])
    assert any("Mode2" in note and "not read as set point or mode" in note for note in content.notes)


def test_several_loops_and_those_without_a_signal(tmp_path: Path) -> None:
    path = tmp_path / "night.csv"
    path.write_text(
        "time,A.PV,A.OP,B.PV,B.OP,C.PV,TEMP\n" + "".join(f"2024-03-01 00:0{i}:00,1,2,3,4,5,6\n" for i in range(3))
    )
    content = read_recordings(path)
    assert [recording.name for recording in content.recordings] == ["night:A", "night:B"]
    assert content.skipped == ("C: no OP",)


@pytest.mark.shared
def test_every_real_recording_has_its_samples_and_interval(shared_dir: Path) -> None:
    with (shared_dir / "recordings" / "labels.csv").open() as stream:
        labels = list(csv.DictReader(stream))
    assert len(labels) == 78
    for row in labels:
        content = read_recordings(shared_dir / "recordings" / f"{row['recording']}.csv")
        (recording,) = content.recordings
        assert recording.name == row["recording"]
        assert recording.samples == int(row["samples"])
        assert np.median(np.diff(recording.time_s)) == pytest.approx(float(row["sampling_s"]), rel=0.1)
        assert content.rejects == ()


@pytest.mark.shared
def test_the_exports_go_in_whole(shared_dir: Path) -> None:
    folder = shared_dir / "exports"
    for name, loop in (("dcs_tab_FIC46005.txt", "2111FIC46005"), ("dcs_tab_LIC30501.txt", "2411LIC30501")):
        report = inspect(folder / name)
        assert [(found.loop, found.samples, found.sampling_interval_s) for found in report.loops] == [(loop, 751, 10.0)]
        assert report.rejects.total == 0
    report = inspect(folder / "minute_stamps_flow.csv")
    (found,) = report.loops
    assert (found.samples, found.sampling_interval_s, found.even) == (7201, 1.0, True)
    assert found.last_time_ns - found.first_time_ns == 7200 * 10**9


@pytest.mark.parametrize(
    ("name", "taken"),
    [
        *(("night.csv", True), ("FIC1.PV.CSV.gz", True), ("night.xlsx", True), ("run.lvm", True), ("run.ASC", True)),
        *(("night.xls", True), ("night.xlsb", True), (".night.csv", False), ("notes.pdf", False), ("run.log", False)),
    ],
)
def test_files_of_a_folder_that_are_taken(name: str, taken: bool) -> None:
    assert is_export_name(name) is taken


def test_numbers_that_no_name_calls_times_are_times_where_they_rise(tmp_path: Path) -> None:
    rises = tmp_path / "rises.csv"
    rises.write_text("Laufzeit,PV,OP\n" + "".join(f"{2 * k},{k % 7},{k % 5}\n" for k in range(100)))
    read = read_recordings(rises)
    assert read.recordings[0].time_s[:2].tolist() == [0.0, 2.0]
    assert len(read.times_assumed) == 1
    assert "'Laufzeit'" in read.times_assumed[0]
    assert read.times_assumed[0] in read.notes
    turns = tmp_path / "turns.csv"
    turns.write_text("TI7,PV,OP\n" + "".join(f"{20 + k % 9},{k % 7},{k % 5}\n" for k in range(100)))
    with pytest.raises(DataError) as refused:
        read_recordings(turns)
    assert refused.value.code == "unknown_layout"


def test_one_row_does_not_turn(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    path = tmp_path / "one.csv"
    path.write_text("x,PV,OP\n0,1,2\n")
    read = read_recordings(path)
    assert read.recordings[0].pv.tolist() == [1.0]
    assert len(read.times_assumed) == 1
    assert not recwarn.list


def test_assumed_times_that_run_back_and_repeat_in_later_rows_are_doubted(tmp_path: Path) -> None:
    path = tmp_path / "level.csv"
    levels = [*range(450), *range(450, 0, -1), *range(300)]
    path.write_text("LI7,PV,OP\n" + "".join(f"{level},{k % 7},{k % 5}\n" for k, level in enumerate(levels)))
    read = read_recordings(path)
    (assumed, doubt) = read.times_assumed
    assert "'LI7'" in assumed
    assert doubt.startswith("what was read as times goes back and forth, and may be a signal: 749 of 1,200 rows")
    assert {assumed, doubt} <= set(read.notes)


STAMPS = [f"2026-03-01 00:{k // 12:02d}:{5 * k % 60:02d}" for k in range(100)]


@pytest.mark.parametrize(
    ("heading", "stamp_first"),
    [
        ("Date,Time_s", True),
        ("Date,Time s", True),
        ("Date,Time_min", True),
        ("Time_min,Timestamp", False),
        ("Time_h,Time", False),
        ("T,Time_min,Timestamp", False),
        ("Time_s,Timestamp", False),
        ("Time (s),Timestamp", False),
        ("Date,Time (s)", True),
        ("Time,Timestamp", False),
        ("Time,Date", False),
        ("Seconds,DateTime", False),
    ],
)
def test_of_several_columns_of_times_the_one_of_dates_counts(tmp_path: Path, heading: str, stamp_first: bool) -> None:
    path = tmp_path / "F1.csv"
    cells = [(stamp, 60 * k) if stamp_first else (60 * k, stamp) for k, stamp in enumerate(STAMPS)]
    front = "20," if heading.startswith("T,") else ""
    lines = (f"{front}{first},{second},{k % 7},{k % 5}\n" for k, (first, second) in enumerate(cells))
    path.write_text(f"{heading},PV,OP\n" + "".join(lines))
    read = read_recordings(path)
    assert read.recordings[0].time_s[:3].tolist() == [0.0, 5.0, 10.0]
    assert (read.dated, read.times_assumed) == (True, ())
    named = read_named(path, IngestOptions()).times_s()
    assert np.diff(named[:3]).tolist() == [5.0, 5.0]


def test_a_simulated_pv_is_no_pv_of_a_loop(tmp_path: Path) -> None:
    path = tmp_path / "plant.csv"
    path.write_text("time,FIC1.PV,FIC1.OP,PV_sim\n" + "".join(f"{k},{k % 7},{k % 5},{k % 6}\n" for k in range(100)))
    read = read_recordings(path)
    assert (len(read.recordings), read.skipped) == (1, ())


def _inspected(tmp_path: Path, seconds: list[float]) -> LoopReport:
    path = tmp_path / "F1.csv"
    path.write_text("Time,PV,OP\n" + "".join(f"{at},{k % 7},{k % 5}\n" for k, at in enumerate(seconds)))
    (report,) = inspect(path).loops
    return report


def test_rows_that_a_hole_leaves_out_are_missing(tmp_path: Path) -> None:
    report = _inspected(tmp_path, [*range(0, 200, 2), *range(600, 800, 2)])
    assert (report.samples, report.absent, report.missing_share) == (200, 200, 0.0)
    assert report.missing_of_span == pytest.approx(0.5)


def test_values_that_a_row_lacks_are_missing_beside_them(tmp_path: Path) -> None:
    path = tmp_path / "F1.csv"
    rows = (f"{k},{k % 7},{'' if 10 <= k < 20 else k % 5}\n" for k in range(100) if k < 50 or k >= 75)
    path.write_text("Time,PV,OP\n" + "".join(rows))
    (report,) = inspect(path).loops
    assert (report.samples, report.absent) == (75, 25)
    assert report.missing_of_span == pytest.approx(0.35)


def test_no_row_is_missing_where_all_are_there(tmp_path: Path) -> None:
    report = _inspected(tmp_path, [0.5 * k for k in range(100)])
    assert (report.absent, report.missing_of_span) == (0, 0.0)


def test_rows_at_times_of_their_own_leave_none_out(tmp_path: Path) -> None:
    seconds = np.cumsum(np.random.default_rng(3).exponential(20.0, 300)).round(1)
    report = _inspected(tmp_path, seconds.tolist())
    assert (report.even, report.absent, report.missing_of_span) == (False, 0, 0.0)


def test_rows_that_are_stored_when_they_change_leave_none_out(tmp_path: Path) -> None:
    seconds = [float(k + 60 * (k // 6)) for k in range(300)]
    assert _inspected(tmp_path, seconds).missing_of_span == 0.0
