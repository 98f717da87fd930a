"""Blank lines, with blanks in them or without, are no rows: not in memory, and not in what is counted."""

import tracemalloc
from pathlib import Path

import pytest

from app.errors import DataError
from app.ingest import IngestOptions, read_export
from app.ingest.files.opening import Lines
from app.ingest.tables.blank_lines import LONG_RUN, parts_between, with_empty_lines
from tests.ingest.conftest import Read, in_pairs

HEADER = "Time,FIC1.PV,FIC1.OP\n"


def row(k: int) -> str:
    return f"2026-01-31 00:{k // 60:02d}:{k % 60:02d},{k % 9}.5,{k % 7}.5\n"


@pytest.mark.parametrize("blank", ["\n", "   \n", " \r\n"])
@pytest.mark.parametrize("options", [IngestOptions(), IngestOptions(chunk_bytes=300)])
@pytest.mark.parametrize("many", [1, 40, 20_000])
def test_they_are_no_rows_whatever_the_chunks_are(read: Read, blank: str, options: IngestOptions, many: int) -> None:
    text = HEADER + "".join(map(row, range(50))) + many * blank + "never,1,2\n" + row(50) + many * blank
    content = read(text, options=options)
    assert (content.summary.rows_read, content.summary.rows_kept) == (52, 51)
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(52 + many, "bad_time")]


def test_those_with_blanks_take_no_more_memory_than_those_without(tmp_path: Path) -> None:
    peaks = []
    for blank in ("\n", "   \n"):
        path = tmp_path / "blank.csv"
        path.write_text(HEADER + "".join(map(row, range(500))) + 500_000 * blank + "".join(map(row, range(500, 999))))
        tracemalloc.start()
        assert sum(stretch.samples for stretch in read_export(path).loops()) == 999
        peaks.append(tracemalloc.get_traced_memory()[1] - path.stat().st_size)
        tracemalloc.stop()
    assert peaks[1] < 1.5 * peaks[0] + 3 * 500_000


@pytest.mark.parametrize("before", [b"", b"1,2\n", b"1,2\n" * 9000])
@pytest.mark.parametrize("blank", [b"\n", b"  \n", b"\t\r\n"])
@pytest.mark.parametrize("after", [b"", b"  3,4\n", b"3,4\n" * 9000])
def test_parts_keep_their_lines(before: bytes, blank: bytes, after: bytes) -> None:
    many = LONG_RUN // len(blank) + 1 + len(before) // 3
    data = before + many * blank + after + many * blank + after
    parts = list(parts_between(Lines(data, 7, data.count(b"\n"))))
    assert b"".join(part.data for part in parts) == before + after + after
    lines = data.split(b"\n")
    for part in parts:
        assert part.count == part.data.count(b"\n")
        assert part.data.split(b"\n")[:-1] == lines[part.first - 7 : part.first - 7 + part.count]
    assert with_empty_lines(data) == (before + (many * b"\n" + after) * 2, 2 * many)


@pytest.mark.parametrize("blank", ["\n", "   \n", " \t\r\n"])
@pytest.mark.parametrize("options", [IngestOptions(), IngestOptions(chunk_bytes=300)])
@pytest.mark.parametrize("names", ["Tag,Time,Value", "Time,Tag,Value"])
def test_those_of_a_table_of_a_tag_a_row_are_not_refused(
    read: Read, blank: str, options: IngestOptions, names: str
) -> None:
    stamps = [f"2026-01-31 00:{k:02d}:00" for k in range(50)]
    rows = [(tag, at, f"{k % 7}.5") for k, at in enumerate(stamps) for tag in ("FIC1.PV", "FIC1.OP")]
    lines = [f"{row[0]},{row[1]},{row[2]}\n" if names[1] == "a" else f"{row[1]},{row[0]},{row[2]}\n" for row in rows]
    lines[50:50] = [3 * blank, "never,never,1\n"]
    content = read("".join((f"{names}\n", *lines, 2 * blank)), options=options)
    assert (content.summary.rows_read, content.summary.rows_kept) == (101, 100)
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(55, "bad_time")]


@in_pairs(
    blank=["\n", "  \n", ",,\n", '"","",""\n', " , ,\r\n"],
    many=[41, 100, 399, 400, 10_000],
    titles=["", "Export of unit 3,,\n"],
)
def test_hundreds_of_them_below_the_names_or_above_are_passed_over(
    read: Read, blank: str, many: int, titles: str
) -> None:
    rows = [row(k) for k in range(300)]
    text = titles + many * blank * bool(titles) + HEADER + many * blank + "".join(rows[:9]) + "never,1,2\n" + rows[9]
    content = read(text)
    assert content.loops["FIC1"].samples == 10
    line = 1 + many + 10 + bool(titles) * (1 + many)
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(line, "bad_time")]


@pytest.mark.parametrize("text", [100 * "\n" + HEADER, HEADER + 100 * "\n"], ids=["below the names", "below blanks"])
def test_the_line_of_units_below_them_is_told(read: Read, text: str) -> None:
    content = read(text + ",t/h,%\n" + "".join(map(row, range(50))))
    assert any("line 102 was read as units" in note for note in content.summary.notes)


def test_rows_without_times_above_the_others_are_told(read: Read) -> None:
    with pytest.raises(DataError, match=r"first 60 rows below the names .* '2026-01-31 00:00:00'") as refused:
        read(HEADER + 60 * ",1.5,2\n" + "".join(map(row, range(50))))
    assert refused.value.code == "unknown_layout"
