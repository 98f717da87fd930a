"""The same content is read from a file wherever the chunks fall in which it is read."""

from collections.abc import Iterator

import numpy as np
import pytest

from app.ingest import IngestOptions

from .conftest import Content, Read

WHOLE = 1 << 24
SIZES = (1_500, 4_000, 9_000)
ONE_SIZE = (4_000,)
"""For what is tried at several places of the file besides."""


def same_content(read: Read, text: str, sizes: tuple[int, ...] = SIZES) -> Content:
    """What is read from it whole, after it was read the same in chunks."""
    whole, *parted = (read(text, options=IngestOptions(chunk_bytes=size)) for size in (WHOLE, *sizes))
    for content in parted:
        assert content.summary == whole.summary
        assert dict(content.rejects.counts) == dict(whole.rejects.counts)
        assert set(content.rejects.listed) == set(whole.rejects.listed)
        assert content.loops.keys() == whole.loops.keys()
        for name, loop in whole.loops.items():
            other = content.loops[name]
            assert other.others.keys() == loop.others.keys()
            for field in ("time_ns", "pv", "op", "sp", "automatic"):
                assert_same(getattr(other, field), getattr(loop, field))
            for tag, values in loop.others.items():
                assert_same(other.others[tag], values)
    return whole


def assert_same(found: np.ndarray | None, expected: np.ndarray | None) -> None:
    assert (found is None) == (expected is None)
    if found is not None and expected is not None:
        np.testing.assert_array_equal(found, expected)


def stamp(k: int) -> str:
    return f"2024-01-31 06:{k // 60:02d}:{k % 60:02d}"


def by_tag(heading: str, *rows: Iterator[str]) -> str:
    """A table sorted by tag: where a chunk ends, it has few rows of one."""
    return "\n".join((heading, *(row for of_tag in rows for row in of_tag))) + "\n"


@pytest.mark.parametrize("word", ["I/O Timeout", "Scan stopped", "[-11059] No Good Data For Calculation", "Pt Created"])
@pytest.mark.parametrize("start", [0, 280])
def test_words_of_states_are_judged_by_all_rows_of_their_tag(read: Read, word: str, start: int) -> None:
    def rows(tag: str) -> Iterator[str]:
        for k in range(300):
            told = start <= k < start + 20
            yield f"FIC101.{tag},{stamp(k)},{248 if told else k % 9},{word if told else ''}"

    content = same_content(read, by_tag("tag,time,value,svalue", rows("PV"), rows("OP")), ONE_SIZE)
    assert content.rejects.counts == {"not_a_number": 40}


@pytest.mark.parametrize("word", ["High", "shift change"])
def test_remarks_beside_numbers_are_told_by_all_rows_of_their_tag(read: Read, word: str) -> None:
    def rows(tag: str) -> Iterator[str]:
        for k in range(300):
            yield f"FIC101.{tag},{stamp(k)},{k % 9},{word if k % 100 == 7 else ''}"

    content = same_content(read, by_tag("tag,time,value,svalue", rows("PV"), rows("OP")))
    assert content.rejects.total == 0


def test_the_unit_of_a_tag_is_the_one_of_most_of_its_rows(read: Read) -> None:
    def rows(tag: str, first: int) -> Iterator[str]:
        for k in range(300):
            yield f"PIC101.{tag},{stamp(k)},{k % 9},{'psi' if k < first else 'bar'}"

    content = same_content(read, by_tag("tag,time,value,unit", rows("PV", 100), rows("OP", 60)))
    assert content.rejects.counts == {"other_unit": 160}
    assert dict(content.summary.units) == {"PIC101.PV": "bar", "PIC101.OP": "bar"}


HEADING = "DateTime,FIC101.PV,FIC101.OP,FIC101.SP"


def wide(*rows: str) -> str:
    return "\n".join((HEADING, *rows)) + "\n"


def row(k: int, shift: int = 0) -> str:
    return f"{stamp(k)},{k % 9 + shift},{k % 7 + 40},50"


@pytest.mark.parametrize("backward", [False, True])
def test_rows_of_one_stamp_that_a_chunk_parts(read: Read, backward: bool) -> None:
    rows = [row(k, shift) for k in range(600) for shift in range(1 + (k % 5 == 0))]
    content = same_content(read, wide(*(reversed(rows) if backward else rows)), (500, 1_500, 4_000))
    assert content.rejects.counts == {"duplicate_time": 120}
    assert content.loops["FIC101"].samples == 600
    assert "120 rows have the time of a row before" in " ".join(content.summary.notes)


