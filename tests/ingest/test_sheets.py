"""Workbooks with loops on several sheets."""

import copy
import gc
import weakref
from pathlib import Path

import pytest

from app.errors import DataError
from app.ingest import IngestOptions, TagMapping, read_recordings
from app.ingest.exports.workbooks import Workbook
from app.ingest.layouts import NotRecognised

from .conftest import Read
from .test_tables import workbook

pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
Rows = list[list[str]]


def sheet(*names: str, first: int = 1, hour: int = 0, rows: int = 30) -> Rows:
    """Values of the k-th column are 100 (first + k) and the minute."""
    values = [[f"{first + k}{i:02d}" for k, _ in enumerate(names)] for i in range(rows)]
    return [["Time", *names], *([f"2024-03-01 {hour:02d}:{i:02d}:00", *row] for i, row in enumerate(values))]


def test_all_sheets_with_loops_are_read(read: Read) -> None:
    cover = [["Date", "Author"], ["2024-03-01", "A. Smith"]]
    tags = (("C.PV", 8), ("C.OP", 9))
    rows = [[f"2024-03-01 02:{i:02d}:00", tag, f"{k}{i:02d}"] for i in range(30) for tag, k in tags]
    long = [["Time", "Tag", "Value"], *rows]
    content = read(workbook(cover, sheet("A.PV", "A.OP"), sheet("B.PV", "B.OP", first=4, hour=5), long))
    firsts = {name: (loop.pv[0], loop.op[0], loop.samples) for name, loop in content.loops.items()}
    assert firsts == {"A": (100, 200, 30), "B": (400, 500, 30), "C": (800, 900, 30)}
    summary = content.summary
    assert (summary.tags, summary.rows_read, summary.rows_kept, summary.values_kept) == (6, 120, 120, 180)
    assert summary.layout == "wide, long"
    assert [loop.loop for loop in summary.loops] == ["A", "B", "C"]
    assert summary.last_time_ns - summary.first_time_ns == (5 * 60 + 29) * 60 * 10**9
    assert summary.notes == ("the workbook has 4 sheets; 3 of them were read: 'S2', 'S3', 'S4'",)


def test_sheets_that_are_hidden_come_after_those_that_are_seen(read: Read) -> None:
    old, new = sheet("A.PV", "A.OP"), sheet("A.PV", "A.OP", first=4, hour=5)
    content = read(workbook(old, new, hidden=[1]))
    assert content.loops["A"].pv[0] == 400
    assert content.summary.notes[1] == "'S1' has loops of 'S2' and was not read: send it as a file of its own"
    assert read(workbook(old, new)).loops["A"].pv[0] == 100


def test_loops_without_a_name_are_called_after_their_sheets(read: Read) -> None:
    assert list(read(workbook(sheet("PV", "OP"), sheet("PV", "OP", "SP"))).loops) == ["S1", "S2"]
    assert list(read(workbook(sheet("PV", "OP"), [["cover"]])).loops) == ["export"]
    assert sorted(read(workbook(sheet("PV", "OP"), sheet("B.PV", "B.OP"))).loops) == ["B", "export"]


def in_seconds(rows: Rows) -> Rows:
    """A sheet whose times are seconds from a start of its own."""
    return [rows[0], *([str(60 * k), *row[1:]] for k, row in enumerate(rows[1:]))]


def test_loops_are_on_one_clock_where_all_sheets_bear_dates_or_one_has_them_all(tmp_path: Path) -> None:
    path = tmp_path / "plant.xlsx"
    one, other = sheet("A.PV", "A.OP"), sheet("B.PV", "B.OP", hour=5)
    path.write_bytes(workbook(one, other))
    starts_s = read_recordings(path).starts_s
    assert starts_s["plant:B"] - starts_s["plant:A"] == 5 * 3600.0
    for apart in ((one, in_seconds(other)), (in_seconds(one), in_seconds(other))):
        path.write_bytes(workbook(*apart))
        content = read_recordings(path)
        assert len(content.recordings) == 2
        assert not content.starts_s
    path.write_bytes(workbook(in_seconds(sheet("A.PV", "A.OP", "B.PV", "B.OP"))))
    assert dict(read_recordings(path).starts_s) == {"plant:A": 0.0, "plant:B": 0.0}


