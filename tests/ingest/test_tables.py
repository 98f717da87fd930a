"""Parquet and workbooks."""

import io
import zipfile
from datetime import datetime, timedelta, timezone
from pathlib import Path

import polars as pl
import pytest

from app.errors import DataError
from app.ingest import IngestOptions

from .conftest import Read

TIMES = [datetime(2024, 3, 1, 0, minute) for minute in range(4)]
START = 1709251200 * 10**9


def parquet(frame: pl.DataFrame) -> bytes:
    target = io.BytesIO()
    frame.write_parquet(target)
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


@pytest.mark.parametrize("keep", [100, 400, 700])
def test_damaged_tables(read: Read, keep: int) -> None:
    whole = parquet(pl.DataFrame({"t": TIMES, "A.PV": [1.0, 2.0, 3.0, 4.0]}))
    codes = {code_of(read, data) for data in (whole[:keep], whole[:keep] + b"\0" * 50 + whole[keep + 50 :])}
    assert codes <= {"not_an_export", "unknown_layout", "nothing_readable", "none"}


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


def workbook(rows: list[list[str]]) -> bytes:
    """The smallest workbook that there is."""
    cells = "".join("<row>" + "".join(map(cell, row)) + "</row>" for row in rows)
    sheets = '<sheets><sheet name="S" sheetId="1" r:id="r1"/></sheets>'
    types = (
        f'<Default Extension="rels" ContentType="{RELATIONS}"/>'
        f'<Override PartName="/xl/workbook.xml" ContentType="{KIND}.sheet.main+xml"/>'
        f'<Override PartName="/xl/worksheets/sheet1.xml" ContentType="{KIND}.worksheet+xml"/>'
    )
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{PACKAGE}/content-types">{types}</Types>',
        "_rels/.rels": relation("officeDocument", "xl/workbook.xml"),
        "xl/workbook.xml": f'<workbook xmlns="{MAIN}" xmlns:r="{OFFICE}">{sheets}</workbook>',
        "xl/_rels/workbook.xml.rels": relation("worksheet", "worksheets/sheet1.xml"),
        "xl/worksheets/sheet1.xml": f'<worksheet xmlns="{MAIN}"><sheetData>{cells}</sheetData></worksheet>',
    }
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as archive:
        for name, text in parts.items():
            archive.writestr(name, text)
    return target.getvalue()


def cell(text: str) -> str:
    return f'<c t="inlineStr"><is><t>{text}</t></is></c>'


def relation(kind: str, target: str) -> str:
    inner = f'<Relationship Id="r1" Type="{OFFICE}/{kind}" Target="{target}"/>'
    return f'<Relationships xmlns="{PACKAGE}/relationships">{inner}</Relationships>'
