"""Rows of names further down: on each page, before each series, or of another export put behind the first one."""

import pytest

from app.ingest import IngestOptions

from .conftest import Read

MINUTES = [f"2024-03-01 {i // 60:02d}:{i % 60:02d}:00" for i in range(600)]
OPTIONS = [IngestOptions(), IngestOptions(chunk_bytes=300)]


def rows(first: int, last: int) -> str:
    return "".join(f"{stamp},{i},1{i}\n" for i, stamp in enumerate(MINUTES[first:last], start=first))


@pytest.mark.parametrize("options", OPTIONS)
@pytest.mark.parametrize("other", ["time,A.OP,A.PV", '"Time","B.PV","B.OP"', "TIME,B.PV"])
def test_what_stands_below_other_names_is_refused(read: Read, other: str, options: IngestOptions) -> None:
    content = read(f"time,A.PV,A.OP\n{rows(0, 450)}{other}\n{rows(450, 500)}", options=options)
    assert content.loops["A"].pv.tolist() == list(range(450))
    assert content.rejects.counts["other_names"] == 50
    assert set(content.loops) == {"A"}


@pytest.mark.parametrize("options", OPTIONS)
def test_the_same_names_go_on(read: Read, options: IngestOptions) -> None:
    names = "time,A.PV,A.OP\n"
    text = f"{names}{rows(0, 100)}{names}{rows(100, 200)}time,B.PV,B.OP\n{rows(0, 50)}{names}{rows(200, 300)}"
    content = read(text, options=options)
    assert content.loops["A"].pv.tolist() == list(range(300))
    assert content.rejects.counts["other_names"] == 50
    told = next(reject for reject in content.rejects.listed if reject.code == "other_names")
    assert (told.line, told.text.partition(":")[0]) == (204, "below other names than the first ones, in line 203")


def test_names_of_dates_and_clocks(read: Read) -> None:
    split = [rows(0, 50).replace(" ", ","), rows(50, 90).replace(" ", ",")]
    content = read(f"Date,Time,A.PV,A.OP\n{split[0]}Date,Time,A.OP,A.PV\n{split[1]}")
    assert content.loops["A"].pv.tolist() == list(range(50))
    assert content.rejects.counts["other_names"] == 40


def test_names_that_come_again_before_each_series(read: Read) -> None:
    names = "#datatype,string,long,dateTime:RFC3339,double,string,string\n,result,table,_time,_value,_field,loop\n"
    series = [
        "".join(f",,{number},{stamp.replace(' ', 'T')}Z,{i}.5,{signal},{loop}\n" for i, stamp in enumerate(MINUTES))
        for number, (loop, signal) in enumerate((loop, signal) for loop in ("F1", "F2") for signal in ("PV", "OP"))
    ]
    for length in (50, 600):
        content = read("\n".join(names + "".join(s.splitlines(keepends=True)[:length]) for s in series))
        assert set(content.loops) == {"F1", "F2"}
        assert content.loops["F2"].op.tolist() == [i + 0.5 for i in range(length)]


@pytest.mark.parametrize("options", OPTIONS)
@pytest.mark.parametrize(
    "again",
    [
        "time,A.PV [bar],A.OP [%]",
        "time,A.PV\N{NO-BREAK SPACE},A.OP",
        "\N{ZERO WIDTH NO-BREAK SPACE}time,A.PV,A.OP",
        "time,A.PV",
        "time,A.P",
        "time",
        "time,,",
    ],
)
def test_the_same_names_written_otherwise_or_cut_go_on(read: Read, again: str, options: IngestOptions) -> None:
    content = read(f"time,A.PV,A.OP\n{rows(0, 450)}{again}\n{rows(450, 500)}", options=options)
    assert content.loops["A"].pv.tolist() == list(range(500))
    assert "other_names" not in content.rejects.counts


@pytest.mark.parametrize("mark", ["", "\N{ZERO WIDTH NO-BREAK SPACE}"])
@pytest.mark.parametrize("time", ["time", '"time"'])
def test_names_behind_the_mark_of_a_file_of_its_own(read: Read, mark: str, time: str) -> None:
    content = read(f"{mark}{time},A.PV,A.OP\n{rows(0, 450)}{mark}{time},A.OP,A.PV\n{rows(450, 500)}")
    assert content.loops["A"].pv.tolist() == list(range(450))
    assert content.rejects.counts["other_names"] == 50


def test_an_empty_stamp_is_no_name_of_an_unnamed_index(read: Read) -> None:
    lines = [f'"{stamp}","{i}","1{i}"\n' for i, stamp in enumerate(MINUTES)]
    lines[300] = '"","300","1300"\n'
    content = read('"","A.PV","A.OP"\n' + "".join(lines))
    assert content.loops["A"].samples == 599
    assert dict(content.rejects.counts) == {"bad_time": 1}


@pytest.mark.parametrize("options", OPTIONS)
@pytest.mark.parametrize(
    ("first", "again", "others"),
    [
        ("time,A.PV [degC],A.OP [%]", "time,A.PV [degF],A.OP [%]", True),
        ("time,A.PV [degC],A.OP [%]", "time,A.PV [\N{DEGREE SIGN}C],A.OP", False),
        ("time,A.PV,A.OP\n,degC,%", "time,A.PV,A.OP\n,degF,%", True),
        ("time,A.PV,A.OP\n,m3/h,%", "time,A.PV,A.OP\n,m\N{SUPERSCRIPT THREE}/h,%", False),
    ],
)
def test_the_same_names_in_other_units(
    read: Read, first: str, again: str, others: bool, options: IngestOptions
) -> None:
    content = read(f"{first}\n{rows(0, 450)}{again}\n{rows(450, 500)}", options=options)
    assert content.loops["A"].pv.tolist() == list(range(450 if others else 500))
    assert content.rejects.counts.get("other_names", 0) == (50 if others else 0)


def test_names_that_come_again_with_their_times_behind_columns_that_are_not_read(read: Read) -> None:
    names = "id,row,index,ndx,FIC1.PV,FIC1.OP,Time"
    rows = [f"{k},{k},{k},{k},{k % 9}.5,{k % 7}.5,2026-01-01 00:{k:02d}:00" for k in range(40)]
    again = names.replace("FIC1.PV", "FIC2.PV")
    content = read("\n".join((names, *rows[:20], again, *rows[20:])) + "\n")
    assert dict(content.rejects.counts) == {"bad_time": 1, "other_names": 20}
