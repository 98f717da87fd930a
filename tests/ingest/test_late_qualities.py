"""Columns such as `FIC1.PV_ST` that hold qualities below the first rows alone, and quality numbers that later rows tell
in tables that are read some columns at a time."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from io import BytesIO
from weakref import ReferenceType, ref

import numpy as np
import polars as pl
import pytest

from app.ingest import IngestOptions, TagMapping
from app.ingest.exports import tables_in
from app.ingest.model import FloatArray, SignalBlock
from app.ingest.tables.pieces import Grid
from app.ingest.tables.wide_chunk import Chunk
from app.ingest.tables.wide_table import WideTable

from .conftest import Content, Read, in_pairs

ROWS, FIRST = 1200, 500
STAMPS = [f"2026-03-01 {i // 60:02d}:{i % 60:02d}:00" for i in range(ROWS)]
BAD = list(range(FIRST, ROWS, 10))


def wide(first: str, good: str, bad: str, ending: str = "_ST") -> str:
    """Nothing but `first` stands in the first rows; below them every tenth value is bad."""
    status = [first if i < FIRST else bad if i % 10 == 0 else good for i in range(ROWS)]
    rows = (f"{stamp},{50 + i % 7}.5,{status[i]},{40 + i % 5}.5\n" for i, stamp in enumerate(STAMPS))
    return f"Time,FIC1.PV,FIC1.PV{ending},FIC1.OP\n" + "".join(rows)


def refused(content: Content) -> list[int]:
    return np.flatnonzero(np.isnan(content.loops["FIC1"].pv)).tolist()


@in_pairs(
    words=[
        ("", "Good", "Bad"),
        ("", "", "I/O Timeout"),
        ("", "Good", "No Data"),
        ("", "192", "0"),
        ("0", "Good", "Bad"),
        ("", "G", "B"),
    ],
    ending=["_ST", ".Q", " Stat"],
    chunk_bytes=[16 << 20, 4000],
)
def test_qualities_that_come_late_judge_all_values(
    read: Read, words: tuple[str, str, str], ending: str, chunk_bytes: int
) -> None:
    """words: of the first rows, of good values and of bad ones."""
    content = read(wide(*words, ending), options=IngestOptions(chunk_bytes=chunk_bytes))
    assert refused(content) == BAD
    assert dict(content.rejects.counts) == {"bad_quality": len(BAD)}
    assert set(content.loops) == {"FIC1"}
    assert not content.loops["FIC1"].others


@pytest.mark.parametrize(
    ("first", "good", "bad"), [("", "Running", "Stopped"), ("0", "0", "1"), ("", "2", "3"), ("", "Running", "Fault")]
)
def test_states_and_counts_judge_nothing(read: Read, first: str, good: str, bad: str) -> None:
    content = read(wide(first, good, bad))
    assert refused(content) == []
    assert "bad_quality" not in content.rejects.counts


def test_what_moves_judges_nothing(read: Read) -> None:
    rows = (f"{stamp},50.{i % 7},{i / 10 if i > FIRST else ''},40.5\n" for i, stamp in enumerate(STAMPS))
    content = read("Time,FIC1.PV,FIC1.PV_Q,FIC1.OP\n" + "".join(rows))
    assert refused(content) == []
    assert np.nanmax(content.loops["FIC1.PV_Q"].others["FIC1.PV_Q"]) == (ROWS - 1) / 10


def parquet(columns: dict[str, list[object]]) -> bytes:
    stream = BytesIO()
    pl.DataFrame(columns).write_parquet(stream)
    return stream.getvalue()


@pytest.mark.parametrize("most_columns", [1000, 2])
@pytest.mark.parametrize("kind", ["numbers", "texts"])
def test_quality_numbers_of_a_table_in_several_passes_are_judged_by_all_rows(
    read: Read, monkeypatch: pytest.MonkeyPatch, most_columns: int, kind: str
) -> None:
    """0 is the only number of the first chunk; 192 tells that it is a bad one."""
    monkeypatch.setattr(tables_in, "MOST_COLUMNS", most_columns)
    monkeypatch.setattr(tables_in, "CELLS_A_CHUNK", 1)  # the least rows a chunk has are 1,000
    quality = [0] * 1000 + [192] * 200
    columns: dict[str, list[object]] = {"Time": list(STAMPS)}
    for loop in ("FIC1", "FIC2", "FIC3"):
        columns |= {f"{loop}.PV": [50.5 + i % 7 for i in range(ROWS)], f"{loop}.OP": [40.5] * ROWS}
        columns[f"{loop}.PV_Quality"] = quality if kind == "numbers" else [str(one) for one in quality]
    content = read(parquet(columns), name="export.parquet")
    assert set(content.loops) == {"FIC1", "FIC2", "FIC3"}
    for loop in content.loops.values():
        assert np.flatnonzero(np.isnan(loop.pv)).tolist() == list(range(1000))
    assert content.rejects.counts == {"bad_quality": 3000}
    assert content.summary.rows_read == content.summary.rows_kept == ROWS


@pytest.mark.parametrize("most_columns", [1000, 2])
def test_marks_of_a_table_in_several_passes_are_read_as_all_rows_tell(
    read: Read, monkeypatch: pytest.MonkeyPatch, most_columns: int
) -> None:
    """What may be decimals in the first chunk of the first columns has thousands, as the last ones tell below."""
    monkeypatch.setattr(tables_in, "MOST_COLUMNS", most_columns)
    monkeypatch.setattr(tables_in, "CELLS_A_CHUNK", 1)
    columns: dict[str, list[object]] = {"Time": list(STAMPS)}
    for loop in ("FIC1", "FIC2"):
        columns[f"{loop}.PV"] = [f"1,{100 + i % 800}" for i in range(ROWS)]
        columns[f"{loop}.OP"] = ["40"] * ROWS
    columns["FIC3.PV"] = ["7"] * 1100 + [f"1,234,{567 + i % 3}" for i in range(100)]
    columns["FIC3.OP"] = ["40"] * ROWS
    content = read(parquet(columns), name="export.parquet")
    for loop in ("FIC1", "FIC2"):
        np.testing.assert_allclose(content.loops[loop].pv, [1100 + i % 800 for i in range(ROWS)])


@pytest.mark.parametrize("most_columns", [1000, 2])
def test_late_qualities_of_a_table_in_several_passes(
    read: Read, monkeypatch: pytest.MonkeyPatch, most_columns: int
) -> None:
    monkeypatch.setattr(tables_in, "MOST_COLUMNS", most_columns)
    status = ["" if i < FIRST else "Bad" if i % 10 == 0 else "Good" for i in range(ROWS)]
    columns: dict[str, list[object]] = {"Time": list(STAMPS)}
    for loop in ("FIC1", "FIC2"):
        columns |= {f"{loop}.PV": [50.5 + i % 7 for i in range(ROWS)], f"{loop}.OP": [40.5] * ROWS}
        columns[f"{loop}.PV_ST"] = list(status)
    content = read(parquet(columns), name="export.parquet")
    assert refused(content) == BAD
    assert content.rejects.counts == {"bad_quality": 2 * len(BAD)}


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        ("Q", "192", "0"),
        ("Q", "Good", "Bad"),
        ("ST", "G", "B"),
        ("FIC1.PV Conf", "100", "0"),
        ("FIC1.PV.CONF", "100.0", "50"),
    ],
)
def test_short_names_of_qualities_beside_a_value(read: Read, name: str, good: str, bad: str) -> None:
    rows = (f"{stamp},{50 + i % 7}.5,{good if i % 10 else bad},40.5\n" for i, stamp in enumerate(STAMPS))
    content = read(f"Time,FIC1.PV,{name},FIC1.OP\n" + "".join(rows))
    assert refused(content) == list(range(0, ROWS, 10))
    assert set(content.loops) == {"FIC1"}


@pytest.mark.parametrize(("name", "values"), [("FIC1.PV.CONF", ("3", "4")), ("Q", ("3.5", "4.5"))])
def test_short_names_of_something_else(read: Read, name: str, values: tuple[str, str]) -> None:
    rows = (f"{stamp},{50 + i % 7}.5,{values[i % 2]},40.5\n" for i, stamp in enumerate(STAMPS))
    content = read(f"Time,FIC1.PV,{name},FIC1.OP\n" + "".join(rows))
    assert refused(content) == []


@pytest.mark.parametrize(("values", "told"), [(("0", "2"), True), (("Running", "Stopped"), False), (("0", "0"), False)])
def test_what_may_be_qualities_and_judges_nothing_is_told(read: Read, values: tuple[str, str], told: bool) -> None:
    rows = (f"{stamp},{50 + i % 7}.5,{values[i % 9 == 0]},40.5\n" for i, stamp in enumerate(STAMPS))
    content = read("Time,FIC1.PV,FIC1.PV_ST,FIC1.OP\n" + "".join(rows))
    assert refused(content) == []
    notes = [note for note in content.summary.notes if note.startswith("columns are called as qualities of values")]
    assert len(notes) == told
    assert all(note.endswith("refused by them: FIC1.PV_ST") for note in notes)


def test_a_column_of_qualities_alone_is_what_the_file_has(read: Read) -> None:
    content = read("Time,Q\n" + "".join(f"{stamp},192\n" for stamp in STAMPS))
    assert np.nanmax(content.loops["Q"].others["Q"]) == 192


def beside(names: str, field: Callable[[int], str], more: str = "") -> str:
    """A column beside values that are all good."""
    rows = (f"{stamp},{50 + i % 7}.5,{field(i)},40.5\n" for i, stamp in enumerate(STAMPS))
    return f"Time,{names}\n" + "".join(rows) + more


@pytest.mark.parametrize("chunk_bytes", [16 << 20, 4000])
@pytest.mark.parametrize("word", ["Bad", "I/O Timeout", "No Data"])
@pytest.mark.parametrize("first", [50, 0])
def test_words_of_faults_among_numbers_do_not_make_them_qualities(
    read: Read, word: str, first: int, chunk_bytes: int
) -> None:
    text = beside("FIC1.PV,FIC1.PV_ST,FIC1.OP", lambda i: word if i == 900 else str(first + i // 400))
    content = read(text, options=IngestOptions(chunk_bytes=chunk_bytes))
    assert refused(content) == []
    assert dict(content.rejects.counts) == {"not_a_number": 1}
    assert np.nanmax(content.loops["FIC1.PV_ST"].others["FIC1.PV_ST"]) == first + 2


@pytest.mark.parametrize("chunk_bytes", [16 << 20, 4000])
def test_faults_and_numbers_before_the_first_good_value(read: Read, chunk_bytes: int) -> None:
    def field(i: int) -> str:
        return "0" if i < FIRST else "No Data" if i < 900 else "Good"

    content = read(beside("FIC1.PV,FIC1.PV_ST,FIC1.OP", field), options=IngestOptions(chunk_bytes=chunk_bytes))
    assert refused(content) == list(range(FIRST, 900))  # 0 is its only number, and taken for good


def test_numbers_below_first_rows_that_are_all_bad_judge_nothing(read: Read) -> None:
    content = read(beside("FIC1.PV,FIC1.PV_ST,FIC1.OP", lambda i: "Bad" if i < 900 else f"{i}.5"))
    assert refused(content) == []


@pytest.mark.parametrize("more", ["Total,3456.5,Summary,77.5\n", "Time,FIC1.PV,FIC1.PV_ST,FIC1.OP\n"])
@pytest.mark.parametrize("chunk_bytes", [16 << 20, 4000])
def test_rows_without_a_time_tell_nothing_of_late_qualities(read: Read, more: str, chunk_bytes: int) -> None:
    content = read(wide("", "Good", "Bad") + more, options=IngestOptions(chunk_bytes=chunk_bytes))
    assert refused(content) == BAD


@pytest.mark.parametrize("values", [range(192, 198), (192, 196), (200, 204)])
def test_whole_numbers_that_opc_has_no_quality_for_are_values(read: Read, values: Sequence[int]) -> None:
    content = read(beside("FIC1.PV,Q,FIC1.OP", lambda i: str(values[i % len(values)])))
    assert np.nanmax(content.loops["Q"].others["Q"]) == max(values)


def test_confidences_are_percentages(read: Read) -> None:
    odd = dict(enumerate((0, -1, 50, 70, 99), 700))
    text = beside("FIC1.PV,FIC1.PV Conf,FIC1.OP", lambda i: str(odd.get(i, 100)))
    content = read(text)
    assert refused(content) == [i for i, confidence in odd.items() if confidence in (0, -1, 50)]


def test_confidences_tell_nothing_of_quality_numbers(read: Read) -> None:
    rows = (f"{stamp},50.5,100,51.5,{3 if i % 10 == 0 else 0}\n" for i, stamp in enumerate(STAMPS))
    content = read("Time,FIC1.PV,FIC1.PV Conf,FIC2.PV,FIC2.PV_Quality\n" + "".join(rows))
    assert refused(content) == []
    assert dict(content.rejects.counts) == {"bad_quality": ROWS // 10}


def test_what_follows_its_value_is_no_confidence(read: Read) -> None:
    """The confirmed position of a valve."""
    rows = (f"{stamp},{100 * (i % 3 > 0)},{100 * (i % 3 > 0)}\n" for i, stamp in enumerate(STAMPS))
    content = read("Time,XV1.OP,XV1.OP.Conf\n" + "".join(rows))
    assert not content.rejects.counts


def test_what_was_read_first_is_let_go_before_rows_are_read_once_more(
    read: Read, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[tuple[int, ReferenceType[FloatArray]]] = []
    read_grid, give = WideTable._grid, WideTable._blocks

    def grid(table: WideTable, chunk: Chunk, number: int) -> Grid:
        found = read_grid(table, chunk, number)
        made.append((id(table), ref(found.values)))
        return found

    def blocks(table: WideTable, grids: Iterable[Grid]) -> Iterator[SignalBlock]:
        assert len({reader for reader, _ in made}) == 2
        assert {reader for reader, values in made if values() is not None} == {id(table)}
        return give(table, grids)

    monkeypatch.setattr(WideTable, "_grid", grid)
    monkeypatch.setattr(WideTable, "_blocks", blocks)
    content = read(wide("", "Good", "Bad"), options=IngestOptions(chunk_bytes=4000))
    assert refused(content) == BAD


@pytest.mark.parametrize("chunk_bytes", [16 << 20, 4000])
@pytest.mark.parametrize("ending", ["_ST", "_Quality"])
@pytest.mark.parametrize("odd", ["1e400", "nan", "-inf"])
@pytest.mark.parametrize("at", [1, 900])
def test_numbers_without_a_size_are_no_qualities(read: Read, at: int, odd: str, ending: str, chunk_bytes: int) -> None:
    def field(i: int) -> str:
        return odd if i == at else "0x00" if i % 100 == 50 else "192"

    text = beside(f"FIC1.PV,FIC1.PV{ending},FIC1.OP", field)
    content = read(text, options=IngestOptions(chunk_bytes=chunk_bytes))
    as_quality = ending == "_Quality" or at == 900
    assert (at in refused(content)) == (as_quality and odd != "nan")
    assert (50 in refused(content)) == as_quality
    assert content.loops["FIC1"].samples == ROWS


@pytest.mark.parametrize("odd", ["1e400", "nan", "inf"])
def test_numbers_without_a_size_that_come_late(read: Read, odd: str) -> None:
    content = read(beside("FIC1.PV,FIC1.PV_ST,FIC1.OP", lambda i: "" if i < FIRST else odd if i > 900 else "0x00"))
    assert refused(content) == []


def test_a_quality_that_is_not_there_refuses_nothing_in_rows_of_tags(read: Read) -> None:
    rows = (f"{stamp},FIC1.PV,50.5,{'nan' if i % 10 else 192}\n" for i, stamp in enumerate(STAMPS))
    content = read("Time,Tag,Value,Quality\n" + "".join(rows))
    assert refused(content) == []


@pytest.mark.parametrize("first", [range(ROWS), range(FIRST)])
@pytest.mark.parametrize("name", ["FIC1.PV_ST", "FIC1.PV.Q", "FIC1.PV_Quality"])
def test_a_column_that_a_mapping_has_as_a_signal_is_no_quality(read: Read, name: str, first: range) -> None:
    """Its set points of 192 and 0 look as numbers of OPC do."""
    mapping = TagMapping.from_bytes(f"tag,loop,signal\n{name},FIC1,SP\n".encode())
    rows = (f"{stamp},{50 + i % 7}.5,{192 if i in first or i % 10 else 0},40.5\n" for i, stamp in enumerate(STAMPS))
    text = f"Time,FIC1.PV,{name},FIC1.OP\n" + "".join(rows)
    content = read(text, mapping=mapping)
    assert refused(content) == []
    assert content.loops["FIC1"].sp is not None
    assert np.nanmax(content.loops["FIC1"].sp) == 192
    if len(first) == FIRST:
        assert refused(read(text)) == BAD
