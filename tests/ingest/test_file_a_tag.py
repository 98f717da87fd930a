"""A file or a sheet a tag, with a heading: the tag is its name."""

from pathlib import Path

import pytest

from app.ingest import TagMapping
from app.ingest.exports.reading import takes_its_name

from .conftest import Read
from .test_tables import workbook

SHAPES = [
    ("Timestamp,Value", "2024-03-14 08:00:{k:02d},{k}.5"),
    ("Timestamp,Value,Quality", "2024-03-14 08:00:{k:02d},{k}.5,Good"),
    ("Date;Time;Value", "14.03.2024;08:00:{k:02d};{k}.5"),
    ("Zeitstempel;Wert;Einheit", "2024-03-14 08:00:{k:02d};{k}.5;t/h"),
    ("Timestamp,Value [t/h],Status", "2024-03-14 08:00:{k:02d},{k}.5,192"),
]


def table(shape: tuple[str, str]) -> str:
    heading, row = shape
    return "\n".join((heading, *(row.format(k=k) for k in range(60)))) + "\n"


@pytest.mark.parametrize("shape", SHAPES)
def test_the_tag_is_the_name_of_the_file(read: Read, shape: tuple[str, str]) -> None:
    content = read(table(shape), name="FIC101.PV.csv")
    loop = content.loops["FIC101"]
    assert loop.pv.tolist() == [k + 0.5 for k in range(60)]
    assert [(found.loop, found.pv) for found in content.summary.loops if found.pv] == [("FIC101", "FIC101.PV")]


def test_a_mapping_tells_the_tag(read: Read) -> None:
    mapping = TagMapping.from_bytes(b"tag,loop,signal\n7-VALVE,FIC7,OP\n")
    content = read(table(SHAPES[0]), name="7-VALVE.csv", mapping=mapping)
    assert content.loops["FIC7"].op.tolist() == [k + 0.5 for k in range(60)]


def test_a_value_beside_a_pv_is_not_the_file(read: Read) -> None:
    content = read("Time,PV,OP,Value\n" + "".join(f"{k},{k},{k % 5},7\n" for k in range(60)), name="F1.csv")
    assert content.loops["F1"].others["Value"].tolist() == [7.0] * 60


def test_the_name_matters(tmp_path: Path) -> None:
    path = tmp_path / "FIC101.PV.csv"
    path.write_text(table(SHAPES[0]))
    assert takes_its_name(path)


@pytest.mark.parametrize(("sheet", "name", "tag"), [("FIC7.PV", "book", "FIC7.PV"), ("S1", "FIC7.PV", "FIC7.PV")])
def test_a_sheet_that_is_called_like_a_tag(read: Read, sheet: str, name: str, tag: str) -> None:
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    rows = [line.split(",") for line in table(SHAPES[0]).splitlines()]
    content = read(workbook(rows, names={1: sheet}), name=f"{name}.xlsx")
    assert [loop.pv for loop in content.summary.loops] == [tag]


def test_sheets_of_a_tag_each_make_loops_together(read: Read) -> None:
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    rows = [[line.split(",") for line in table(SHAPES[0]).splitlines()] for _ in range(3)]
    names = {1: "FIC7.PV", 2: "FIC7.OP", 3: "FIC7.SP"}
    content = read(workbook(*rows, names=names), name="book.xlsx")
    loop = content.loops["FIC7"]
    assert loop.pv.tolist() == loop.op.tolist() == loop.sp.tolist() == [k + 0.5 for k in range(60)]
    (tags,) = content.summary.loops
    assert (tags.pv, tags.op, tags.sp) == ("FIC7.PV", "FIC7.OP", "FIC7.SP")
    assert content.summary.notes[0].startswith("the workbook has 3 sheets; 3 of them were read")
    assert content.rejects.total == 0


def test_sheets_of_a_signal_each_make_loops_together(read: Read) -> None:
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    stamps = [f"2024-03-14 08:00:{k:02d}" for k in range(60)]
    sheets = [
        [["Time", f"A.{signal}", f"B.{signal}"], *([stamp, f"{k}", f"{k + n}"] for k, stamp in enumerate(stamps))]
        for n, signal in enumerate(("PV", "OP"), start=1)
    ]
    content = read(workbook(*sheets))
    assert content.loops["B"].pv.tolist() == [k + 1 for k in range(60)]
    assert content.loops["B"].op.tolist() == [k + 2 for k in range(60)]
    assert content.loops["A"].op.tolist() == list(range(60))


def test_a_sheet_a_day_of_one_tag_is_not_joined(read: Read) -> None:
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    days = [[["Time", "A.PV"], *([f"2024-03-{day} 08:00:{k:02d}", f"{k}"] for k in range(60))] for day in (14, 15)]
    content = read(workbook(*days))
    assert content.loops["A"].samples == 60
