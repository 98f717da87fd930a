"""What the fields of a column are is seen in one pass over their bytes: the same values, notes and refusals as from
their texts."""

import re

import numpy as np
import pytest

from app.ingest import IngestOptions
from app.ingest.numbers.kind_codes import COMMA, DOUBTFUL_COMMA, DOUBTFUL_POINT, OTHER, POINT, WHOLE, WORD
from app.ingest.numbers.kinds import kinds_of
from app.ingest.numbers.marks import DOUBTFUL, before_decimals
from app.ingest.numbers.marks import WHOLE as WHOLE_NUMBER
from app.ingest.tables import frames
from app.ingest.tables.frames import FrameReader
from tests.ingest.conftest import Content, Read, in_pairs
from tests.ingest.test_blocks import same
from tests.ingest.test_writing import CHUNKS, DOUBT, LAYOUTS, MARKS, MIRRORED, TABLES, Table, long, marked, wide

LARGE_CHUNKS = IngestOptions(chunk_bytes=30_000)
NUMBERS = [
    *("1", "-12", "+123456", "0", "007"),
    *("1.5", "12.25", "0.125", "0.5", "+1.12345", "1234.125", "00.12", "0000.125", "12.1234"),
    *("1.125", "12.125", "-123.125", "+9.000"),
]
OTHERS = [
    *("5.", "-5.", ".5", "-.125", ",5", ".", "012.125", "00.125", "1e3", "1.125e3"),
    *(" 1.125", "1.125 ", "1.125 %", "1.2.3", "1.234,5"),
]
WORDS = ["Bad", "-", "+", "nan", "No Data", "#"]


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kinds are looked for however small a chunk is."""
    monkeypatch.setattr(frames, "LEAST_BYTES", 8)


def kinds_in(*lines: str, width: int = 3) -> list[int] | None:
    found = kinds_of("".join(lines).encode(), ";", width)
    return None if found is None else found.tolist()


def kind_of_text(text: str) -> int:
    if re.match(WHOLE_NUMBER, text):
        return WHOLE
    for mark, sure, doubtful in ((".", POINT, DOUBTFUL_POINT), (",", COMMA, DOUBTFUL_COMMA)):
        if re.match(before_decimals(mark, "$"), text):
            return sure
        if re.match(DOUBTFUL, text) and mark in text:
            return doubtful
    return WORD if not re.search(r"[\d.,]", text) else OTHER


@pytest.mark.parametrize("text", [*NUMBERS, *(number.replace(".", ",") for number in NUMBERS), *WORDS])
def test_the_kind_of_a_field_is_what_its_text_tells(seen: None, text: str) -> None:
    assert kinds_in(f"noon;{text};\n") == [WORD, kind_of_text(text), 0]


@pytest.mark.parametrize("text", [*OTHERS, "\N{DEGREE SIGN}", "\N{ARABIC-INDIC DIGIT THREE}"])
def test_what_is_neither_a_number_nor_a_word_is_looked_at_as_text(seen: None, text: str) -> None:
    assert kinds_in(f"{text};;\n") == [OTHER, 0, 0]


def test_a_column_has_the_kinds_of_all_its_fields(seen: None) -> None:
    found = kinds_in("1;;1,125\r\n", "1.5;Bad\r\n", "\n", "Bad;;7\n")
    assert found == [WHOLE | POINT | WORD, WORD, DOUBTFUL_COMMA | WHOLE]


@pytest.mark.parametrize("line", ["1;2;3;4\n", '1;"2";3\n', "1;2\r3;4\n"])
def test_rows_that_are_no_plain_ones_are_not_looked_at_so(seen: None, line: str) -> None:
    assert kinds_in(line) is None


FIELDS = {
    "all in doubt": (["50.123", "51.871"], ["40.100"]),
    "words between": (["50.123", "Bad", "", "nan", "51.871"], ["40.100", "", "inf"]),
    "both marks": (["50.123", "51,871"], ["40,100"]),
    "another column without a mark": (["50.123", "51.871"], ["40", "41"]),
    "numbers without a mark beside": (["5.123", "5", "6.250"], ["40.100"]),
    "parted beside hundreds": (["999", "1.001"], ["40.100"]),
    "the file tells": (["50.123", "51.871"], ["40.1"]),
    "the file tells late": (["50.123"], ["40.100"] * 500 + ["40.1"] * 100),
    "the file tells that they are thousands": (["50.123"] * 300 + ["1,5"] * 300, ["40.100"]),
    "a tag of its own": (["50.123"] * 300 + ["50,12"] * 100, ["40.100"] * 100 + ["40.1"] * 100),
    "units": (["50.123 %", "50.123"], ["40.100", "40.100 bar"]),
    "odd numbers": (["50.123", "012.125", "1e3", " 5.125", "1.2.3", "5."], ["40.100"]),
    "codes": (["50.123"] * 99 + ["-9999"], ["40.100"]),
}


@in_pairs(name=list(FIELDS), table=TABLES, marks=MARKS, chunk_bytes=[CHUNKS.chunk_bytes, 1 << 20])
def test_kinds_give_what_texts_give(
    read: Read, table: Table, marks: str, chunk_bytes: int, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pv, op = (marked(texts, marks) for texts in FIELDS[name])
    content, options = table(pv, op, count=600), IngestOptions(chunk_bytes=chunk_bytes)
    by_texts = read(content, options=options)
    monkeypatch.setattr(frames, "LEAST_BYTES", 8)
    same(read(content, options=options), by_texts)


@MIRRORED
@LAYOUTS
def test_numbers_all_in_doubt_are_read_without_their_texts(
    read: Read, seen: None, table: Table, marks: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FrameReader, "texts", lambda *_: pytest.fail("parted once more"))
    check_decimals(read(table(marked(["50.123", "", "51.871"], marks), marked(["40.100"], marks))))


def test_the_end_of_a_file_is_read_as_its_large_chunks(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frames, "LEAST_BYTES", 9_000)
    monkeypatch.setattr(FrameReader, "texts", lambda *_: pytest.fail("parted once more"))
    content = read(wide(["50.123"], ["40.100"], count=700), options=CHUNKS)
    assert content.loops["FIC1"].pv.tolist() == [50.123] * 700


@MIRRORED
def test_numbers_between_words_in_a_long_table_are_not_looked_at(
    read: Read, seen: None, marks: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.ingest.tables.long_table.marked", lambda *_: pytest.fail("looked for marks"))
    content = read(long(marked(["50.123", "Bad", "51.871"], marks), marked(["40.100"], marks)))
    check_decimals(content)
    assert dict(content.rejects.counts) == {"not_a_number": 20}


@LAYOUTS
@MIRRORED
def test_what_tells_in_one_mark_alone_needs_no_texts(
    read: Read, seen: None, table: Table, marks: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first of several chunks has a number that tells, behind what is looked at of the file."""
    monkeypatch.setattr(FrameReader, "texts", lambda *_: pytest.fail("parted once more"))
    op = ["40.100"] * 450 + ["40.1"] + ["40.100", "0.500", "7"] * 600
    content = read(table(marked(["50.123"], marks), marked(op, marks), count=2000), options=LARGE_CHUNKS)
    assert content.loops["FIC1"].pv.tolist() == [50.123] * 2000
    assert content.loops["FIC1"].op.tolist() == [float(text) for text in op[:2000]]


def test_what_tells_in_a_row_that_does_not_count_is_passed_over(read: Read, seen: None) -> None:
    rows = wide(["50.123"], ["40.100"], count=600) + "never;1.5;2.5\n"
    assert "read as decimals" in read(rows).summary.notes[0]


def check_decimals(content: Content) -> None:
    assert content.loops["FIC1"].pv[::3].tolist() == [50.123] * 20
    assert np.nanmax(content.loops["FIC1"].pv) == 51.871
    assert content.loops["FIC1"].op.tolist() == [40.1] * 60
    assert content.summary.notes == (f"{DOUBT}read as decimals: FIC1.PV, FIC1.OP",)
