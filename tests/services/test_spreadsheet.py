"""CSV that a spreadsheet opens without running anything."""

import csv
import io
import time

import pytest

from app.services.spreadsheet import csv_lines, csv_rows, csv_text, plain_cell, safe_cell


@pytest.mark.parametrize("text", ["=1+1", "+1", "-FIC101", "@SUM(A1)", "\t=1", "\r=1", "\n=1", "\uff1d1"])
def test_a_text_that_begins_like_a_formula_gets_an_apostrophe(text):
    assert safe_cell(text).startswith("'")
    assert safe_cell(text).replace("'", "") == text


@pytest.mark.parametrize("start", ["=1+1", "+1", "-1", "@SUM(A1)", "\uff1d1"])
@pytest.mark.parametrize("separator", [";", "; ", "\t", "\n", "\r\n"])
def test_neither_does_one_that_begins_a_cell_where_semicolons_part_them(separator, start):
    assert safe_cell(f"FIC1{separator}{start}") == f"FIC1{separator}'{start}"


@pytest.mark.parametrize("value", [-1.5, 0, 7, "FIC-101", "a=b", "a; b", "a;\nb"])
def test_numbers_and_plain_texts_stay(value):
    assert safe_cell(value) == value


@pytest.mark.parametrize("blank", ["\n", "\t", "\r\n", "\n "])
def test_thousands_of_blanks_in_a_text_are_looked_at_once(blank):
    text, started_s = "a" + blank * 30_000 + "b;''=c", time.monotonic()
    safe = safe_cell(text)
    assert safe == text.replace("=", "'=")
    assert plain_cell(safe) == text
    assert time.monotonic() - started_s < 10.0  # each looked at anew it is minutes


def test_lines_read_back_whole_with_separators_quotes_and_line_breaks():
    rows = [{"loop": 'a,"b"\nc', "d": -0.5, "unit": None}, {"loop": "=x", "d": 1}]
    text = "".join(csv_lines(rows, ["loop", "d", "unit"]))
    assert list(csv.reader(io.StringIO(text, newline=""))) == [
        ["loop", "d", "unit"],
        ['a,"b"\nc', "-0.5", ""],
        ["'=x", "1", ""],
    ]


@pytest.mark.parametrize("raw", [True, False])
def test_parts_of_a_table_are_its_lines(raw):
    rows = [{"loop": "=x", "d": -0.5, "said": "a; -b"}, {"loop": "y", "d": None, "said": True}, {"d": 1e-05}]
    for columns in (["loop", "d", "said"], ["d"], ["none"]):
        assert csv_text(rows, columns, raw=raw) == "".join(csv_rows(rows, columns, raw=raw))
