"""Numbers with their unit behind them, or with their thousands parted, are numbers; what only looks so is refused."""

import numpy as np
import pytest

from tests.ingest.conftest import Read

STAMPS = [f"2026-01-01 00:00:{k:02d}" for k in range(40)]


def wide(values: list[str], delimiter: str = ",") -> str:
    rows = [
        delimiter.join((stamp, str(k % 7), value)) for k, (stamp, value) in enumerate(zip(STAMPS, values, strict=True))
    ]
    return "\n".join((delimiter.join(("Time", "FIC1.PV", "FIC1.OP")), *rows)) + "\n"


@pytest.mark.parametrize(
    "unit", ["%", " %", "\N{NO-BREAK SPACE}%", " °C", " DegC", " barg", " m³/h", " Nm3/h", " mm H2O", " Vol%", "‰"]
)
@pytest.mark.parametrize(("delimiter", "mark"), [(",", "."), (";", ","), ("\t", ",")])
def test_a_number_is_read_without_its_unit(read: Read, unit: str, delimiter: str, mark: str) -> None:
    content = read(wide([f"{30 + k}.5{unit}".replace(".", mark) for k in range(40)], delimiter))
    assert content.loops["FIC1"].op.tolist() == [30.5 + k for k in range(40)]
    assert content.rejects.total == 0
    (note,) = content.summary.notes
    assert note.endswith(f": {unit.strip()} (FIC1.OP)")


def test_a_unit_may_be_missing_behind_some(read: Read) -> None:
    content = read(wide(["41.5" if k % 3 else "41.5%" for k in range(40)]))
    assert content.loops["FIC1"].op.tolist() == [41.5] * 40


def test_numbers_in_another_unit_than_the_ones_before_are_refused(read: Read) -> None:
    content = read(wide(["980 mbar"] * 30 + ["1.02 bar"] * 10))
    assert np.isfinite(content.loops["FIC1"].op).tolist() == [True] * 30 + [False] * 10
    assert dict(content.rejects.counts) == {"not_a_number": 10}
    assert (content.rejects.listed[0].line, content.rejects.listed[0].text) == (32, "1.02 bar")


@pytest.mark.parametrize(
    "text", ["30 B", "30 S", "30 OPEN", "30 %%", "30 - 40 %", "12:30", "1.234,5 %", "% 30", "30e %", "%"]
)
def test_what_is_behind_a_number_and_no_unit_refuses_it(read: Read, text: str) -> None:
    content = read(wide(["30"] * 39 + [text], ";"))
    assert np.isnan(content.loops["FIC1"].op[39])
    assert dict(content.rejects.counts) == {"not_a_number": 1}


def test_each_tag_of_a_long_table_has_its_own_unit(read: Read) -> None:
    rows = [
        f"{stamp},{tag},{k}{unit}"
        for k, stamp in enumerate(STAMPS)
        for tag, unit in (("TIC1.PV", " °C"), ("TIC1.OP", "%"))
    ]
    rows.append("2026-01-01 00:00:40,TIC1.PV,312 degF")
    content = read("Time,Tag,Value\n" + "\n".join(rows) + "\n")
    loop = content.loops["TIC1"]
    assert loop.pv[:40].tolist() == loop.op[:40].tolist() == list(range(40))
    assert [(reject.text, reject.tag) for reject in content.rejects.listed] == [("312 degF", "TIC1.PV")]
    assert content.summary.notes[-1].endswith(": °C (TIC1.PV); % (TIC1.OP)")


def test_values_with_units_are_no_tags(read: Read) -> None:
    """Without names, a column is one of tags where it holds no numbers."""
    rows = [f"{stamp},FIC1.{s},{k} %" for k, stamp in enumerate(STAMPS) for s in ("PV", "OP")]
    assert read("\n".join(rows) + "\n").loops["FIC1"].samples == 40


@pytest.mark.parametrize(
    ("texts", "delimiter", "expected"),
    [
        (["995.5", '"1,000.5"', '"-1,234,567.25"'], ",", [995.5, 1000.5, -1234567.25]),
        (["995.5", '"1,005"', '"12,345 kg/h"'], ",", [995.5, 1005, 12345]),
        (["995.5", "1,005", "-2,005"], ";", [995.5, 1005, -2005]),
        (["0.5", "1,005", "0,995"], ";", [0.5, 1.005, 0.995]),
        (["0.5", "1,005", "12,5"], ";", [0.5, 1.005, 12.5]),
        (["995,5", "1.000,5", "-1.234.567,25 %"], ";", [995.5, 1000.5, -1234567.25]),
        (["995,5", "1'000,5", "1\N{NO-BREAK SPACE}005,25"], ";", [995.5, 1000.5, 1005.25]),
        (["995", "1’005", "12\N{NARROW NO-BREAK SPACE}345"], ";", [995, 1005, 12345]),
    ],
)
def test_thousands_may_be_parted(read: Read, texts: list[str], delimiter: str, expected: list[float]) -> None:
    content = read(wide([texts[0]] * (40 - len(texts)) + texts, delimiter))
    assert content.loops["FIC1"].op[40 - len(texts) :].tolist() == expected
    assert content.rejects.total == 0


@pytest.mark.parametrize("text", ["1,00,5.5", "1,0000.5", "1,000,5", "12'34", "1'000,000.5", "1.234,567.8"])
def test_digits_that_are_parted_otherwise_are_no_number(read: Read, text: str) -> None:
    content = read(wide(["30.5"] * 39 + [text], ";"))
    assert np.isnan(content.loops["FIC1"].op[39])
    assert dict(content.rejects.counts) == {"not_a_number": 1}
