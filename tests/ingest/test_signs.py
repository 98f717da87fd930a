"""Minus signs behind numbers are read, numbers in brackets are refused, and both are told."""

from datetime import datetime, timedelta

import pytest

from app.ingest import IngestOptions

from .conftest import Read
from .test_tables import workbook

VALUES = [round(((37 * k) % 23 - 11) * 0.37, 2) for k in range(120)]
STAMPS = [str(datetime(2026, 3, 1) + timedelta(minutes=k)) for k in range(120)]
READ = "numbers have their minus behind them, and were read as negative"
REFUSED = "numbers in brackets may be negative or doubted, and were refused; needed is a minus before them"


def behind(value: float) -> str:
    return f"{abs(value):.2f}-" if value < 0 else f"{value:.2f}"


def wide(values: list[str]) -> str:
    return "Time,A.PV,A.OP\n" + "".join(f"{stamp},{value},50.5\n" for stamp, value in zip(STAMPS, values, strict=True))


def long(values: list[str]) -> str:
    rows = (f"{stamp},A.PV,{value}\n{stamp},A.OP,50.5\n" for stamp, value in zip(STAMPS, values, strict=True))
    return "Time,Tag,Value\n" + "".join(rows)


@pytest.mark.parametrize("options", [IngestOptions(), IngestOptions(chunk_bytes=600)])
@pytest.mark.parametrize("table", [wide, long])
def test_a_minus_behind(read: Read, table: object, options: IngestOptions) -> None:
    text = (wide if table is wide else long)([behind(value) for value in VALUES])
    content = read(text, options=options)
    assert content.loops["A"].pv.tolist() == VALUES
    assert [note for note in content.summary.notes if note.startswith(READ)] == [f"{READ}: 4.07- (A.PV)"]
    assert content.rejects.total == 0


def test_a_minus_behind_all_numbers(read: Read) -> None:
    content = read(wide([f"{abs(value):.2f}-" for value in VALUES]))
    assert content.loops["A"].pv.tolist() == [-abs(value) for value in VALUES]


def test_behind_decimal_commas(read: Read) -> None:
    text = wide([behind(value) for value in VALUES]).replace(",", ";").replace(".", ",").replace("A,", "A.")
    assert read(text).loops["A"].pv.tolist() == VALUES


def test_in_cells_of_text(read: Read) -> None:
    rows = [[stamp, behind(value), 50.5] for stamp, value in zip(STAMPS, VALUES, strict=True)]
    content = read(workbook([["Time", "A.PV", "A.OP"], *rows]), name="export.xlsx")
    assert content.loops["A"].pv.tolist() == VALUES


@pytest.mark.parametrize("table", [wide, long])
def test_brackets_are_refused_and_told(read: Read, table: object) -> None:
    values = [f"({abs(value):.2f})" if value < 0 else f"{value:.2f}" for value in VALUES]
    content = read((wide if table is wide else long)(values))
    assert dict(content.rejects.counts) == {"not_a_number": sum(value < 0 for value in VALUES)}
    assert [note for note in content.summary.notes if note.startswith(REFUSED)] == [f"{REFUSED}: (4.07) (A.PV)"]


@pytest.mark.parametrize(
    ("per_cent", "bare", "told"),
    [("{:.1f}%", "{:.3f}", True), ("{:.1f} %", "{:.3f}", True), ("{:.1f}%", "{:.1f}", False)],
)
def test_shares_beside_per_cent_are_told(read: Read, per_cent: str, bare: str, told: bool) -> None:
    scale = 0.01 if told else 1.0
    each = ((41 + value, k) for k, value in enumerate(VALUES))
    values = [per_cent.format(value) if k % 3 else bare.format(scale * value) for value, k in each]
    notes = [note for note in read(wide(values)).summary.notes if "shares such as 0.41" in note]
    assert [note.rpartition(": ")[2] for note in notes] == ["A.PV"] * told


def test_a_valve_that_is_nearly_closed_has_no_shares(read: Read) -> None:
    values = [f"{abs(value) / 2:.1f}" + "%" * (k % 2) for k, value in enumerate(VALUES)]
    assert not any("shares such as" in note for note in read(wide(values)).summary.notes)


@pytest.mark.parametrize(
    "form", ["{:.2f} -", "1.2.{:.0f}-", "{:.0f}-7", "555-{:.0f}", "{:.0f}-03-01", "-{:.2f}-", "A{:.0f}-"]
)
@pytest.mark.parametrize("table", [wide, long])
def test_what_else_has_a_dash_is_refused_and_not_told_as_read(read: Read, table: object, form: str) -> None:
    """Behind a blank, "-" is the unit of shares; others are ranges, dates and numbers of parts."""
    values = [form.format(abs(value) + 1) if k % 3 == 0 else f"{value:.2f}" for k, value in enumerate(VALUES)]
    content = read((wide if table is wide else long)(values))
    assert dict(content.rejects.counts) == {"not_a_number": 40}
    assert not any(note.startswith(READ) for note in content.summary.notes)
