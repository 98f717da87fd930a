"""Files in which numbers are written in two ways: each tag is read as it shows itself, and what only others tell of it
is said."""

import io
from collections.abc import Callable, Sequence

import numpy as np
import polars as pl
import pytest

from app.ingest import IngestOptions
from tests.ingest.conftest import Read, in_pairs
from tests.ingest.test_chunks import same_content
from tests.ingest.test_tables import workbook

DOUBT = "the mark of numbers such as 1,000 may part thousands or decimals: "
TWO_WAYS = "decimals are written in two ways, and were read as each tag writes them: "
NAMES = "tagname\tFIC7.MV\tFIC7.PV\tbOpOFL\tbPvOFL"
Table = Callable[..., str]
SIZES = (10_000,)
CHUNKS = IngestOptions(chunk_bytes=SIZES[0])


def wide(pv: Sequence[str], op: Sequence[str], delimiter: str = ";", count: int = 60) -> str:
    stamps = _stamps(count)
    rows = (delimiter.join((s, pv[k % len(pv)], op[k % len(op)])) for k, s in enumerate(stamps))
    return "\n".join((delimiter.join(("Time", "FIC1.PV", "FIC1.OP")), *rows)) + "\n"


def long(pv: Sequence[str], op: Sequence[str], count: int = 60) -> str:
    stamps = _stamps(count)
    rows = (
        f"{s};{tag};{texts[k % len(texts)]}"
        for k, s in enumerate(stamps)
        for tag, texts in (("FIC1.PV", pv), ("FIC1.OP", op))
    )
    return "\n".join(("Time;Tag;Value", *rows)) + "\n"


TABLES, MARKS = [wide, long], [",.", ".,"]
LAYOUTS = pytest.mark.parametrize("table", TABLES)
MIRRORED = pytest.mark.parametrize("marks", MARKS)


def marked(texts: Sequence[str], marks: str) -> list[str]:
    """As written with decimal points, or with decimal commas."""
    return [text.translate(str.maketrans(",.", marks)) for text in texts]


def workbook_of(pv: Sequence[str | float]) -> bytes:
    """Beside OP whose cells are numbers."""
    rows = ([str(s), pv[k % 2], (40.125, 40.5)[k % 2]] for k, s in enumerate(_stamps()))
    return workbook([["Time", "FIC1.PV", "FIC1.OP"], *rows])


def parquet_of(pv: Sequence[str]) -> bytes:
    target = io.BytesIO()
    pl.DataFrame({"Time": _stamps(), "FIC1.PV": list(pv) * 30, "FIC1.OP": [40.125, 40.5] * 30}).write_parquet(target)
    return target.getvalue()


def _stamps(count: int = 60) -> list[str]:
    return np.datetime_as_string(np.datetime64("2026-01-01T00:00:00") + np.arange(count)).tolist()


@LAYOUTS
@MIRRORED
def test_what_only_other_tags_tell_is_said(read: Read, table: Table, marks: str) -> None:
    content = read(table(marked(["50,123", "50,871"], marks), marked(["40.1", "40.3", "40.5"], marks)))
    assert content.loops["FIC1"].pv.tolist() == [50123, 50871] * 30
    assert content.loops["FIC1"].op[:3].tolist() == [40.1, 40.3, 40.5]
    assert content.summary.notes == (f"{DOUBT}read as thousands: FIC1.PV",)


def test_what_only_other_tags_tell_is_said_where_commas_part_the_fields(read: Read) -> None:
    content = read(wide(['"50,123"', '"50,871"'], ["40.1"], ","))
    assert content.loops["FIC1"].pv.tolist() == [50123, 50871] * 30
    assert content.summary.notes == (f"{DOUBT}read as thousands: FIC1.PV",)


@MIRRORED
@pytest.mark.parametrize("sure", ["995.5", "1,000.5", "1,234,567"])
def test_what_the_tag_tells_too_needs_no_word(read: Read, marks: str, sure: str) -> None:
    content = read(wide(marked([sure, "1,005"], marks), marked(["40.1"], marks)))
    assert content.loops["FIC1"].pv[1::2].tolist() == [1005] * 30
    assert content.summary.notes == ()


