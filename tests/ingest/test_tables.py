"""Parquet and workbooks."""

import io
import sys
import zipfile
from collections.abc import Collection, Mapping, Sequence
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from app.errors import DataError
from app.ingest import IngestOptions, TagMapping, read_named
from app.ingest.exports.tables_in import Table, TableSource

from .conftest import Read

TIMES = [datetime(2024, 3, 1, 0, minute) for minute in range(4)]
START = 1709251200 * 10**9
SIGNALS = ("PV", "OP")
SIZES = {"A.PV": 1e-11, "A.OP": 0.1}


def parquet(frame: pl.DataFrame, row_group_size: int | None = None) -> bytes:
    target = io.BytesIO()
    frame.write_parquet(target, row_group_size=row_group_size)
    return target.getvalue()


def test_wide_parquet(read: Read) -> None:
    frame = pl.DataFrame(
        {"t": TIMES, "A.PV": [1.0, 2.0, None, 4.0], "A.OP": [1, 2, 3, 4], "A.MODE": ["AUTO", "MAN", None, "AUTO"]}
    )
    content = read(parquet(frame), name="night.parquet")
    loop = content.loops["A"]
    assert content.summary.encoding == "parquet"
    assert loop.time_ns.tolist() == [START + i * 60 * 10**9 for i in range(4)]
    assert loop.op.tolist() == [1, 2, 3, 4]
    assert loop.automatic.tolist()[:2] == [1, 0]
    berlin = read(parquet(frame), options=IngestOptions(time_zone="Europe/Berlin"))
    assert berlin.loops["A"].time_ns[0] == START - 3600 * 10**9


@pytest.mark.parametrize("kind", [pl.String(), pl.Categorical(), pl.Enum(["1", "2", "3", "Bad Input", "AUTO"])])
def test_words_of_parquet_are_read_alike_with_and_without_a_dictionary(
    read: Read, tmp_path: Path, kind: pl.DataType
) -> None:
    words = {"A.PV": ["1", "2", "Bad Input", "3"], "A.OP": ["3", "2", "1", "2"], "A.MODE": ["AUTO"] * 4}
    frame = pl.DataFrame({"t": TIMES, **{tag: pl.Series(values).cast(kind) for tag, values in words.items()}})
    content = read(parquet(frame))
    assert content.loops["A"].op.tolist() == [3, 2, 1, 2]
    assert content.loops["A"].automatic.tolist() == [1] * 4
    assert np.isnan(content.loops["A"].pv).tolist() == [False, False, True, False]
    assert dict(content.rejects.counts) == {"not_a_number": 1}
    (tmp_path / "named.parquet").write_bytes(parquet(frame))
    named = read_named(tmp_path / "named.parquet", IngestOptions())
    assert named.may_hold_numbers("A.OP")
    assert named.numbers("A.OP").tolist() == [3, 2, 1, 2]


def test_long_parquet_with_text_among_the_values(read: Read) -> None:
    zone = timezone(timedelta(hours=1))
    frame = pl.DataFrame(
        {
            "TagName": ["A.PV", "A.OP"] * 4,
            "DateTime": [time.replace(tzinfo=zone) for time in TIMES for _ in range(2)],
            "Value": ["1", "10", "Bad Input", "20", "3", "30", "4", "40"],
            "Quality": [192, 192, 192, 192, 192, 0, 192, 192],
        }
    )
    content = read(parquet(frame), name="night.parquet")
    loop = content.loops["A"]
    assert loop.time_ns[0] == START - 3600 * 10**9
    assert loop.pv[0] == 1
    assert dict(content.rejects.counts) == {"not_a_number": 1, "bad_quality": 1}


def test_workbook(read: Read, tmp_path: Path) -> None:
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    content = read(
        workbook(
            [["Time", "A.PV", "A.OP"], ["2024-03-01 00:00:00", "1.5", "10"], ["2024-03-01 00:01:00", "No Data", "11"]]
        )
    )
    assert content.loops["A"].op.tolist() == [10, 11]
    assert dict(content.rejects.counts) == {"not_a_number": 1}


