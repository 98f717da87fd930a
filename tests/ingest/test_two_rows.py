"""Headings of two rows, tags in one and signals in the other."""

from datetime import datetime, timedelta

import pytest

from app.ingest import LoopTags, TagMapping

from .conftest import Read
from .test_tables import workbook

TIMES = [datetime(2026, 3, 1, 22) + timedelta(minutes=i) for i in range(60)]


def table(heading: str, columns: int) -> str:
    values = ",".join(f"{column}{{i}}" for column in range(1, columns + 1))
    rows = (f"{time:%Y-%m-%d %H:%M:%S}," + values.format(i=f"{i:02d}") for i, time in enumerate(TIMES))
    return "\n".join((heading, *rows)) + "\n"


def first_values(read: Read, heading: str, columns: int) -> dict[str, dict[str, float]]:
    loops = read(table(heading, columns)).loops
    named = ("pv", "op", "sp")
    return {
        name: {signal: getattr(loop, signal)[0] / 100 for signal in named if getattr(loop, signal) is not None}
        for name, loop in loops.items()
    }


TWO = {"FIC101": {"pv": 1, "op": 2}, "TIC2": {"pv": 3, "op": 4}}


@pytest.mark.parametrize(
    "heading",
    [
        "Time,FIC101,FIC101,TIC2,TIC2\n,PV,OP,PV,OP",
        "Time,FIC101,,TIC2,\n,PV,OP,PV,OP",
        ",FIC101,,TIC2,\nTime,PV,OP,PV,OP",
        "Time,FIC101,,TIC2,\nTimestamp,PV (t/h),OP (%),PV (degC),OP (%)",
        "Time,FIC101,,TIC2,\n,PV,OP,PV,OP\n,t/h,%,degC,%",
        "Report of unit 5,,,,\n,FIC101,,TIC2,\n,Feed flow,,Outlet temperature,\nTime,PV,OP,PV,OP",
        "Report of unit 5\n\n,FIC101,,TIC2,\nTime,Istwert,Stellgröße,Istwert,Stellgröße",
        "Time,FIC101,FIC101,TIC2,TIC2\n,PV,OP,PV,OP\n,Feed,Feed,Outlet,Outlet\n,t/h,%,degC,%",
    ],
)
def test_tags_above_signals(read: Read, heading: str) -> None:
    assert first_values(read, heading, 4) == TWO


@pytest.mark.parametrize("heading", ["Time,PV,PV,OP,OP\n,F1,T2,F1,T2", "Time,PV,,OP,\n,F1,T2,F1,T2"])
def test_signals_above_tags(read: Read, heading: str) -> None:
    assert first_values(read, heading, 4) == {"F1": {"pv": 1, "op": 3}, "T2": {"pv": 2, "op": 4}}


def test_a_note_says_how_they_were_read(read: Read) -> None:
    summary = read(table(",FIC101,,TIC2,\nTime,PV,OP,PV,OP", 4)).summary
    assert summary.layout == "two_rows"
    (note,) = summary.notes
    assert note.endswith("were read as FIC101.PV, FIC101.OP, TIC2.PV, ...")


def test_counts_of_the_unit_that_their_name_tells(read: Read) -> None:
    rows = "".join(f"{10**6 * (12_345 + i)},1{i:02d},2{i:02d},3{i:02d},4{i:02d}\n" for i in range(60))
    loop = read("time [us],FIC101,,TIC2,\n,PV,OP,PV,OP\n" + rows).loops["FIC101"]
    assert loop.time_ns.tolist() == [10**9 * (12_345 + i) for i in range(60)]


def test_further_columns(read: Read) -> None:
    heading = "Time,FIC101,,,,Ambient\n,PV,OP,Mode,Alarm,"
    text = table(heading, 5).replace(",3", ",AUTO #").replace("#0", "").replace("#", "")
    (loop, alarm, ambient) = read(text).summary.loops
    assert loop == LoopTags("FIC101", "FIC101.PV", "FIC101.OP", None, "FIC101.Mode")
    assert (alarm.loop, ambient.loop) == ("FIC101.Alarm", "Ambient")