@pytest.mark.parametrize("seed", range(2))
def test_shuffled_rows_of_which_some_came_twice(read: Read, seed: int) -> None:
    rows = np.random.default_rng(seed).permutation([row(k) for k in range(600)] + [row(k) for k in range(0, 600, 5)])
    content = same_content(read, wide(*rows))
    assert content.rejects.total == 0
    loop = content.loops["FIC101"]
    assert loop.pv is not None
    assert loop.pv.tolist() == [k % 9 for k in range(600)]


@pytest.mark.parametrize("later_first", [False, True])
def test_exports_that_overlap_one_behind_the_other(read: Read, later_first: bool) -> None:
    earlier, later = [row(k) for k in range(400)], [row(k, 1) for k in range(395, 800)]
    content = same_content(read, wide(*(later + earlier if later_first else earlier + later)))
    loop = content.loops["FIC101"]
    assert loop.pv is not None
    assert loop.pv[395:400].tolist() == [k % 9 + (not later_first) for k in range(395, 400)]
    assert content.rejects.counts == {"duplicate_time": 5}
    assert content.summary.values_kept == 2400


@pytest.mark.parametrize("first", [0, 100, 300])
def test_codes_for_no_data_that_fill_whole_chunks(read: Read, first: int) -> None:
    def value(k: int) -> str:
        return f"{stamp(k)},{k % 9},{32767 if first <= k < first + 250 else k % 7 + 40},50"

    text = wide(*(value(k) for k in range(600)))
    content = same_content(read, text)
    assert content.rejects.counts == {"sentinel": 250}
    aside = read(text, options=IngestOptions(chunk_bytes=4_000, buffered_values=500))
    assert aside.summary == content.summary
    assert_same(aside.loops["FIC101"].op, content.loops["FIC101"].op)


def test_a_signal_that_some_chunks_have_no_value_of(read: Read) -> None:
    rows = (
        f"{stamp(k)},{k % 9},{k % 7 + 40},{50 if 200 <= k < 210 else ''},{k if k > 400 else ''}" for k in range(600)
    )
    content = same_content(read, "\n".join((f"{HEADING},TI7.PV", *rows)) + "\n")
    assert content.loops["TI7"].samples == 600


def test_rows_that_cannot_be_parted_are_told_once(read: Read) -> None:
    rows = [f"FIC101.{tag},{stamp(k)},{k % 9},bar" for k in range(300) for tag in ("PV", "OP")]
    rows[100] = 'FIC101.PV,"2024,3,bar'
    rows[400] = "FIC101.PV,2024,3,bar,5,6"
    content = same_content(read, "\n".join(("tag,time,value,unit", *rows)) + "\n")
    assert content.rejects.counts == {"unbalanced_quote": 1, "ragged_row": 1}


def test_notes_name_tags_in_their_order_wherever_odd_numbers_stand(read: Read) -> None:
    def odd(k: int, first: int) -> str:
        return f"{k % 9}.5 °C" if k >= first else f"{k % 9}.5"

    rows = (f"{stamp(k)},{odd(k, 500)},{odd(k, 300)},{odd(k, 5)}" for k in range(600))
    content = same_content(read, wide(*rows))
    assert any("°C (FIC101.PV, FIC101.OP, FIC101.SP)" in note for note in content.summary.notes)


def of_two_tags(told: str, usual: str, first: int, count: int, quality: bool = False) -> str:
    """Sorted by tag: `told` stands in some rows of each, `usual` in the others, each with the number of its row."""

    def rows(tag: str) -> Iterator[str]:
        for k in range(600):
            cell = told if first <= k < first + count else usual
            yield f"FIC101.{tag};{stamp(k)};{cell.format(k % 90 + 100, k % 10)}"

    return by_tag(f"tag;time;value{';quality' if quality else ''}", rows("PV"), rows("OP"))


AT = [(0, 150), (225, 150), (450, 150), (150, 450)]
PLACES = pytest.mark.parametrize(("first", "count"), AT)


def in_turn(*forms: tuple[object, ...]) -> list[tuple[object, ...]]:
    """Each form at two of the places: at the start or the end of its tag, and in its middle or in most of it."""
    return [(*form, *AT[at]) for k, form in enumerate(forms) for at in ((0, 3), (2, 1), (0, 1), (2, 3))[k % 4]]