@LAYOUTS
@MIRRORED
def test_a_tag_is_read_as_it_shows_itself(read: Read, table: Table, marks: str) -> None:
    pv = ["50,12", "50,123", "1.005", "1.005,5", "1.234.567"]
    content = read(table(marked(pv, marks), marked(["40.1", "40.3", "40.2"], marks)))
    assert content.loops["FIC1"].pv.tolist() == [50.12, 50.123, 1005, 1005.5, 1234567] * 12
    assert content.loops["FIC1"].op[:3].tolist() == [40.1, 40.3, 40.2]
    styles = [
        "decimal commas: FIC1.PV; in the others decimal points",
        "decimal points: FIC1.PV; in the others decimal ",
    ]
    assert content.summary.notes[0].startswith(TWO_WAYS + styles[marks == ".,"])
    assert content.rejects.total == 0


def test_words_do_not_show_how_a_tag_is_written(read: Read) -> None:
    content = read(wide(["50,123"] * 59 + ["12,5 or so"], ["40.1"]))
    assert content.loops["FIC1"].pv[:59].tolist() == [50123] * 59
    assert content.summary.notes == (f"{DOUBT}read as thousands: FIC1.PV",)


def test_a_tag_may_be_written_both_ways(read: Read) -> None:
    content = read(wide(["50.12", "50,12", "50,123"], ["40.1"]))
    assert content.loops["FIC1"].pv.tolist() == [50.12, 50.12, 50.123] * 20
    assert content.summary.notes == (f"{TWO_WAYS}both: FIC1.PV; in the others decimal points",)


@MIRRORED
def test_what_numbers_without_a_mark_tell_otherwise_than_the_file_is_refused(read: Read, marks: str) -> None:
    content = read(wide(marked(["50", "50,123"], marks), marked(["40.1"], marks)))
    assert content.loops["FIC1"].pv[::2].tolist() == [50] * 30
    assert dict(content.rejects.counts) == {"unclear_mark": 30}
    assert content.summary.notes == (f"{DOUBT}refused: FIC1.PV",)


@LAYOUTS
def test_a_tag_that_shows_itself_late_is_read_so_from_the_start(read: Read, table: Table) -> None:
    pv = ["50,123"] * 500 + ["50,12", "50,123"] * 100
    content = same_content(read, table(pv, ["40.1"], count=700), SIZES)
    assert content.loops["FIC1"].pv.tolist() == [50.123] * 500 + [50.12, 50.123] * 100
    assert content.rejects.total == 0
    assert content.summary.notes[0].startswith(f"{TWO_WAYS}decimal commas: FIC1.PV")


@LAYOUTS
def test_plain_numbers_of_a_tag_that_shows_itself_late_are_read_so_too(read: Read, table: Table) -> None:
    pv = ["1.005"] * 500 + ["50,12", "1.005", "50,123"] * 80
    content = same_content(read, table(pv, ["40.1"], count=740), SIZES)
    assert content.loops["FIC1"].pv.tolist() == [1005] * 500 + [50.12, 1005, 50.123] * 80
    assert content.rejects.total == 0


@LAYOUTS
def test_a_tag_is_in_doubt_though_another_tells_behind_it(read: Read, table: Table) -> None:
    pv, op = ["1,005"] * 500 + ["1005.5"] * 200, ["40"] * 500 + ["50,123"] * 200
    content = same_content(read, table(pv, op, count=700), SIZES)
    loop = content.loops["FIC1"]
    assert loop.pv.tolist() == [1005] * 500 + [1005.5] * 200
    assert loop.op[:500].tolist() == [40] * 500
    assert np.isnan(loop.op[500:]).all()
    assert content.summary.notes == (f"{DOUBT}refused: FIC1.OP",)