def test_one_loop_of_a_name_like_a_tag(read: Read) -> None:
    assert first_values(read, ",FIC101,,\nTime,PV,OP,SP", 3) == {"FIC101": {"pv": 1, "op": 2, "sp": 3}}


@pytest.mark.parametrize(
    "heading",
    [
        "Time,PV,OP\n,t/h,%",
        "Time,PV,OP\nDateTime,Float,Float",
        ",Feed flow,Feed valve\nTime,PV,OP",
        ",Report of unit 5,\nTime,PV,OP",
        ",%,%\nTime,PV,OP",
        "Time,PV,OP\n,FIC101,FIC101",
    ],
)
def test_what_is_in_doubt_stays_the_loop_of_the_file(read: Read, heading: str) -> None:
    assert first_values(read, heading, 2) == {"export": {"pv": 1, "op": 2}}


def test_tags_of_a_mapping(read: Read) -> None:
    mapping = TagMapping.from_bytes(b"tag,loop,signal\nFIC101.PV,Feed,PV\nFIC101.OP,Feed,OP\n")
    assert "Feed" in read(table(",FIC101,,TIC2,\nTime,PV,OP,PV,OP", 4), mapping=mapping).loops


def test_merged_cells_of_a_workbook(read: Read) -> None:
    rows = [[f"{time:%Y-%m-%d %H:%M:%S}", *(100 * k + i for k in range(1, 5))] for i, time in enumerate(TIMES)]
    data = workbook([["Time", "FIC101", "", "TIC2", ""], ["", "PV", "OP", "PV", "OP"], *rows])
    loops = read(data, "export.xlsx").loops
    assert {name: (loop.pv[0], loop.op[0]) for name, loop in loops.items()} == {
        "FIC101": (100, 200),
        "TIC2": (300, 400),
    }


@pytest.mark.parametrize("start", ["06:00:00", "2026/03/01", "01.03.2026 06:00:00"])
@pytest.mark.parametrize("time", ["X_Value", "Time"])
def test_the_start_of_each_signal_is_no_tag(read: Read, start: str, time: str) -> None:
    rows = "".join(f"{k}.0,{k % 7},{k % 5 + 50}\n" for k in range(40))
    content = read(f"Start,{start},{start}\n{time},PV,OP\n{rows}", name="F1.csv")
    assert content.loops["F1"].pv.tolist() == [k % 7 for k in range(40)]


@pytest.mark.parametrize(
    "tags",
    [("21-10-1001", "21-10-1002"), ("10-11-2034", "10-11-2035"), ("10/11/2034", "10/11/2035"), ("7/1/1", "7/1/2")],
)
def test_numbers_of_loops_may_look_as_dates(read: Read, tags: tuple[str, str]) -> None:
    rows = "".join(f"2026-03-01 00:00:{k},{k % 7},{k % 5 + 50},{k % 3},{k}\n" for k in range(10, 40))
    below = read(f",{tags[0]},,{tags[1]},\nTime,PV,OP,PV,OP\n{rows}")
    beside = read("Time," + ",".join(f"{tag}/{signal}" for tag in tags for signal in ("PV", "OP")) + f"\n{rows}")
    for content in (below, beside):
        assert list(content.loops) == list(tags)
        assert content.loops[tags[1]].op.tolist() == list(range(10, 40))


@pytest.mark.parametrize("tag", ["21-10-1001", "10-11-2034", "21/10/1001"])
def test_the_number_of_one_loop_may_look_as_a_date(read: Read, tag: str) -> None:
    rows = "".join(f"2026-03-01 00:00:{k},{k % 7},{k % 5 + 50}\n" for k in range(10, 40))
    assert list(read(f"Time,{tag},{tag}\n,PV,OP\n{rows}").loops) == [tag]


def test_names_that_are_clocks_beside_those_of_signals(read: Read) -> None:
    rows = "".join(f"2026-03-01 00:00:{k},{k % 7},{k % 5 + 50},1,2,3\n" for k in range(10, 40))
    assert "A" in read(f"Time,A.PV,A.OP,06:00,14:00,22:00\n{rows}").loops