def test_a_workbook_whose_data_is_behind_a_cover(read: Read) -> None:
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    data = [["", "Time", "A.PV", "A.OP"], *(["", f"2024-03-01 00:0{i}:00", f"{i}", f"1{i}"] for i in range(3))]
    content = read(workbook([["Report of the month"]], [], [["made by"], ["a macro"], *data]))
    assert content.loops["A"].op.tolist() == [10, 11, 12]
    assert content.summary.notes == ("the workbook has 3 sheets; the one read is 'S3'",)
    assert code_of(read, workbook([["Report"]], [["of", "nothing"]])) == "unknown_layout"
    assert code_of(read, workbook([])) == "unknown_layout"


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e-7, 1e-12])
def test_cells_of_a_workbook_keep_their_digits_however_small(read: Read, scale: float) -> None:
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    pv = [scale * value for value in (0.123456789012, -1.5, 0.25, 7.25)]
    rows = [[str(time), "Bad" if at == 2 else pv[at], 10.0 * at] for at, time in enumerate(TIMES)]
    loop = read(workbook([["Time", "A.PV", "A.OP"], *rows])).loops["A"]
    assert loop.pv[[0, 1, 3]].tolist() == pytest.approx([pv[0], pv[1], pv[3]], rel=1e-9, abs=0.0)
    assert np.isnan(loop.pv[2])


@pytest.mark.parametrize("margin", [1, 3])
def test_small_numbers_are_of_their_own_columns_wherever_a_sheet_begins(read: Read, margin: int) -> None:
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    names = ["Tag", "Time", "Value", "Quality"]
    rows = [[tag, str(time), size * (k + 1.5), 0.0] for k, time in enumerate(TIMES) for tag, size in SIZES.items()]
    content = read(workbook([names, *rows], margin=margin))
    loop = content.loops["A"]
    assert loop.pv.tolist() == pytest.approx([1.5e-11, 2.5e-11, 3.5e-11, 4.5e-11], rel=1e-9, abs=0.0)
    assert loop.op.tolist() == pytest.approx([0.15, 0.25, 0.35, 0.45])
    assert content.rejects.total == 0


def test_cells_of_a_workbook_that_lost_no_digit_stay_as_they_are(read: Read) -> None:
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    qualities = [0.0, 0.0, 0.0, 24.0]
    rows = [[tag, str(time), 1.0, quality] for time, quality in zip(TIMES, qualities, strict=True) for tag in SIZES]
    content = read(workbook([["Tag", "Time", "Value", "Quality"], *rows]))
    assert [reject.text for reject in content.rejects.listed] == ["24"] * 2


def test_a_cover_with_dates_does_not_hide_the_data(read: Read) -> None:
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    cover = [["Date", "Author", "Version"], ["2024-03-01", "A. Smith", "1"], ["2024-03-02", "B. Jones", "2"]]
    times = [f"2024-03-01 00:0{i}:00" for i in range(3)]
    wide = [["Time", "A.PV", "A.OP"], *([time, f"{i}", f"1{i}"] for i, time in enumerate(times))]
    rows = [[time, f"A.{name}", f"{ten}{i}"] for name, ten in (("PV", ""), ("OP", 1)) for i, time in enumerate(times)]
    for data in (wide, [["Time", "Tag", "Value"], *rows]):
        content = read(workbook(cover, data, wide))
        assert content.loops["A"].op.tolist() == [10, 11, 12]
        assert content.summary.notes == (
            "the workbook has 3 sheets; the one read is 'S2'",
            "'S3' has loops of 'S2' and was not read: send it as a file of its own",
        )
    assert read(workbook(cover, [["a macro"]])).summary.notes[0].endswith("'S1'")


def test_a_mapping_tells_the_sheet_with_the_data(read: Read) -> None:
    """Tags whose names do not tell their loops, and a sheet before them with dates and numbers."""
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    cover = [["Date", "Shift", "Tons"], ["2024-03-01", "1", "812"], ["2024-03-02", "2", "799"]]
    data = [["Time", "X17", "X18"], *([f"2024-03-01 00:0{i}:00", f"{i}", f"1{i}"] for i in range(3))]
    mapping = TagMapping.from_bytes(b"tag,loop,signal\nX17,A,PV\nX18,A,OP\n")
    content = read(workbook(cover, data), mapping=mapping)
    assert content.loops["A"].op.tolist() == [10, 11, 12]
    assert read(workbook(cover, data)).summary.notes[0].endswith("'S1'")


@pytest.mark.parametrize("keep", [100, 400, 700])
def test_damaged_tables(read: Read, keep: int) -> None:
    whole = parquet(pl.DataFrame({"t": TIMES, "A.PV": [1.0, 2.0, 3.0, 4.0]}))
    codes = {code_of(read, data) for data in (whole[:keep], whole[:keep] + b"\0" * 50 + whole[keep + 50 :])}
    assert codes <= {"not_an_export", "unknown_layout", "nothing_readable", "none"}


def test_a_page_damaged_behind_the_head(read: Read) -> None:
    n = 5000
    times = [TIMES[0] + timedelta(seconds=i) for i in range(n)]
    values = np.random.default_rng(1).normal(size=(n, 2))
    data = bytearray(
        parquet(pl.DataFrame({"t": times, "A.PV": values[:, 0], "A.OP": values[:, 1]}), row_group_size=1000)
    )
    at = len(data) * 7 // 10
    data[at : at + 3000] = b"\xff" * 3000
    assert code_of(read, bytes(data)) == "not_an_export"


