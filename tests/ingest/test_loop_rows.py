"""A row a loop: tables of a database that have the signals of all loops in the same columns."""

from collections.abc import Callable
from datetime import datetime, timedelta

import numpy as np
import polars as pl
import pytest

from app.errors import DataError
from app.ingest import IngestOptions

from .conftest import Content, Read, in_pairs
from .test_tables import parquet, workbook

pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
FIRST = datetime(2024, 3, 14, 8)
AT = np.datetime64(FIRST, "ns").astype(np.int64) + 10**9 * np.arange(300)
OFFSETS = {"FIC101": 0, "TIC205": 1000, "LIC3": 2000}


def rows(by_loop: bool = False) -> list[list[str]]:
    seconds = [(k, loop) for k in range(300) for loop in OFFSETS]
    order = sorted(seconds, key=lambda row: list(OFFSETS).index(row[1])) if by_loop else seconds
    stamps = [f"{FIRST + timedelta(seconds=k)}" for k in range(300)]
    return [[loop, stamps[k], f"{OFFSETS[loop] + k}", f"{k % 7}.5", f"{OFFSETS[loop]}"] for k, loop in order]


def text(names: str, table: list[list[str]]) -> str:
    return "\n".join((names, *map(",".join, table))) + "\n"


def check(content: Content) -> None:
    assert content.summary.layout == "loop_rows"
    assert set(content.loops) == set(OFFSETS)
    for name, offset in OFFSETS.items():
        loop = content.loops[name]
        np.testing.assert_array_equal(loop.time_ns, AT)
        np.testing.assert_array_equal(loop.pv, offset + np.arange(300.0))
        np.testing.assert_array_equal(loop.op, np.arange(300) % 7 + 0.5)
        np.testing.assert_array_equal(loop.sp, np.full(300, float(offset)))
    assert (content.summary.rows_read, content.summary.rows_kept, content.summary.values_kept) == (900, 900, 2700)
    assert content.rejects.total == 0


IN_CHUNKS = IngestOptions(chunk_bytes=2000, buffered_values=600)


@in_pairs(
    name=["Loop", "Tag", "LoopName", "loop_name", "Controller", "Block"],
    by_loop=[False, True],
    options=[IngestOptions(), IN_CHUNKS],
)
def test_each_loop_has_its_rows(read: Read, name: str, by_loop: bool, options: IngestOptions) -> None:
    check(read(text(f"{name},Time,PV,OP,SP", rows(by_loop)), options=options))


def test_in_parquet_and_in_a_workbook(read: Read) -> None:
    names = ["Loop", "Time", "PV", "OP", "SP"]
    columns = dict(zip(names, zip(*rows(), strict=True), strict=True))
    frame = pl.DataFrame(columns).with_columns(pl.col("PV", "OP", "SP").cast(pl.Float64))
    check(read(parquet(frame)))
    check(read(workbook([names, *rows()])))


def test_loops_that_are_numbers_repeat(read: Read) -> None:
    numbered = [[str(list(OFFSETS).index(loop) + 1), *rest] for loop, *rest in rows()]
    assert set(read(text("Loop,Time,PV,OP,SP", numbered)).loops) == {"1", "2", "3"}
    counted = [[str(k), *rest] for k, (_, *rest) in enumerate(row for row in rows() if row[0] == "LIC3")]
    assert read(text("Item,Time,PV,OP,SP", counted)).summary.layout == "wide"


def test_what_is_wrong_with_a_row_is_told_once(read: Read) -> None:
    table = rows()
    table[4][1], table[7][0], table[9][2] = "late", "", "Bad"
    content = read(text("Loop,Time,PV [degC],OP,SP,Remark", [[*row, "x"] for row in table]))
    assert dict(content.rejects.counts) == {"bad_time": 1, "no_tag": 1, "not_a_number": 1}
    assert content.summary.rows_kept == 898
    assert any("Remark" in note for note in content.summary.notes)


