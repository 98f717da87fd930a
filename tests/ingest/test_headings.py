"""What stands below the names and is no sample: told as heading or comment, or refused with line and reason; a row of
data with a bad time is one of data also where it is the first one."""

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from app.ingest import inspect
from tests.ingest.conftest import Content, Read
from tests.ingest.test_tables import workbook

STAMPS = [f"2026-01-01 00:{k // 60:02}:{k % 60:02}" for k in range(199)]
SECONDS = [str(k) for k in range(199)]
Row = list[str]


def rows(times: list[str], fields: Callable[[str, str], Row]) -> list[Row]:
    return [fields(time, str(k % 7)) for k, time in enumerate(times)]


def text(*given: Row) -> str:
    return "".join(",".join(row) + "\n" for row in given)


def told(content: Content) -> tuple[int, list[tuple[int | None, str]]]:
    return content.summary.rows_kept, [(reject.line, reject.code) for reject in content.rejects.listed]


LAYOUTS: dict[str, tuple[list[Row], Callable[[str, str], Row]]] = {
    "wide": ([["time", "PV", "OP"]], lambda time, value: [time, value, value]),
    "wide units": ([["time", "PV", "OP"], ["s", "m3/h", "%"]], lambda time, value: [time, value, value]),
    "two_rows": (
        [["", "FIC1", "", "TIC2", ""], ["time", "PV", "OP", "PV", "OP"]],
        lambda time, value: [time, value, value, value, value],
    ),
    "trendminer": (
        [["Name", "F1.PV", "F1.OP"], ["Description", "a", "b"], ["Unit", "%", "%"], ["Type", "ANALOG", "ANALOG"]],
        lambda time, value: [time, value, value],
    ),
    "ignition": (
        [["#NAMES"], ["t", "F1.PV", "F1.OP"], ["#TYPES"], ["date", "D", "D"], ["#ROWS", "199"]],
        lambda time, value: [time, value, value],
    ),
    "long": ([["tag", "time", "value"]], lambda time, value: ["F1.PV", time, value]),
    "long_bare": ([], lambda time, value: ["F1.PV", time, value]),
    "per_tag": ([], lambda time, value: [time, value]),
}


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_bad_times_of_the_first_rows_are_refused_in_every_layout(read: Read, layout: str, count: int) -> None:
    heading, fields = LAYOUTS[layout]
    bad = [fields("zz", "31")] * count
    content = read(text(*heading, *bad, *rows(STAMPS, fields)))
    first = len(heading) + 1
    assert told(content) == (199, [(first + k, "bad_time") for k in range(count)])


def test_bad_times_of_the_first_rows_of_datalink_are_refused_in_each_of_its_groups(read: Read) -> None:
    data = rows(STAMPS, lambda time, value: [time, value, time, value])
    content = read(text(["F1.PV", "", "F1.OP", ""], ["zz", "31", "zz", "52"], *data))
    assert content.summary.layout == "pi_datalink"
    assert told(content) == (199, [(2, "bad_time"), (2, "bad_time")])
    nameless = read(text(["zz", "31", "zz", "52"], *data))
    assert told(nameless) == (199, [(1, "bad_time"), (1, "bad_time")])
    assert list(nameless.loops) == ["export.1", "export.2"]
    units = read(text(["F1.PV", "", "F1.OP", ""], ["", "t/h", "", "%"], *data))
    assert told(units) == (199, [])
    assert units.summary.notes == ("line 2 was read as units, not as data: ', t/h, , %'",)
    assert dict(units.summary.units) == {"F1.PV": "t/h", "F1.OP": "%"}