def test_a_table_without_times_and_one_that_is_too_large(read: Read) -> None:
    assert code_of(read, parquet(pl.DataFrame({"x": ["a", "b"], "y": ["c", "d"]}))) == "unknown_layout"
    with pytest.raises(DataError, match="4 rows of 2 columns") as refused:
        read(parquet(pl.DataFrame({"t": TIMES, "A.PV": [1.0, 2.0, 3.0, 4.0]})), options=IngestOptions(max_bytes=50))
    assert refused.value.code == "decompressed_too_large"


def test_columns_that_hold_no_numbers_leave_the_others(read: Read) -> None:
    frame = pl.DataFrame(
        {"t": TIMES, "A.PV": [1.0, 2.0, 3.0, 4.0], "A.OP": [[1.0]] * 4, "A.SP": [b"\xff"] * 4, "A.MODE": TIMES}
    )
    content = read(parquet(frame))
    loop = content.loops["A"]
    assert loop.pv.tolist() == [1, 2, 3, 4]
    assert (loop.op, loop.sp) == (None, None)
    assert loop.automatic.tolist() == [-1, -1, -1, -1]
    note, left, modes, unknown = content.summary.notes
    assert unknown.startswith("not one mode of these tags is understood")
    assert unknown.endswith(": A.MODE")
    assert left == "columns that hold no number were left out: A.OP"
    assert note == "2 columns hold lists, structures or bytes, which are no values: A.OP, A.SP"
    assert modes.startswith("modes that are not understood count neither as automatic nor as manual: 2024-03-01")
    assert dict(content.rejects.counts) == {"unknown_mode": 4}