def test_modes_in_words(read: Read) -> None:
    table = [[*row, "AUTO" if row[0] == "LIC3" else "MAN"] for row in rows()]
    content = read(text("Loop,Time,PV,OP,SP,MODE", table))
    means = {name: float(np.mean(loop.automatic)) for name, loop in content.loops.items()}
    assert means == {"FIC101": 0.0, "TIC205": 0.0, "LIC3": 1.0}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Controller", ("Auto", "Manual")),
        ("Name", ("Anna", "Bo")),
        ("Item", ("Diesel", "Naphtha")),
        ("Signal", ("Good1", "Bad")),
        ("Name", ("FIC101", "")),
    ],
)
def test_words_that_name_no_loops(read: Read, name: str, words: tuple[str, str]) -> None:
    table = [[*row, words[k > 0 if "" in words else k // 100]] for k, (_, *row) in enumerate(rows(by_loop=True)[:200])]
    content = read(text(f"Time,PV,OP,SP,{name}", table))
    assert (content.summary.layout, set(content.loops) - {name}) == ("wide", {"export"})
    assert content.loops["export"].pv.tolist() == list(range(200))


@pytest.mark.parametrize("name", ["Loop", "Point"])
def test_words_in_a_few_rows_name_no_loops(read: Read, name: str) -> None:
    table = [[*row, "FIC101" if k % 50 == 0 else ""] for k, (_, *row) in enumerate(rows(by_loop=True)[:200])]
    content = read(text(f"Time,PV,OP,SP,{name}", table))
    assert content.loops["export"].pv.tolist() == list(range(200))
    assert "no_tag" not in content.rejects.counts


def test_a_loop_that_fills_the_first_rows_alone(read: Read) -> None:
    content = read(text("Tag,Time,PV,OP,SP", [row for row in rows(by_loop=True) for _ in range(2)]))
    assert set(content.loops) == set(OFFSETS)


def in_batches(each: int, words: int) -> list[list[str]]:
    return [[f"B24-{k // each:03d}", f"{FIRST + timedelta(seconds=k)}", f"{k}", "1.5"] for k in range(each * words)]


@in_pairs(name=["Series", "Item", "Name", "Variable"], each=[50, 3000], way=[1, -1])
def test_batches_are_no_loops(read: Read, name: str, each: int, way: int) -> None:
    content = read(text(f"{name},Time,PV,OP", in_batches(each, 4)[::way]), name="FIC7.csv")
    assert content.loops["FIC7"].pv.tolist() == list(range(4 * each))
    in_words = [[batch, word, time, pv] for batch, time, pv, _ in in_batches(each, 4)[::way] for word in ("PV", "OP")]
    assert read(text(f"{name},Signal,Time,Value", in_words), name="FIC7.csv").loops["FIC7"].samples == 4 * each


@pytest.mark.parametrize("name", ["Loop", "Tag", "Controller"])
def test_loops_that_were_recorded_one_after_the_other(read: Read, name: str) -> None:
    assert len(read(text(f"{name},Time,PV,OP", in_batches(50, 4))).loops) == 4
    one_after_the_other = [[f"FIC{batch[-1]}", *row] for batch, *row in in_batches(50, 4)]
    assert set(read(text("Name,Time,PV,OP", one_after_the_other)).loops) == {"FIC0", "FIC1", "FIC2", "FIC3"}


@pytest.mark.parametrize("options", [IngestOptions(), IN_CHUNKS])
def test_further_columns_of_numbers_are_kept_beside_their_loops(read: Read, options: IngestOptions) -> None:
    table = [[*row, f"{k}", f"{k % 3}.5", "x"] for k, row in enumerate(rows())]
    content = read(text("Loop,Time,PV,OP,SP,FT7,TIC9.PV,Remark", table), options=options)
    assert list(content.loops) == list(OFFSETS)
    for number, (name, loop) in enumerate(content.loops.items()):
        assert set(loop.others) == {f"{name}.FT7", f"{name}.TIC9.PV"}
        assert loop.others[f"{name}.FT7"].tolist() == list(range(number, 900, 3))
    assert content.summary.notes == ("columns beside the signals of the loops were not read: Remark",)


def test_a_second_column_of_the_same_name_is_not_read(read: Read) -> None:
    table = [[*row, "5", "6", "7"] for row in rows()]
    content = read(text("Loop,Time,PV,OP,SP,PV,F1,F1", table))
    assert content.loops["TIC205"].pv.tolist() == list(range(1000, 1300))
    assert content.loops["TIC205"].others["TIC205.F1"].tolist() == 300 * [6]
    assert content.summary.notes == ("columns beside the signals of the loops were not read: PV, F1",)
    assert content.rejects.total == 0


def test_a_row_of_a_loop_that_lost_a_field(read: Read) -> None:
    table = rows()
    table[4] = [*table[4][:3], *table[4][4:]]
    table[6] = [*table[6][:3], "1", "5", table[6][4]]
    content = read(text("Loop,Time,SP,PV,OP", table))
    assert dict(content.rejects.counts) == {"ragged_row": 2}
    assert [reject.line for reject in content.rejects.listed] == [6, 8]
    assert content.summary.rows_kept == 898


SORTED = ["AUX_1", "FIC101.PV", "FIC101.OP", "TIC5.PV", "TIC5.OP"]


def sorted_by(words: list[str], each: int) -> list[list[str]]:
    return [[f"{FIRST + timedelta(seconds=k)}", word, f"{k}.5"] for word in words for k in range(each)]


@pytest.mark.parametrize("each", [40, 1000])
def test_a_long_table_that_is_sorted_by_tag_under_names_that_are_not_known(read: Read, each: int) -> None:
    table = sorted_by(SORTED, each)
    content = read(text("When,What,HowMuch", table))
    assert content.summary.layout == "long"
    assert (content.loops["FIC101"].samples, content.loops["TIC5"].op is None) == (each, False)
    columns = dict(zip(["When", "What", "HowMuch"], zip(*table, strict=True), strict=True))
    frame = pl.DataFrame(columns).with_columns(pl.col("HowMuch").cast(pl.Float64))
    assert read(parquet(frame)).summary.layout == "long"


@pytest.mark.parametrize("way", [1, -1])
def test_rows_that_are_sorted_by_words_which_are_no_tags_are_not_mixed(read: Read, way: int) -> None:
    with pytest.raises(DataError, match="the column 'What' tells the rows of one time apart"):
        read(text("When,What,HowMuch", sorted_by(["Feed", "Steam", "Air"], 1000)[::way]))


def test_words_that_come_in_turn_do_not_sort_rows(read: Read) -> None:
    table = [[f"{FIRST + timedelta(seconds=k)}", f"shift {k // 500}", f"{k}", "1"] for k in range(3000)]
    content = read(text("When,Crew,FIC1.PV,FIC1.OP", table))
    assert content.loops["FIC1"].pv.tolist() == list(range(3000))


def in_place(place: str, word: bool) -> list[list[str]]:
    if not word:
        return [[place, loop, time, *rest] for loop, time, *rest in rows()]
    return [[place, loop, time, name, pv] for loop, time, pv, *_ in rows() for name in ("PV", "OP")]


@pytest.mark.parametrize("place", ["Asset", "Device", "Element"])
@pytest.mark.parametrize("tag", ["Tag", "Loop", "Controller"])
def test_a_place_of_all_loops_before_the_column_of_loops(read: Read, place: str, tag: str) -> None:
    check(read(text(f"{place},{tag},Time,PV,OP,SP", in_place("Unit-2", word=False))))
    content = read(text(f"{place},{tag},Time,Signal,Value", in_place("PLC1", word=True)))
    assert set(content.loops) == set(OFFSETS)
    assert content.rejects.total == 0


@pytest.mark.parametrize("names", ["Device,Time,PV,OP", "Device,Signal,Time,Value"])
def test_a_place_that_is_the_same_in_all_rows_names_no_loop(read: Read, names: str) -> None:
    table = [
        ["PLC1", word, f"{FIRST + timedelta(seconds=k)}", f"{k}"] if "Signal" in names else
        ["PLC1", f"{FIRST + timedelta(seconds=k)}", f"{k}", f"{k}"]
        for k in range(300)
        for word in (["PV", "OP"] if "Signal" in names else ["PV"])
    ]  # fmt: skip
    content = read(text(names, table), name="FIC7.csv")
    assert content.loops["FIC7"].pv.tolist() == content.loops["FIC7"].op.tolist() == list(range(300))


@pytest.mark.parametrize("each", [100, 3000])
@pytest.mark.parametrize("by_place", [False, True])
def test_places_that_part_rows_of_the_same_times_are_loops(read: Read, each: int, by_place: bool) -> None:
    cells = [(k, place) for k in range(each) for place in ("PLC1", "PLC2")]
    cells = sorted(cells, key=lambda cell: cell[1]) if by_place else cells
    table = [[place, f"{FIRST + timedelta(seconds=k)}", f"{k}", f"{k}"] for k, place in cells]
    content = read(text("Device,Time,PV,OP", table), name="FIC7.csv")
    assert set(content.loops) == {"PLC1", "PLC2"}
    assert content.rejects.total == 0


def test_of_columns_of_loops_the_one_that_parts_the_rows(read: Read) -> None:
    check(read(text("Name,Tag,Time,PV,OP,SP", in_place("Unit 2", word=False))))


def in_words_of(first: str, second: str) -> list[list[str]]:
    return [
        [loop, f"{FIRST + timedelta(seconds=k)}", word, f"{k}"]
        for k in range(300)
        for loop in (first, second)
        for word in ("PV", "OP")
    ]


@pytest.mark.parametrize("loops", [("FIC101", "FIC102"), ("Main", "Hand"), ("A", "B")])
@pytest.mark.parametrize("remark", ["", "# auto"])
def test_loops_that_are_called_as_a_mode_beside_words(read: Read, loops: tuple[str, str], remark: str) -> None:
    table = in_words_of(*loops)
    table.insert(100, [remark, "", "", ""])
    content = read(text("Controller,Time,Signal,Value", table))
    assert set(content.loops) == set(loops)
    assert content.loops[loops[0]].pv.tolist() == list(range(300))


def test_a_word_of_no_signal_further_down_makes_no_loop_unknown(read: Read) -> None:
    table = [
        ["FIC1", f"{FIRST + timedelta(seconds=k)}", word, f"{k}"]
        for start in (0, 500, 1000)
        for word in (["Alarm Text"] if start == 500 else ["PV", "OP"])
        for k in range(start, start + 500)
    ]
    for names in ("Controller,Time,Attribute,Value", "Name,Time,Attribute,Value"):
        loop = read(text(names, table)).loops["FIC1"]
        assert loop.pv is not None
        assert loop.op is not None


def test_batches_that_were_put_together_in_another_order(read: Read) -> None:
    table = [
        [f"{FIRST + timedelta(seconds=k)}", f"{k}", "1", f"{name}-grade"]
        for name, start in zip("ABCD", (200, 0, 100, 300), strict=True)
        for k in range(start, start + 100)
    ]
    assert read(text("Time,FIC1.PV,FIC1.OP,Product", table)).loops["FIC1"].pv.tolist() == list(range(400))


def test_rows_that_fill_holes_of_others(read: Read) -> None:
    later = [k for k in range(300) if k % 100 < 20]
    order = [(k, "live") for k in range(300) if k not in later] + [(k, "stored") for k in later]
    table = [[f"{FIRST + timedelta(seconds=k)}", f"{k}", "1", f"{source} rows"] for k, source in order]
    assert read(text("Time,FIC1.PV,FIC1.OP,Source", table)).loops["FIC1"].pv.tolist() == list(range(300))


def test_the_hour_of_autumn_with_its_zone(read: Read) -> None:
    hours = [(0, "CEST"), (1, "CEST"), (2, "CEST"), (2, "CET"), (3, "CET"), (4, "CET")]
    for told in (hours, hours[1:]):
        table = [[f"2024-10-27 0{h}:{m:02d}:00", zone, f"{m}", "1"] for h, zone in told for m in range(60)]
        content = read(text("Time,Zone,FIC1.PV,FIC1.OP", table), options=IngestOptions(time_zone="Europe/Berlin"))
        assert content.loops["FIC1"].samples == 60 * len(told)


def test_words_of_signals_alone_do_not_mix_what_another_column_parts(read: Read) -> None:
    with pytest.raises(DataError, match="the column 'Skid' tells the rows of one time apart"):
        read(text("Skid,Time,Signal,Value", in_words_of("north", "south")))
    table = [
        [*row[1:], "bar" if row[2] == "PV" else "pct"] for row in in_words_of("north", "south") if row[0] == "north"
    ]
    assert read(text("Time,Signal,Value,UOM", table), name="FIC7.csv").loops["FIC7"].samples == 300


def machines(order: str, late_ms: int, words: tuple[str, str], count: int) -> list[list[str]]:
    """Two machines, sampled at the same times or the second one a little later; a row after the other, sorted by
    machine, or by the part of the day and the machine."""
    cells = [(k, at, word) for k in range(count) for at, word in enumerate(words)]
    keys = {"taking turns": (0, 1), "sorted": (1, 0), "in parts": (2, 1, 0)}[order]
    cells.sort(key=lambda cell: [(*cell[:2], cell[0] * 4 // count)[key] for key in keys])
    stamps = [f"{FIRST + timedelta(seconds=k)}.{at * late_ms:03d}" for k, at, _ in cells]
    return [
        [stamp, word, f"{at * 100 + k % 7}", f"{at * 10 + k % 5}"]
        for stamp, (k, at, word) in zip(stamps, cells, strict=True)
    ]


@in_pairs(
    order=["taking turns", "sorted", "in parts"],
    late_ms=[0, 400],
    words=[("north", "south"), ("M1", "M2")],
    count=[100, 2000],
)
def test_machines_are_not_mixed(read: Read, order: str, late_ms: int, words: tuple[str, str], count: int) -> None:
    table = machines(order, late_ms, words, count)
    with pytest.raises(DataError, match="the column 'Machine' tells the rows of one time apart"):
        read(text("Time,Machine,PV,OP", table))
    assert set(read(text("Time,Device,PV,OP", machines(order, late_ms, ("P-1", "P-2"), count))).loops) == {"P-1", "P-2"}


def test_a_few_rows_of_something_else_behind_all_others_are_not_mixed(read: Read) -> None:
    table = [[f"{FIRST + timedelta(seconds=k)}", "online", f"{k}", "1"] for k in range(600)]
    table += [[f"{FIRST + timedelta(seconds=k)}.500", "lab", f"{k}", "1"] for k in range(0, 600, 60)]
    with pytest.raises(DataError, match="the column 'Method' tells"):
        read(text("Time,Method,PV,OP", table))


LATE = [lambda k: k % 30 == 7, lambda k: k % 3 == 1, lambda k: k % 200 > 150, lambda k: 99 < k < 160]


@in_pairs(late=LATE, count=[300, 600, 3000], way=[1, -1])
def test_what_was_appended_to_fill_holes(read: Read, late: Callable[[int], bool], count: int, way: int) -> None:
    order = sorted(range(count), key=lambda k: (late(k), way * k))
    table = [[f"{FIRST + timedelta(seconds=k)}", f"{k}", "1", "late" if late(k) else "live"] for k in order]
    content = read(text("Time,FIC1.PV,FIC1.OP,Source", table))
    assert content.loops["FIC1"].pv.tolist() == list(range(count))
    assert content.rejects.total == 0


@pytest.mark.parametrize("words", [("raw", "interpolated"), ("GW1", "GW2")])
def test_words_that_take_turns_beside_values_that_go_on(read: Read, words: tuple[str, str]) -> None:
    table = [[f"{FIRST + timedelta(seconds=k)}", f"{k}", "1", words[k % 2]] for k in range(300)]
    assert read(text("Time,FIC1.PV,FIC1.OP,How", table)).loops["FIC1"].pv.tolist() == list(range(300))


@pytest.mark.parametrize("words", [("OPEN", "CLOSED"), ("on", "off"), ("HI", "Normal"), ("RUNNING", "STOPPED")])
def test_states_of_the_process_that_take_turns_with_its_values(read: Read, words: tuple[str, str]) -> None:
    values = [100 * (k % 2) + k % 7 for k in range(300)]
    stamps = [f"{FIRST + timedelta(seconds=k)}" for k in range(300)]
    wide = [[stamps[k], words[k % 2], f"{values[k]}", "1"] for k in range(300)]
    long = [[f"FIC1.{name}", stamps[k], f"{values[k]}", words[k % 2]] for k in range(300) for name in ("PV", "OP")]
    for content in (read(text("Time,State,FIC1.PV,FIC1.OP", wide)), read(text("Tag,Time,Value,State", long))):
        assert content.loops["FIC1"].pv.tolist() == values


@pytest.mark.parametrize("late_ms", [0, 300])
@pytest.mark.parametrize("words", [("north", "south"), ("S1", "S2")])
def test_the_same_tags_of_several_places_are_not_mixed(read: Read, words: tuple[str, str], late_ms: int) -> None:
    table = [
        [words[at], f"FIC1.{word}", f"{FIRST + timedelta(seconds=k)}.{at * late_ms:03d}", f"{k % 5 + 100 * at}"]
        for k in range(200)
        for at in (0, 1)
        for word in ("PV", "OP")
    ]
    with pytest.raises(DataError, match="the column 'Site' tells the rows of one time apart"):
        read(text("Site,Tag,Time,Value", table))
    assert read(text("Site,Tag,Time,Value", [row for row in table if row[0] == words[0]])).loops["FIC1"].samples == 200


def test_several_sums_of_a_tag_and_a_time_are_not_mixed(read: Read) -> None:
    table = [
        [f"FIC1.{word}", f"{FIRST + timedelta(minutes=k)}", kind, f"{k}"]
        for k in range(200)
        for kind in ("Min", "Max", "Avg")
        for word in ("PV", "OP")
    ]
    with pytest.raises(DataError, match="the column 'Aggregate' tells"):
        read(text("Tag,Time,Aggregate,Value", table))
