"""Plain blanks between thousands are told from those between two numbers."""

import io
from collections.abc import Sequence

import numpy as np
import pytest

from app.errors import DataError
from app.ingest import IngestOptions, parse_named
from tests.ingest.conftest import Read
from tests.ingest.test_tables import workbook
from tests.ingest.test_writing import CHUNKS, LAYOUTS, Table, wide


def read_numbers(read: Read, pv: Sequence[str], op: Sequence[str] = ("40.1",), delimiter: str = ";") -> list[float]:
    """PV as far as it was read."""
    found = read(wide(pv, op, delimiter)).loops["FIC1"].pv
    return [] if found is None else found[: len(pv)].tolist()


@pytest.mark.parametrize("delimiter", [";", "\t"])
@pytest.mark.parametrize(
    ("texts", "expected"),
    [
        (["998,5", "1 002,25", "-12 345,5", "1 234 567"], [998.5, 1002.25, -12345.5, 1234567]),
        (["1 002,125", "1 234 567,125"], [1002.125, 1234567.125]),
        (["1 002,5 m3/h", "998 m3/h", "12 345 m3/h"], [1002.5, 998, 12345]),
        (["998", "1 002", "1 012"], [998, 1002, 1012]),
    ],
)
def test_plain_blanks_may_part_thousands(
    read: Read, texts: Sequence[str], expected: Sequence[float], delimiter: str
) -> None:
    assert read_numbers(read, texts, delimiter=delimiter) == expected


def test_plain_blanks_may_part_thousands_where_commas_part_the_fields(read: Read) -> None:
    assert read_numbers(read, ["998.5", "1 002.5", '"12 345,5"'], delimiter=",") == [998.5, 1002.5, 12345.5]


@LAYOUTS
def test_what_one_tag_shows_holds_for_the_file(read: Read, table: Table) -> None:
    loop = read(table(["12 345", "13 222"], ["1 040,5", "40,125"])).loops["FIC1"]
    assert loop.pv.tolist() == [12345, 13222] * 30
    assert loop.op.tolist() == [1040.5, 40.125] * 30


def test_thousands_parted_by_blanks_show_what_stands_before_decimals(read: Read) -> None:
    content = read(wide(["50,123", "51,250"], ["1 040,5"]))
    assert content.loops["FIC1"].pv.tolist() == [50.123, 51.25] * 30
    assert "read as thousands" not in " ".join(content.summary.notes)


@pytest.mark.parametrize(
    "texts",
    [
        ["12 345", "13 222"],
        ["45 192", "46 192", "47"],
        ["45 192", "46 192", "9998"],
        ["1 234,5", "2 7,5", "3 12,25"],
        ["1 234 5", "1 2345", "12 34", "1  234"],
    ],
)
@LAYOUTS
def test_two_numbers_in_a_field_are_none(read: Read, table: Table, texts: Sequence[str]) -> None:
    content = read(table(texts, ["40.1"]))
    found = content.loops["FIC1"].pv
    read_as_such = [] if found is None else found[np.isfinite(found)].tolist()
    assert set(read_as_such) == {float(text) for text in texts if " " not in text}
    assert content.rejects.counts["not_a_number"] == 60 - len(read_as_such)


def test_fields_that_blanks_part_stay_apart(read: Read) -> None:
    """In a file without any other delimiter, and behind one that parts the times alone."""
    with pytest.raises(DataError) as raised:
        read("time PV OP\n" + "".join(f"{k} 12 345\n" for k in range(1, 60)))
    assert raised.value.code == "unknown_layout"
    rows = (f"2026-01-01 00:00:{k:02d};{k % 9 + 1} 345,5 4{k % 10},25\n" for k in range(60))
    assert dict(read("Time;FIC1.PV\n" + "".join(rows)).rejects.counts) == {"not_a_number": 60}


def test_a_field_with_two_numbers_ends_the_reading_of_its_tag(read: Read) -> None:
    pv = ["1 234,5"] * 800 + ["2 7,5", "1 234,5"] * 100
    text = wide(pv, ["40.1"], count=1000)
    parted, whole = read(text, options=CHUNKS), read(text)
    assert parted.loops["FIC1"].pv is None
    assert whole.loops["FIC1"].pv is None
    assert parted.rejects.counts == whole.rejects.counts == {"not_a_number": 1000}


def test_cells_of_text_and_named_columns_are_read_so_too(read: Read) -> None:
    rows = [[f"2026-01-01 00:00:{k:02d}", ("998,5", "1 002,5")[k % 2], "40,5"] for k in range(60)]
    content = read(workbook([["Time", "FIC1.PV", "FIC1.OP"], *rows]))
    assert content.loops["FIC1"].pv.tolist() == [998.5, 1002.5] * 30
    text = io.StringIO("t;y1\n" + "\n".join(f"{k};{('998,5', '1 002,5')[k % 2]}" for k in range(60))).getvalue()
    assert parse_named(text, IngestOptions()).numbers("y1").tolist() == [998.5, 1002.5] * 30