@LAYOUTS
def test_a_tag_stays_as_it_showed_itself(read: Read, table: Table, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.ingest.tables.frames.LEAST_BYTES", 0)
    pv = ["50,12"] * 10 + ["1.005"] * 690
    content = read(table(pv, ["40.1"], count=700), options=CHUNKS)
    assert content.loops["FIC1"].pv[10:].tolist() == [1005] * 690


def test_tags_that_show_two_ways_behind_the_start_of_the_file_are_read_in_their_own(read: Read) -> None:
    pv, op = ["50,123"] * 500 + ["50,12"] * 100, ["40,123"] * 500 + ["40,123.5"] * 100
    loop = read(wide(pv, op, count=600)).loops["FIC1"]
    assert loop.pv.tolist() == [50.123] * 500 + [50.12] * 100
    assert loop.op.tolist() == [40123] * 500 + [40123.5] * 100


@in_pairs(table=TABLES, marks=MARKS, sure=["0,123", "40,12"], options=[IngestOptions(), CHUNKS])
def test_marks_that_change_over_are_not_read_as_thousands(
    read: Read, table: Table, marks: str, sure: str, options: IngestOptions
) -> None:
    """As in a file whose second half was written with other settings: the same numbers, with the other mark."""
    first, second = [sure, "5,123", "37,165", "99,871"], ["5.123", "37.165", "99.871"]
    pv = marked(first * 150 + second * 150, marks)
    content = read(table(pv, marked(["7"], marks), count=len(pv)), options=options)
    found = content.loops["FIC1"].pv
    assert found[:600].tolist() == [float(text.replace(",", ".")) for text in first] * 150
    assert np.isnan(found[600:]).all()
    assert dict(content.rejects.counts) == {"unclear_mark": 450}
    assert content.summary.notes[0] == f"{DOUBT}refused: FIC1.PV"


@LAYOUTS
@MIRRORED
def test_thousands_that_a_tag_shows_do_not_change_over(read: Read, table: Table, marks: str) -> None:
    pv = marked(["0,5", "1.005,5", "5.123", "37.165"], marks)
    content = read(table(pv, marked(["40,1"], marks)))
    assert content.loops["FIC1"].pv.tolist() == [0.5, 1005.5, 5123, 37165] * 15
    assert content.rejects.total == 0


def test_flags_of_signals_that_are_off_line_may_have_a_point(read: Read) -> None:
    """Beside decimal commas, numbers with a point are read as text."""
    head = ["PROCESSDATA\tFIC7 Data\tyyyy-MM-dd HH:mm:ss", "8\t10\t2026-01-01 00:00:00\t40", NAMES, "desc\t\t\t\t", ""]
    rows = [f"2026-01-01 00:00:{k:02d}\t41,5\t{k},5\t0.0\t{k == 3:d}.0" for k in range(40)]
    content = read("\n".join([*head, *rows]) + "\n")
    assert np.flatnonzero(np.isnan(content.loops["FIC7"].pv)).tolist() == [3]
    assert dict(content.rejects.counts) == {"off_line": 1}


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_points_in_all_numbers_are_told(read: Read, delimiter: str) -> None:
    content = read(wide(["50.123", "51.871"], ["40.100", "42.250"], delimiter))
    assert content.loops["FIC1"].pv.tolist() == [50.123, 51.871] * 30
    assert content.summary.notes == (f"{DOUBT}read as decimals: FIC1.PV, FIC1.OP",)


@in_pairs(table=TABLES, marks=MARKS, code=["-999", "999", "9999", "32767", "-32768", "100"])
def test_codes_for_no_data_do_not_tell_how_numbers_are_written(read: Read, table: Table, marks: str, code: str) -> None:
    content = read(table(marked(["5,123", "5,871", "4,250"] * 9 + [code], marks), marked(["40,100"], marks), count=56))
    assert content.loops["FIC1"].pv[:3].tolist() == [5.123, 5.871, 4.25]
    assert content.loops["FIC1"].op.tolist() == [40.1] * 56
    assert content.rejects.counts.keys() <= {"sentinel"}


@pytest.mark.parametrize("whole", [["999"], ["980", "985", "990", "995"]])
def test_few_numbers_near_thousands_tell_how_numbers_are_written(read: Read, whole: Sequence[str]) -> None:
    content = read(wide(["1.001", "1.012", "1.123"] * 40 + [*whole], ["40.100"], count=400))
    assert content.loops["FIC1"].pv[:3].tolist() == [1001, 1012, 1123]


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_points_in_all_numbers_are_read_once(read: Read, delimiter: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Such files are common: only what is no number is read again as text."""
    again: list[str] = []

    def refused(texts: pl.Series, *_: object) -> np.ndarray:
        again.extend(texts)
        return np.full(len(texts), np.nan)

    monkeypatch.setattr("app.ingest.tables.odd_fields.refuse_texts", refused)
    content = read(wide(["50.123", "Bad", "51.871"], ["40.100"], delimiter))
    assert content.loops["FIC1"].pv[::3].tolist() == [50.123] * 20
    assert content.loops["FIC1"].op.tolist() == [40.1] * 60
    assert again == ["Bad"] * 20


@MIRRORED
def test_doubtful_numbers_alone_have_nothing_to_learn_from(
    read: Read, marks: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "app.ingest.numbers.writing.Writing.learn", lambda *_: pytest.fail("looked for what is not there")
    )
    content = read(wide(marked(["50,123", "Bad", "51,871"], marks), marked(["40,100"], marks)))
    assert content.loops["FIC1"].pv[::3].tolist() == [50.123] * 20
    assert content.summary.notes[0].startswith(f"{DOUBT}read as decimals: FIC1.")


@LAYOUTS
@pytest.mark.parametrize(("late", "expected"), [("999", {999, 1005}), ("50,12", {50.12, 1005}), ("Bad", {1.005})])
def test_points_in_all_numbers_are_read_as_later_ones_tell(
    read: Read, table: Table, late: str, expected: set[float]
) -> None:
    content = same_content(read, table(["1.005"] * 500 + [late, "1.005"] * 100, ["40.100"], count=700), SIZES)
    found = content.loops["FIC1"].pv
    assert set(found[np.isfinite(found)]) == expected
    assert dict(content.rejects.counts) == ({"not_a_number": 100} if late == "Bad" else {})


def test_points_in_all_numbers_are_read_as_other_tags_tell(read: Read) -> None:
    content = read(wide(["999", "1.001"], ["40.100"]))
    assert content.loops["FIC1"].op.tolist() == [40100] * 60
    assert content.summary.notes == (f"{DOUBT}read as thousands: FIC1.PV, FIC1.OP",)


def test_words_alone_are_not_in_doubt(read: Read) -> None:
    content = read(wide(["50.123"], ["Bad"]))
    assert content.summary.notes[0] == f"{DOUBT}read as decimals: FIC1.PV"


def test_points_in_all_first_numbers_part_thousands_beside_later_ones_without(read: Read) -> None:
    content = read(wide(["1.001"] * 450 + ["999"] * 150, ["12"], count=600))
    assert content.loops["FIC1"].pv.tolist() == [1001] * 450 + [999] * 150
    assert content.summary.notes == (f"{DOUBT}read as thousands: FIC1.PV",)


@pytest.mark.parametrize("pack", [workbook_of, parquet_of])
@pytest.mark.parametrize(
    ("texts", "expected", "how"),
    [
        (("999", "1.000"), (999, 1000), "thousands"),
        (("50", "50.120"), (50, 50.12), "decimals"),
        (("50,123", "51,250"), (50.123, 51.25), "decimals"),
    ],
)
def test_numbers_in_doubt_in_cells_of_text_are_told(
    read: Read, pack: Callable[..., bytes], texts: Sequence[str], expected: Sequence[float], how: str
) -> None:
    content = read(pack(texts))
    assert content.loops["FIC1"].pv.tolist() == list(expected) * 30
    assert content.loops["FIC1"].op.tolist() == [40.125, 40.5] * 30
    assert content.summary.notes == (f"{DOUBT}read as {how}: FIC1.PV",)


@pytest.mark.parametrize("pack", [workbook_of, parquet_of])
def test_cells_of_text_show_how_they_are_written(read: Read, pack: Callable[..., bytes]) -> None:
    content = read(pack(("995,5", "1.000")))
    assert content.loops["FIC1"].pv.tolist() == [995.5, 1000] * 30
    assert content.summary.notes == ()


def test_numbers_of_cells_are_not_in_doubt(read: Read) -> None:
    content = read(workbook_of((450.0, 25.125)))
    assert content.loops["FIC1"].pv.tolist() == [450, 25.125] * 30
    assert content.summary.notes == ()


@pytest.mark.parametrize("op", ["40.1", "40"])
def test_a_tag_that_tells_at_its_end_is_read_so_from_the_start(read: Read, op: str) -> None:
    """Its first numbers alone would be thousands, those beside 5 in doubt."""
    first = ["50,123"] * 400 if op == "40.1" else ["999", "1,001"] * 200
    pv = [*first, *["5", "5,123"] * 200, *["50,12", "50,123"] * 200]
    content = same_content(read, wide(pv, [op], count=1200), SIZES)
    assert content.loops["FIC1"].pv.tolist() == [float(text.replace(",", ".")) for text in pv]
    assert content.rejects.total == 0


BESIDE_ALL = {
    "68.{0:03d}": ("12,5", "0,5", "1 234,5", "12,3 bar"),
    "68,{0:03d}": ("12.5", "0.5", "1 234.5", "12.3 bar"),
    "2.{0:03d}": ("50", "12,5"),
    "2.{0:03d},5": ("12.5", "1,234.5", "1,234,567"),
    "2,{0:03d}.5": ("12,5", "1.234,5"),
    "2 {0:03d},5": ("2 7,5", "1 2", "12 345 67"),
}


@pytest.mark.parametrize("usual", BESIDE_ALL)
@LAYOUTS
def test_one_odd_number_of_many_tells_nothing_of_the_others(read: Read, table: Table, usual: str) -> None:
    """Behind the 400 rows that are looked at of the start, and in another chunk than these."""
    texts = [usual.format(k % 900 + 100) for k in range(600)]
    good = read(table(texts, ["40"], count=600)).loops["FIC1"].pv
    for odd in BESIDE_ALL[usual]:
        content = same_content(read, table([*texts[:450], odd, *texts[451:]], ["40"], count=600), SIZES)
        found = content.loops["FIC1"].pv
        assert np.delete(found, 450).tolist() == np.delete(good, 450).tolist(), odd
        assert content.rejects.total <= 1, odd


@in_pairs(table=TABLES, usual=["1 {0:03d}", "1,{0:03d}"], odd=["1234", "5000"])
def test_one_large_number_does_not_tell_that_thousands_are_not_parted(
    read: Read, table: Table, usual: str, odd: str
) -> None:
    texts = [usual.format(k % 100) if k % 2 else f"{k % 99 + 900}" for k in range(600)]
    content = same_content(read, table([*texts[:450], odd, *texts[451:]], ["40"], count=600), SIZES)
    found = content.loops["FIC1"].pv
    assert found.min() >= 900
    assert np.delete(found, 450).max() < 1100


@LAYOUTS
def test_what_told_nothing_at_first_tells_where_many_follow(read: Read, table: Table) -> None:
    pv = ["68.123"] * 200 + ["12,5"] + ["68.123"] * 200 + ["12,5", "68,25"] * 150
    content = same_content(read, table(pv, ["40"], count=len(pv)), SIZES)
    assert np.count_nonzero(content.loops["FIC1"].pv == 12.5) == 151


@pytest.mark.parametrize(
    ("usual", "odd"), [("2.{0:03d},5", "12.5"), ("2.{0:03d},5", "1,234.5"), ("2,{0:03d}", "12.5"), ("2,{0:03d}", "0.5")]
)
def test_one_odd_number_of_many_tells_nothing_where_commas_part_fields(read: Read, usual: str, odd: str) -> None:
    texts = [f'"{usual.format(k % 900 + 100)}"' for k in range(600)]
    good = read(wide(texts, ["40"], ",", count=600)).loops["FIC1"].pv
    content = same_content(read, wide([*texts[:450], f'"{odd}"', *texts[451:]], ["40"], ",", count=600), SIZES)
    assert np.delete(content.loops["FIC1"].pv, 450).tolist() == np.delete(good, 450).tolist()
    assert content.rejects.total <= 1


@pytest.mark.parametrize(("day", "pv"), [("01.03.2026", 50.1), ("2026-03-01", 50_100.0), ("03/01/2026", 50_100.0)])
def test_dates_with_points_tell_decimal_commas_where_commas_part_fields(read: Read, day: str, pv: float) -> None:
    """Nobody who writes 13.03.2026 parts thousands by commas."""
    rows = (f'"{day} 00:{k:02d}:00","50,{100 + k}","40,{200 + k}"' for k in range(60))
    content = read("\n".join(("Time,FIC1.PV,FIC1.OP", *rows, "")))
    assert content.loops["FIC1"].pv[0] == pv
    assert DOUBT + f"read as {'decimals' if pv < 100 else 'thousands'}: FIC1.PV, FIC1.OP" in content.summary.notes