def test_more_columns_than_are_read_at_once(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.ingest.exports.tables_in.MOST_COLUMNS", 3)
    frame = pl.DataFrame({"t": TIMES, **{f"L{n}.{s}": [n + 0.0] * 4 for n in range(5) for s in ("PV", "OP")}})
    content = read(parquet(frame))
    assert {name: (loop.pv.tolist(), loop.op.tolist()) for name, loop in content.loops.items()} == {
        f"L{n}": ([n] * 4, [n] * 4) for n in range(5)
    }
    assert (content.summary.rows_read, content.summary.values_kept) == (4, 40)


def test_a_head_without_numbers_or_with_some_among_words(read: Read) -> None:
    words = pl.DataFrame({"t": TIMES, "A.PV": ["1", " 2", "3", None], "A.OP": ["1", "2", "3", "4"]})
    some = words.with_columns(pl.Series("A.SP", [5, 6, 7, None]))
    for frame in (words, some):
        loop = read(parquet(frame)).loops["A"]
        assert (np.nan_to_num(loop.pv, nan=-1).tolist(), loop.op.tolist()) == ([1, 2, 3, -1], [1, 2, 3, 4])


@pytest.mark.parametrize("most_columns", [1000, 3])
def test_rows_of_one_time_are_told_once_however_many_passes_read_them(
    read: Read, monkeypatch: pytest.MonkeyPatch, most_columns: int
) -> None:
    monkeypatch.setattr("app.ingest.exports.tables_in.MOST_COLUMNS", most_columns)
    times = [*TIMES, TIMES[-1]]
    frame = pl.DataFrame({"t": times, **{f"L{n}.{s}": [n + 0.0] * 5 for n in range(5) for s in ("PV", "OP")}})
    (note,) = read(parquet(frame)).summary.notes
    assert note.startswith("1 row has the time of a row before")


@pytest.mark.parametrize("most_columns", [1000, 3])
def test_a_stamp_that_repeats_the_one_before_is_told_once_however_many_passes_read_it(
    read: Read, monkeypatch: pytest.MonkeyPatch, most_columns: int
) -> None:
    monkeypatch.setattr("app.ingest.exports.tables_in.MOST_COLUMNS", most_columns)
    times = [datetime(2024, 3, 1, 0, minute) for minute in (0, 1, 2, 2, 4, 5, 6)]
    frame = pl.DataFrame(
        {"t": times, **{f"L{n}.{s}": [n + 0.5 * k for k in range(7)] for n in (1, 2) for s in SIGNALS}}
    )
    (note,) = read(parquet(frame)).summary.notes
    assert note == "1 stamp repeated the one before; its row went into the missing step"


@pytest.mark.parametrize(("height", "most"), [(1440, 4000), (100_000, 1000)])
def test_of_a_long_table_the_head_too_is_read_some_columns_at_a_time(height: int, most: int) -> None:
    """Of large groups of rows each column that is asked for takes memory."""
    asked: list[int] = []

    def part(offset: int, count: int, columns: Sequence[int]) -> pl.DataFrame:
        asked.append(len(columns))
        return pl.DataFrame({f"c{at}": [float(at)] * 4 if at else TIMES for at in columns})

    names = ("t", *(f"L{n}.{s}" for n in range(2500) for s in SIGNALS))
    source = TableSource(Table(len(names), height, names, part, apart=True), "x", "parquet", False, IngestOptions())
    assert source.tags() == list(names[1:])
    assert max(asked) == most


def test_spans_of_time_are_seconds(read: Read) -> None:
    spans = [timedelta(seconds=5 * k, milliseconds=500) for k in range(4)]
    values = [1.0, 2.0, 3.0, 4.0]
    beside = read(parquet(pl.DataFrame({"t": TIMES, "A.PV": values, "A.OP": values, "lag": spans})))
    assert beside.loops["A"].pv.tolist() == values
    alone = read(parquet(pl.DataFrame({"time": spans, "A.PV": values, "A.OP": values})))
    assert np.diff(alone.loops["A"].time_ns).tolist() == [5 * 10**9] * 3


def test_archives_that_are_no_workbook(read: Read) -> None:
    assert code_of(read, archive({"night.csv": "time,A.PV\n2024-03-01 00:00:00,1\n"})) == "not_an_export"
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    assert code_of(read, archive({"xl/workbook.xml": "nothing"})) == "not_an_export"


def test_a_workbook_without_the_extra_says_which(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fastexcel", None)
    with pytest.raises(DataError, match=r"loopaudit\[excel\]") as refused:
        read(workbook([["Time", "A.PV"], ["2024-03-01 00:00:00", "1"]]))
    assert refused.value.code == "excel_not_installed"


def code_of(read: Read, data: bytes) -> str:
    try:
        read(data)
    except DataError as error:
        return error.code
    return "none"


MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
PACKAGE = "http://schemas.openxmlformats.org/package/2006"
KIND = "application/vnd.openxmlformats-officedocument.spreadsheetml"
RELATIONS = "application/vnd.openxmlformats-package.relationships+xml"


def workbook(
    *sheets: Sequence[Sequence[str | float]],
    hidden: Collection[int] = (),
    names: Mapping[int, str] | None = None,
    margin: int = 0,
) -> bytes:
    """The smallest workbook that there is of these sheets, which are called S1, S2, ... where `names` has no other.
    margin: columns left empty before the first one."""
    numbers = range(1, len(sheets) + 1)
    called = {n: f"S{n}" for n in numbers} | dict(names or {})
    state = {n: ' state="hidden"' if n in hidden else "" for n in numbers}
    listed = "".join(f'<sheet name="{called[n]}" sheetId="{n}"{state[n]} r:id="r{n}"/>' for n in numbers)
    types = "".join(
        f'<Override PartName="/xl/worksheets/sheet{n}.xml" ContentType="{KIND}.worksheet+xml"/>' for n in numbers
    )
    types += (
        f'<Default Extension="rels" ContentType="{RELATIONS}"/>'
        f'<Override PartName="/xl/workbook.xml" ContentType="{KIND}.sheet.main+xml"/>'
    )
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{PACKAGE}/content-types">{types}</Types>',
        "_rels/.rels": relations("officeDocument", ["xl/workbook.xml"]),
        "xl/workbook.xml": f'<workbook xmlns="{MAIN}" xmlns:r="{OFFICE}"><sheets>{listed}</sheets></workbook>',
        "xl/_rels/workbook.xml.rels": relations("worksheet", [f"worksheets/sheet{n}.xml" for n in numbers]),
    }
    for n, rows in zip(numbers, sheets, strict=True):
        cells = "".join("<row>" + "<c/>" * margin + "".join(map(cell, row)) + "</row>" for row in rows)
        sheet = f'<worksheet xmlns="{MAIN}"><sheetData>{cells}</sheetData></worksheet>'
        parts[f"xl/worksheets/sheet{n}.xml"] = sheet
    return archive(parts)


def archive(parts: dict[str, str]) -> bytes:
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as packed:
        for name, text in parts.items():
            packed.writestr(name, text)
    return target.getvalue()


def cell(value: str | float) -> str:
    if isinstance(value, float):
        return f"<c><v>{value}</v></c>"
    return f'<c t="inlineStr"><is><t>{value}</t></is></c>'


def relations(kind: str, targets: list[str]) -> str:
    inner = "".join(
        f'<Relationship Id="r{n}" Type="{OFFICE}/{kind}" Target="{target}"/>' for n, target in enumerate(targets, 1)
    )
    return f'<Relationships xmlns="{PACKAGE}/relationships">{inner}</Relationships>'
