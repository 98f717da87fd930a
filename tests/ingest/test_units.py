"""Numbers with their unit behind them, or with their thousands parted, are numbers; what only looks so is refused."""

import numpy as np
import pytest

from app.ingest import IngestOptions
from tests.ingest.conftest import Read
from tests.ingest.test_chunks import same_content

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


@pytest.mark.parametrize("values", [["980 mbar"] * 30 + ["1.02 bar"] * 10, ["1.02 bar"] * 10 + ["980 mbar"] * 30])
def test_numbers_in_another_unit_than_most_are_refused(read: Read, values: list[str]) -> None:
    content = read(wide(values))
    assert np.isfinite(content.loops["FIC1"].op).tolist() == [value == "980 mbar" for value in values]
    assert dict(content.rejects.counts) == {"not_a_number": 10}
    assert (content.rejects.listed[0].line, content.rejects.listed[0].text) == (
        values.index("1.02 bar") + 2,
        "1.02 bar",
    )
    assert content.summary.notes == (
        "numbers have their unit behind them, and were read where it is the one of their tag: mbar (FIC1.OP)",
        "numbers are in another unit than most of their tag, and were refused: bar (FIC1.OP)",
    )


def test_a_tag_has_the_unit_of_most_of_its_numbers(read: Read) -> None:
    stamps = np.datetime_as_string(np.datetime64("2026-01-01T00:00:00") + np.arange(1200))
    rows = [f"{s},{k % 7},{'1.02 bar' if k < 500 else '980 mbar'}" for k, s in enumerate(stamps)]
    content = read("Time,FIC1.PV,FIC1.OP\n" + "\n".join(rows) + "\n", options=IngestOptions(chunk_bytes=10_000))
    assert np.isfinite(content.loops["FIC1"].op).tolist() == [k >= 500 for k in range(1200)]