@pytest.mark.parametrize("times", [SECONDS, STAMPS])
@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("zz,31,52", "bad_time"),
        (",31,52", "bad_time"),
        ("zz,31,Bad", "bad_time"),
        ('"0,31,52', "unbalanced_quote"),
        ("zz,31", "ragged_row"),
        ("zz,31,52,7", "ragged_row"),
    ],
)
def test_a_bad_row_is_refused_first_as_it_is_further_down(read: Read, times: list[str], line: str, code: str) -> None:
    data = text(*rows(times, lambda time, value: [time, value, value])).splitlines(keepends=True)
    first = read("time,PV,OP\n" + line + "\n" + "".join(data))
    later = read("time,PV,OP\n" + "".join([*data[:50], line + "\n", *data[50:]]))
    assert (first.summary.layout, later.summary.layout) == ("wide", "wide")
    assert (told(first), told(later)) == ((199, [(2, code)]), (199, [(52, code)]))
    assert [reject.text for reject in first.rejects.listed] == [reject.text for reject in later.rejects.listed]


def test_bad_first_rows_do_not_make_a_wide_file_one_of_trendminer(read: Read) -> None:
    data = rows(STAMPS[2:], lambda time, value: [time, value, value])
    content = read(text(["time", "PV", "OP"], *[["zz", "31", "52"]] * 3, *data))
    assert content.summary.layout == "wide"
    assert told(content) == (197, [(2, "bad_time"), (3, "bad_time"), (4, "bad_time")])


@pytest.mark.parametrize("packed", [False, True])
def test_inspect_tells_the_same_of_a_packed_file(tmp_path: Path, packed: bool) -> None:
    data = text(["time", "PV", "OP"], ["zz", "31", "52"], *rows(SECONDS, lambda time, value: [time, value, value]))
    path = tmp_path / "f.csv"
    path.write_bytes(gzip.compress(data.encode()) if packed else data.encode())
    report = inspect(path)
    assert (report.summary.rows_kept, [(r.line, r.code) for r in report.rejects.listed]) == (199, [(2, "bad_time")])


def test_bad_first_rows_of_a_workbook_are_refused(read: Read) -> None:
    data = [[time, k % 7, k % 5] for k, time in enumerate(STAMPS)]
    content = read(workbook([["time", "PV", "OP"], ["", "m3/h", "%"], ["zz", 31, 52], *data]), name="a.xlsx")
    assert told(content) == (199, [(3, "bad_time")])
    assert content.summary.notes[0] == "line 2 was read as units, not as data: ', m3/h, %'"