@pytest.mark.parametrize(
    ("rare", "often", "first", "count"),
    in_turn(("0", "1"), ("1", "0"), ("-1", "0"), ("0", "192"), ("500", "192")),
)
def test_which_quality_is_good_is_told_by_all_rows(read: Read, rare: str, often: str, first: int, count: int) -> None:
    told, usual = (rare, often) if count < 300 else (often, rare)
    content = same_content(read, of_two_tags(f"{{}};{told}", f"{{}};{usual}", first, count, quality=True), ONE_SIZE)
    assert content.rejects.counts == {"bad_quality": 300}


def test_which_quality_is_good_is_told_by_all_columns(read: Read) -> None:
    rows = (f"{stamp(k)},{k % 9},{int(k < 350)},{k % 7 + 40},1" for k in range(600))
    content = same_content(read, "\n".join(("Time,A.PV,A.PV.Quality,A.OP,A.OP.Quality", *rows)) + "\n")
    assert content.rejects.counts == {"bad_quality": 250}


@PLACES
def test_the_unit_behind_numbers_is_that_of_most_of_its_tag(read: Read, first: int, count: int) -> None:
    told, usual = ("psi", "bar") if count < 300 else ("bar", "psi")
    content = same_content(read, of_two_tags(f"{{}}.{{}} {told}", f"{{}}.{{}} {usual}", first, count), ONE_SIZE)
    assert content.rejects.counts == {"not_a_number": 300}
    assert any("in another unit than most of their tag, and were refused: psi" in n for n in content.summary.notes)


@pytest.mark.parametrize(
    ("told", "usual", "least", "first", "count"),
    in_turn(
        ("1 {0}", "9{1}8", 908),  # blanks part thousands, as 998 beside 1 100 shows
        ("1,{0}", "9{1}8", 908),
        ("9{1}8", "1.{0}", 908),
        ("1,{0}.5", "1,{0}", 1100),
        ("1.{0},5", "1.{0}", 1100),
    ),
)
def test_parted_thousands_are_told_by_all_rows(
    read: Read, told: str, usual: str, least: float, first: int, count: int
) -> None:
    content = same_content(read, of_two_tags(told, usual, first, count), ONE_SIZE)
    assert content.rejects.total == 0
    assert content.loops["FIC101"].pv is not None
    assert content.loops["FIC101"].pv.min() >= least
    assert content.loops["FIC101"].pv.max() < 1190


def test_what_is_plain_is_read_once(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.ingest.exports.export.TableExport._known", lambda *_: pytest.fail("read once more"))
    monkeypatch.setattr("app.ingest.tables.frames.LEAST_BYTES", 8)
    same_content(read, of_two_tags("{}.5;192", "{}.5;0", 0, 500, quality=True), ONE_SIZE)
    same_content(read, of_two_tags("1,{0}.5 bar", "0.5 bar", 0, 300), ONE_SIZE)
    same_content(read, of_two_tags("{0},125", "{0},250", 0, 300), ONE_SIZE)


@pytest.mark.parametrize(("column", "usual", "rare"), [("svalue", "", "Bad Input"), ("unit", "bar", "psi")])
def test_what_stands_beside_values_is_looked_at_once(
    read: Read, monkeypatch: pytest.MonkeyPatch, column: str, usual: str, rare: str
) -> None:
    """Where the first rows tell of it as all of them do."""
    monkeypatch.setattr("app.ingest.exports.export.TableExport._known", lambda *_: pytest.fail("read once more"))
    rows = (
        f"FIC101.{tag},{stamp(k)},{k % 9},{rare if k % 50 == 9 else usual}" for k in range(300) for tag in ("PV", "OP")
    )
    content = same_content(read, "\n".join((f"tag,time,value,{column}", *rows)) + "\n")
    assert content.rejects.total == 12


def test_remarks_are_told_behind_many_that_came_once(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.ingest.tables.state_words._MOST_HELD", 100)

    def word(k: int) -> str:
        return f"batch {k}" if k % 4 == 1 and k < 560 else "High" if k % 4 == 1 else ""

    rows = (f"FIC101.{tag},{stamp(k)},{k % 9},{word(k)}" for k in range(800) for tag in ("PV", "OP"))
    content = same_content(read, "\n".join(("tag,time,value,svalue", *rows)) + "\n", ONE_SIZE)
    assert content.rejects.counts == {"not_a_number": 280}