@pytest.mark.parametrize(
    "text", ["30 B", "30 S", "30 OPEN", "30 %%", "30 - 40 %", "12:30", "1.23,5 %", "% 30", "30e %", "%"]
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
    assert [note.rpartition(": ")[2] for note in content.summary.notes] == [
        "°C (TIC1.PV); % (TIC1.OP)",
        "degF (TIC1.PV)",
    ]


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


DOUBT = "the mark of numbers such as 1,000 may part thousands or decimals: "


@pytest.mark.parametrize("mark", [",", "."])
@pytest.mark.parametrize("unit", ["", " kg/h"])
def test_what_has_no_mark_tells_thousands(read: Read, mark: str, unit: str) -> None:
    texts = [f"{n}{unit}" if n < 1000 else f"1{mark}{n - 1000:03d}{unit}" for n in range(980, 1020)]
    content = read(wide(texts, ";"))
    assert content.loops["FIC1"].op.tolist() == list(range(980, 1020))
    assert f"{DOUBT}read as thousands: FIC1.OP" in content.summary.notes


def test_thousands_are_told_behind_the_start_of_the_file(read: Read) -> None:
    stamps = np.datetime_as_string(np.datetime64("2026-01-01T00:00:00") + np.arange(1200))
    rows = [f"{s};{k % 7};" + (f"{k}" if k < 1000 else f"1.{k - 1000:03d}") for k, s in enumerate(stamps)]
    content = read("Time;FIC1.PV;FIC1.OP\n" + "\n".join(rows) + "\n")
    assert content.loops["FIC1"].op.tolist() == list(range(1200))


def test_what_has_no_mark_tells_decimals(read: Read) -> None:
    content = read(wide(["50", "51"] * 19 + ["50,125", "50,875"], ";"))
    assert content.loops["FIC1"].op[38:].tolist() == [50.125, 50.875]
    assert content.summary.notes == (f"{DOUBT}read as decimals: FIC1.OP",)


def test_marks_that_nothing_tells_are_refused(read: Read) -> None:
    content = read(wide(["500", "450"] * 19 + ["25,125", "12,500"], ";"))
    assert np.isnan(content.loops["FIC1"].op).tolist() == [False] * 38 + [True] * 2
    assert dict(content.rejects.counts) == {"unclear_mark": 2}
    assert content.rejects.listed[0].text == "25,125 may have decimals or parted thousands"
    assert content.summary.notes == (f"{DOUBT}refused: FIC1.OP",)


@pytest.mark.parametrize(("delimiter", "expected", "how"), [(";", 50.123, "decimals"), (",", 50123, "thousands")])
def test_marks_in_all_numbers_are_told(read: Read, delimiter: str, expected: float, how: str) -> None:
    content = read(wide(['"50,123"'] * 40, delimiter))
    assert content.loops["FIC1"].op.tolist() == [expected] * 40
    assert content.summary.notes == (f"{DOUBT}read as {how}: FIC1.OP",)


@pytest.mark.parametrize("text", ["0,123", "-0,512", "12,5", "12,3456", "1234,567", "1.234,567", "1.234.567"])
def test_one_number_tells_decimals(read: Read, text: str) -> None:
    content = read(wide(["50,123"] * 39 + [text], ";"))
    assert content.loops["FIC1"].op[:39].tolist() == [50.123] * 39
    assert content.loops["FIC1"].op[39] == float(text.replace(".", "").replace(",", "."))
    assert content.summary.notes == ()


@pytest.mark.parametrize("text", ["0.123", "12.5", "1234.567"])
def test_one_number_near_to_the_others_as_decimals_leaves_them_in_doubt(read: Read, text: str) -> None:
    """A mark that changes over within a tag looks so too."""
    content = read(wide(["50,123"] * 39 + [text], ";"))
    assert np.isnan(content.loops["FIC1"].op[:39]).all()
    assert content.loops["FIC1"].op[39] == float(text)
    assert dict(content.rejects.counts) == {"unclear_mark": 39}


@pytest.mark.parametrize("text", ["9876.5", "1,234.567", "1,234,567"])
def test_one_number_tells_thousands(read: Read, text: str) -> None:
    content = read(wide(["50,123"] * 39 + [text], ";"))
    assert content.loops["FIC1"].op.tolist() == [50123.0] * 39 + [float(text.replace(",", ""))]
    assert content.summary.notes == ()


@pytest.mark.parametrize("quote", ["", '"'])
def test_a_point_beside_decimal_commas_parts_thousands(read: Read, quote: str) -> None:
    content = read(wide(["999,5", f"{quote}1.000{quote}", f"{quote}-1.001{quote}", "999"] * 10, ";"))
    assert content.loops["FIC1"].op.tolist() == [999.5, 1000, -1001, 999] * 10


def test_points_before_decimals_stay_so_in_their_column(read: Read) -> None:
    rows = [f"{stamp};{k},5;{('1.005', '1.5')[k % 2]}" for k, stamp in enumerate(STAMPS)]
    content = read("Time;FIC1.PV;FIC1.OP\n" + "\n".join(rows) + "\n")
    assert content.loops["FIC1"].op.tolist() == [1.005, 1.5] * 20


def test_each_tag_of_a_long_table_tells_its_marks(read: Read) -> None:
    values = {"FIC1.PV": ("999", "1,001"), "FIC1.OP": ("50", "50,125"), "FIC1.SP": ("450", "12,500")}
    rows = [f"{stamp};{tag};{texts[k % 2]}" for k, stamp in enumerate(STAMPS) for tag, texts in values.items()]
    content = read("Time;Tag;Value\n" + "\n".join(rows) + "\n")
    loop = content.loops["FIC1"]
    assert loop.pv.tolist() == [999, 1001] * 20
    assert loop.op.tolist() == [50, 50.125] * 20
    assert dict(content.rejects.counts) == {"unclear_mark": 20}
    (note,) = content.summary.notes
    assert note == f"{DOUBT}read as thousands: FIC1.PV; read as decimals: FIC1.OP; refused: FIC1.SP"


def test_points_part_thousands_in_a_table_of_many_columns(read: Read) -> None:
    names = [f"FIC{n}.{s}" for n in range(120) for s in ("PV", "OP")]
    rows = [";".join((stamp, *(("999,5", "1.000")[k % 2] for _ in names))) for k, stamp in enumerate(STAMPS)]
    content = read("\n".join((";".join(("Time", *names)), *rows)) + "\n")
    assert content.loops["FIC77"].op.tolist() == [999.5, 1000] * 20


def test_a_tag_is_not_read_both_ways(read: Read) -> None:
    """Its first chunk has a mark in every number, a later one does not: all rows tell."""
    stamps = np.datetime_as_string(np.datetime64("2026-01-01T00:00:00") + np.arange(1200))
    texts = [f"1,{k % 90:03d}" if k < 600 or k % 2 else f"{900 + k % 90}" for k in range(1200)]
    rows = [f"{stamp};{k % 7};{text}" for k, (stamp, text) in enumerate(zip(stamps, texts, strict=True))]
    table = "Time;FIC1.PV;FIC1.OP\n" + "\n".join(rows) + "\n"
    content = read(table, options=IngestOptions(chunk_bytes=10_000))
    op = content.loops["FIC1"].op
    assert op.min() >= 900
    assert op.max() < 1100
    assert content.summary.notes == (f"{DOUBT}read as thousands: FIC1.OP",)


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_few_points_that_tell_outweigh_many_commas_that_do_not(read: Read, delimiter: str) -> None:
    rows = [delimiter.join((stamp, f'"1,0{k + 10}"', f'"2,0{k + 10}"', f"{k}.5")) for k, stamp in enumerate(STAMPS)]
    names = delimiter.join(("Time", "FIC1.PV", "FIC1.SP", "FIC1.OP"))
    loop = read("\n".join((names, *rows)) + "\n").loops["FIC1"]
    assert loop.pv.tolist() == [1010 + k for k in range(40)]
    assert loop.op.tolist() == [k + 0.5 for k in range(40)]


@pytest.mark.parametrize("beside", ["1", "100", "999"])
def test_points_are_decimals_where_commas_part_the_fields(read: Read, beside: str) -> None:
    content = read(wide([beside, "1.125"] * 20))
    assert content.loops["FIC1"].op.tolist() == [float(beside), 1.125] * 20
    assert content.summary.notes == ()


def test_points_behind_the_start_of_the_file_are_decimals_where_commas_part_the_fields(read: Read) -> None:
    stamps = np.datetime_as_string(np.datetime64("2026-01-01T00:00:00") + np.arange(600))
    texts = ["500"] * 450 + ["10.125"] * 150
    rows = [f"{stamp},{k % 7},{text}" for k, (stamp, text) in enumerate(zip(stamps, texts, strict=True))]
    content = read("Time,FIC1.PV,FIC1.OP\n" + "\n".join(rows) + "\n")
    assert content.loops["FIC1"].op.tolist() == [float(text) for text in texts]
    assert content.summary.notes == ()


def test_many_quoted_commas_do_not_outweigh_few_points_where_commas_part_the_fields(read: Read) -> None:
    rows = [f'{stamp},"5,{k + 100}","5,{k + 200}",50.125' for k, stamp in enumerate(STAMPS)]
    loop = read("Time,FIC1.PV,FIC1.SP,FIC1.OP\n" + "\n".join(rows) + "\n").loops["FIC1"]
    assert loop.pv.tolist() == [5100 + k for k in range(40)]
    assert loop.op.tolist() == [50.125] * 40


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_an_exponent_tells_decimals(read: Read, delimiter: str) -> None:
    content = read(wide(['"5,125E+01"', '"-1,250E-02"'] * 20, delimiter))
    assert content.loops["FIC1"].op.tolist() == [51.25, -0.0125] * 20
    assert content.summary.notes == ()


@pytest.mark.parametrize("preamble", ["Version;4.2\nCycle;0.5\n\n", "Version;4.2;\nCycle;0.5;\n;;\n"])
def test_numbers_of_a_preamble_do_not_tell_thousands(read: Read, preamble: str) -> None:
    rows = [f"{stamp};50,{k + 100};40,{k + 200}" for k, stamp in enumerate(STAMPS)]
    loop = read(preamble + "Time;FIC1.PV;FIC1.OP\n" + "\n".join(rows) + "\n").loops["FIC1"]
    assert loop.pv.tolist() == [float(f"50.{k + 100}") for k in range(40)]


def test_nothing_is_parted_beside_thousands_without_a_mark(read: Read) -> None:
    content = read(wide(["1500", "50,125"] * 20, ";"))
    assert content.loops["FIC1"].op.tolist() == [1500, 50.125] * 20
    content = read(wide(["5000", "1,125"] * 20, ";"))
    assert dict(content.rejects.counts) == {"unclear_mark": 20}


@pytest.mark.parametrize("layout", ["wide", "long"])
def test_a_word_for_no_data_does_not_tell_thousands(read: Read, layout: str) -> None:
    texts = ["-9999"] + ["50,125"] * 39
    rows = [f"{stamp};FIC1.OP;{text}" for stamp, text in zip(STAMPS, texts, strict=True)]
    content = read(wide(texts, ";") if layout == "wide" else "Time;Tag;Value\n" + "\n".join(rows) + "\n")
    op = content.loops["FIC1"].op
    assert op[np.isfinite(op)].tolist() == [50.125] * 39
    assert dict(content.rejects.counts) == {"sentinel": 1}


@pytest.mark.parametrize(("delimiter", "late"), [(";", "1,012.5"), (",", "0,5")])
def test_what_tells_late_has_its_tag_read_so_from_the_start(read: Read, delimiter: str, late: str) -> None:
    stamps = np.datetime_as_string(np.datetime64("2026-01-01T00:00:00") + np.arange(1200))
    texts = [f"5,{k % 90 + 100}" for k in range(1200)]
    texts[900] = late
    rows = [delimiter.join((s, str(k % 7), f'"{text}"')) for k, (s, text) in enumerate(zip(stamps, texts, strict=True))]
    names = delimiter.join(("Time", "FIC1.PV", "FIC1.OP"))
    content = same_content(read, "\n".join((names, *rows)) + "\n", (10_000,))
    op = np.delete(content.loops["FIC1"].op, 900)
    assert op.tolist() == [float(text.replace(",", "" if "." in late else ".")) for text in np.delete(texts, 900)]
    assert content.rejects.total == 0


@pytest.mark.parametrize("short", ["K", "Mil", "k"])
@pytest.mark.parametrize("layout", ["wide", "long"])
def test_shortened_thousands_are_refused_and_told(read: Read, short: str, layout: str) -> None:
    texts = [f"2.{k} {short}" if k % 2 else "999" for k in range(40)]
    rows = [f"{stamp};FIC1.OP;{text}" for stamp, text in zip(STAMPS, texts, strict=True)]
    content = read(wide(texts, ";") if layout == "wide" else "Time;Tag;Value\n" + "\n".join(rows) + "\n")
    assert dict(content.rejects.counts) == {"not_a_number": 20}
    (note,) = (note for note in content.summary.notes if "rounded thousands" in note)
    assert note.endswith(f"send them unformatted: {short} (FIC1.OP)")