def test_the_names_of_a_parquet_table_are_in_no_line(read: Read, tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    ones = [str(k % 7) for k in range(199)]
    pl.DataFrame({"time": ["", "zz", *STAMPS], "PV": ["t/h", "31", *ones], "OP": ["1", "52", *ones]}).write_parquet(
        path
    )
    content = read(path.read_bytes(), name="a.parquet")
    assert told(content) == (199, [(2, "bad_time")])
    assert content.summary.notes[0] == "line 1 was read as units, not as data: ', t/h, 1'"


def test_units_descriptions_types_and_comments_below_the_names_are_told(read: Read) -> None:
    heading = [["time", "PV", "OP"], ["", "flow", "valve"], ["s", "m3/h", "%"], ["# by hand"], [], ["date", "D", "D"]]
    content = read(text(*heading, *rows(STAMPS, lambda time, value: [time, value, value])))
    assert told(content) == (199, [])
    assert content.summary.notes == (
        "lines 2, 6 were read as heading, not as data: ', flow, valve'",
        "line 3 was read as units, not as data: 's, m3/h, %'",
        "line 4 was read as comment, not as data: '# by hand'",
    )


def test_of_a_long_heading_the_first_lines_are_told(read: Read) -> None:
    heading = [["time", "PV", "OP"], *[["", "flow", "valve"]] * 7]
    content = read(text(*heading, *rows(STAMPS, lambda time, value: [time, value, value])))
    assert content.summary.notes[0].startswith("lines 2, 3, 4, 5, 6, ... were read as heading")


@pytest.mark.parametrize("layout", ["wide", "long"])
def test_comments_between_the_rows_are_counted(read: Read, layout: str) -> None:
    heading, fields = LAYOUTS[layout]
    data = rows(STAMPS, fields)
    content = read(text(*heading, *data[:9], ["# checked", "", ""], ["* by shift B", "", ""], *data[9:]))
    assert told(content) == (199, [])
    assert "2 lines that begin with *, # or [ were passed over as comments" in content.summary.notes


def test_notes_write_their_numbers_as_pages_do(read: Read) -> None:
    stamps = [f"2026-01-01 {n // 3600:02d}:{n // 60 % 60:02d}:{n % 60:02d}" for n in range(9000)]
    data = rows(stamps, lambda time, value: [time, value, value])
    remarks = [["# checked", "", ""]] * 1200
    repeated = [row for row in data[5000:6500] for _ in range(2)]
    content = read(text(["time", "PV", "OP"], *data[:5000], *repeated, *remarks, *data[6500:]))
    notes = "; ".join(content.summary.notes)
    assert "1,200 lines that begin with *, # or [ were passed over as comments" in notes
    assert "1,500 rows have the time of a row before" in notes


def test_control_characters_in_names_are_replaced_and_told(read: Read) -> None:
    data = text(*rows(STAMPS, lambda time, value: [time, value, value]))
    content = read(f"time,FIC\a1.PV,FIC\a1.OP\n{data}")
    assert list(content.loops) == ["FIC\N{REPLACEMENT CHARACTER}1"]
    shown = "FIC\N{REPLACEMENT CHARACTER}1.PV, FIC\N{REPLACEMENT CHARACTER}1.OP"
    assert f"control characters in names of tags were replaced: {shown}" in content.summary.notes
    assert list(read(f"time,PV,OP\n{data}", name="A\nB.csv").loops) == ["A\N{REPLACEMENT CHARACTER}B"]


@pytest.mark.parametrize(
    "heading",
    [
        "Timestamp,Feed flow,Feed valve,Feed setpoint\n,FIC1.PV,FIC1.OP,FIC1.SP",
        "Timestamp,Feed flow,Feed valve,Feed setpoint\n,FIC1.PV,FIC1.OP,FIC1.SP\n,t/h,%,t/h",
        "Description,Feed flow,Feed valve,Feed setpoint\nTag,FIC1.PV,FIC1.OP,FIC1.SP\nUnits,t/h,%,t/h",
        "Time,Feed PV,Feed valve,Feed setpoint\nTime,FIC1.PV,FIC1.OP,FIC1.SP",
        "Tagname,FIC1.PV,FIC1.OP,FIC1.SP\nDescription,Feed PV,Feed output,Feed set point\nUnits,t/h,%,t/h",
        "Unit 5,,,\nTimestamp,Feed flow,Feed valve,Feed setpoint\n,FIC1.PV,FIC1.OP,FIC1.SP",
    ],
)
def test_tags_below_their_descriptions_or_above(read: Read, heading: str) -> None:
    content = read(f"{heading}\n" + "".join(f"2024-03-01 00:{k:02d}:00,{k},{k % 5},7\n" for k in range(40)))
    loop = content.loops["FIC1"]
    assert loop.pv.tolist() == list(range(40))
    assert (loop.op[1], loop.sp[0], len(content.loops)) == (1, 7, 1)


@pytest.mark.parametrize(
    "heading",
    ["Time [min],Feed flow,Feed valve\n,FIC1.PV,FIC1.OP", ",FIC1.PV,FIC1.OP\nTime [min],Feed flow,Feed valve"],
)
def test_the_times_are_named_in_either_row(read: Read, heading: str) -> None:
    content = read(f"{heading}\n" + "".join(f"{k},{k},{k % 5}\n" for k in range(40)))
    assert np.unique(np.diff(content.loops["FIC1"].time_ns)).tolist() == [60 * 10**9]