def test_a_sheet_with_loops_of_another_is_told(read: Read) -> None:
    content = read(workbook(sheet("A.PV", "A.OP"), sheet("A.PV", "A.OP", first=5), sheet("B.PV", "B.OP")))
    assert content.loops["A"].pv[0] == 100
    assert "'S2' has loops of 'S1' and was not read: send it as a file of its own" in content.summary.notes


def test_what_several_sheets_have_beside_their_loops_comes_once(read: Read) -> None:
    content = read(workbook(sheet("A.PV", "A.OP", "T9.PV"), sheet("B.PV", "B.OP", "T9.PV", first=5)))
    assert content.loops["T9"].pv[0] == 300
    assert [loop.loop for loop in content.summary.loops].count("T9") == 1
    assert "read from the first sheet that has them, and not from further ones: T9" in content.summary.notes


def test_what_is_refused_names_its_sheet(read: Read) -> None:
    bad = sheet("B.PV", "B.OP")
    bad[5][1] = "abc"
    content = read(workbook(sheet("A.PV", "A.OP"), bad))
    (reject,) = content.rejects.listed
    assert (reject.line, reject.code, reject.tag) == (6, "not_a_number", "B.PV")
    assert reject.text.startswith("sheet 'S2': ")


def test_a_sheet_that_cannot_be_read_leaves_the_others(read: Read) -> None:
    nameless = sheet("B" * 300 + ".PV", "B" * 300 + ".OP")
    timeless = [["Time", "C.PV", "C.OP"], ["soon", "1", "2"]]
    content = read(workbook(sheet("A.PV", "A.OP"), timeless))
    assert list(content.loops) == ["A"]
    assert content.summary.notes[1].startswith("'S2' was not read: below the names Time, C.PV, C.OP no row has a time")
    with pytest.raises(DataError):
        read(workbook(timeless, nameless))


def test_rows_of_a_sheet_that_cannot_be_read(read: Read) -> None:
    rows = [[f"2024-03-01 00:{i:02d}:00", f"B{i // 2}.{'OP' if i % 2 else 'PV'}", "1"] for i in range(30)]
    tags = [["Time", "Tag", "Value"], *rows]
    content = read(workbook(sheet("A.PV", "A.OP"), tags), options=IngestOptions(max_signals=10))
    assert "A" in content.loops
    assert content.rejects.counts["sheet_not_read"] == 1
    assert content.rejects.listed[0].text.startswith("sheet 'S2': more than 10 tags")
    with pytest.raises(DataError, match="more than 10 tags"):
        read(workbook(tags), options=IngestOptions(max_signals=10))


def test_notes_of_one_sheet_name_it_and_those_of_a_mapping_are_of_all(read: Read) -> None:
    mapping = TagMapping.from_bytes(b"tag,loop,signal\nX1,A,PV\nX2,A,OP\nY1,B,PV\nY2,B,OP\nZ,C,PV\n")
    backward = sheet("Y1", "Y2")
    backward[1:] = backward[:0:-1]
    content = read(workbook(sheet("X1", "X2"), backward), mapping=mapping)
    assert sorted(content.loops) == ["A", "B"]
    assert content.summary.notes == (
        "the workbook has 2 sheets; 2 of them were read: 'S1', 'S2'",
        "sheet 'S2': rows were not in order of time; they were sorted",
        "of the 3 loops of the mapping 1 is not in this file: C",
    )


def test_recordings_of_a_workbook(tmp_path: Path) -> None:
    path = tmp_path / "plant.xlsx"
    path.write_bytes(workbook(sheet("A.PV", "A.OP"), sheet("B.PV", "B.OP")))
    found = read_recordings(path)
    assert [recording.name for recording in found.recordings] == ["plant:A", "plant:B"]


def test_the_cells_of_one_sheet_are_held_at_a_time(tmp_path: Path) -> None:
    path = tmp_path / "plant.xlsx"
    path.write_bytes(workbook(*(sheet(f"A{i}.PV", f"A{i}.OP") for i in range(3))))
    book = Workbook(path)
    tables = [book.sheet(0)]
    held = weakref.ref(book._frame(0))
    tables.append(book.sheet(1))
    gc.collect()
    assert held() is None
    assert tables[0].part(1, 1, [1]).item() == "100"


def test_what_is_raised_survives_another_process() -> None:
    error = copy.copy(NotRecognised("nothing", named=True))
    assert (error.code, error.message, error.named) == ("unknown_layout", "nothing", True)
