"""PI DataLink: each tag with its own times, whatever stands between the groups of columns."""

import numpy as np
import pytest

from .conftest import Read
from .test_tables import workbook

START = np.datetime64("2026-03-01T22:00:00", "ns").astype(np.int64)
STEP = 10 * 10**9


def stamp(i: int, minutes: int = 0) -> str:
    return str(np.datetime64("2026-03-01T22:00:00") + np.timedelta64(10 * i + 60 * minutes, "s")).replace("T", " ")


def table(head: str, row: str, n: int = 30) -> str:
    rows = (row.format(t=stamp(i), u=stamp(i, -2), i=i, q="Bad" if i == 7 else "Good") for i in range(n))
    return "\n".join((head, *rows)) + "\n"


SHAPES = [
    ("Time,A.PV,Status,Time,A.OP,Status", "{t},{i}.5,{q},{u},{i},Good"),
    ("A.PV,,,A.OP,\nTime,Value,,Time,Value", "{t},{i}.5,,{u},{i}"),
    ("A.PV,,,A.OP,,\nTime,Value,Status,Time,Value,Status", "{t},{i}.5,{q},{u},{i},Good"),
    (",A.PV,,A.OP", "{t},{i}.5,{u},{i}"),
    ("Time,A.PV,,,Time,A.OP", "{t},{i}.5,,,{u},{i}"),
]


@pytest.mark.parametrize(("head", "row"), SHAPES)
def test_each_tag_keeps_its_times(read: Read, head: str, row: str) -> None:
    content = read(table(head, row))
    assert content.summary.layout == "pi_datalink"
    loop = content.loops["A"]
    bad = [7] if "{q}" in row else []
    assert dict(content.rejects.counts) == ({"bad_quality": 1} if bad else {})
    given = np.flatnonzero(np.isfinite(loop.pv))
    rows = [i for i in range(30) if i not in bad]
    np.testing.assert_array_equal((loop.time_ns[given] - START) // STEP, rows)
    np.testing.assert_array_equal(loop.pv[given], np.array(rows) + 0.5)
    given = np.flatnonzero(np.isfinite(loop.op))
    np.testing.assert_array_equal((loop.time_ns[given] - START) // STEP, np.arange(30) - 12)
    np.testing.assert_array_equal(loop.op[given], np.arange(30))


def test_a_workbook_with_a_blank_column(read: Read) -> None:
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    cells = [[stamp(i), f"{i}.5", "", stamp(i, -2), f"{i}"] for i in range(30)]
    sheet = [["A.PV", "", "", "A.OP", ""], ["Time", "Value", "", "Time", "Value"], *cells]
    loop = read(workbook(sheet), name="night.xlsx").loops["A"]
    assert loop.time_ns[0] == START - 12 * STEP


def test_several_values_of_one_time(read: Read) -> None:
    content = read(table("Time,A.PV,A.OP,Time,B.PV,B.OP", "{t},{i}.5,{i},{u},{i}.25,{i}"))
    assert content.loops["A"].time_ns[0] == START
    assert content.loops["B"].time_ns[0] == START - 12 * STEP
    np.testing.assert_array_equal(content.loops["B"].pv, np.arange(30) + 0.25)


def test_another_column_of_times_is_not_that_of_the_values_behind_it(read: Read) -> None:
    loop = read(table("Time,A.PV,LastAlarm,A.OP,A.SP", "{t},{i}.5,{u},{i},50")).loops["A"]
    assert loop.time_ns[0] == START
    np.testing.assert_array_equal(loop.op, np.arange(30))


def test_numbers_with_units_are_no_times(read: Read) -> None:
    assert read(table("Time,A.PV,A.OP", "{t},{i}.5 bar,{i} %")).summary.layout == "wide"


def uneven(lengths: dict[str, int]) -> str:
    """As Excel writes it: of rows whose last cells are empty, some with their commas and most without."""
    rows = [",,".join(lengths) + ","]
    for i in range(max(lengths.values())):
        cells = [f"{stamp(i, k)},{i}.{k}" if i < n else "," for k, n in enumerate(lengths.values())]
        row = ",".join(cells)
        rows.append(row if i % 16 == 0 else row.rstrip(","))
    return "\n".join(rows) + "\n"


@pytest.mark.parametrize(
    "lengths",
    [{"A.PV": 600, "A.OP": 40}, {"A.PV": 40, "A.OP": 600}, {"A.PV": 600, "A.OP": 300, "A.SP": 20}],
)
def test_groups_of_different_lengths_without_the_commas_behind_them(read: Read, lengths: dict[str, int]) -> None:
    content = read(uneven(lengths))
    assert content.summary.layout == "pi_datalink"
    assert content.rejects.total == 0
    assert content.summary.values_kept == sum(lengths.values())
    loop = content.loops["A"]
    given = np.isfinite(loop.pv)
    assert loop.pv[given].tolist() == list(range(lengths["A.PV"]))
    np.testing.assert_array_equal((loop.time_ns[given] - START) // STEP, range(lengths["A.PV"]))


def test_a_row_that_ends_inside_of_a_group_is_ragged(read: Read) -> None:
    lines = uneven({"A.PV": 60, "A.OP": 60}).splitlines()
    lines[20] = lines[20].rpartition(",")[0]
    content = read("\n".join(lines) + "\n")
    assert dict(content.rejects.counts) == {"ragged_row": 1}
    assert content.summary.values_kept == 118


@pytest.mark.parametrize("more", [",", ",x", ",,,x"])
def test_one_row_with_more_fields_leaves_the_others(read: Read, more: str) -> None:
    lines = table("Time,A.PV,Time,A.OP", "{t},{i}.5,{u},{i}").splitlines()
    lines[9] += more
    content = read("\n".join(lines) + "\n")
    assert content.summary.layout == "pi_datalink"
    assert content.rejects.total == (more != ",")
    assert content.summary.values_kept == 60 - 2 * (more != ",")


def test_a_row_may_end_behind_an_empty_value_of_the_last_group(read: Read) -> None:
    lines = table("Time,A.PV,,Time,A.OP,,", "{t},{i}.5,,{u},{i},,").splitlines()
    lines[9] = f"{stamp(8)},8.5,,{stamp(8, -2)},"
    content = read("\n".join(lines) + "\n")
    assert content.rejects.total == 0
    assert content.summary.values_kept == 59


def test_the_last_value_of_a_group_may_be_in_a_few_rows(read: Read) -> None:
    lines = table("Time,A.PV,Time,A.OP,A.SP", "{t},{i}.5,{u},{i}").splitlines()
    lines[9] += ",50"
    assert np.nansum(read("\n".join(lines) + "\n").loops["A"].sp) == 50


TAGS = ["FIC-101.PV,,FIC-101.OP,,PIC-202.PV,,PIC-202.OP,", ",FIC-101.PV,,FIC-101.OP,,PIC-202.PV,,PIC-202.OP"]
ABOVE = [
    ["Night report 27-Nov-26"],
    ["Night report,,,,,,,", ""],
    ["Server:,PISRV01,,,,,,"],
    ["27-Nov-26 06:00:00,,,,,,,", ""],
    ["PI DataLink Compressed Data", "Start time:,10-Mar-26 00:00:00,End time:,11-Mar-26 00:00:00,,,,"],
    ["Feed flow,,Feed valve,,Header pressure,,Vent valve,"],
    ["Night report,,,,,,,", "Feed flow,,Feed valve,,Header pressure,,Vent valve,"],
]
PAIRS = ",".join(["{t},{i}.5"] * 4)


@pytest.mark.parametrize("tags", TAGS)
@pytest.mark.parametrize("above", ABOVE, ids=lambda rows: rows[-1][:12])
def test_titles_and_descriptions_above_the_tags(read: Read, above: list[str], tags: str) -> None:
    content = read(table("\n".join((*above, tags)), PAIRS))
    assert content.summary.layout == "pi_datalink"
    assert list(content.loops) == ["FIC-101", "PIC-202"]
    assert all(loop.pv is not None and loop.op is not None for loop in content.loops.values())
    assert not content.summary.notes


def test_what_stands_below_the_tags_names_nothing(read: Read) -> None:
    for below in ("Feed flow,,Feed valve,,Header pressure,,Vent valve,", "t/h,,%,,bar,,%,", "m3/h,,m3/h,,m3/h,,m3/h,"):
        assert list(read(table(f"{TAGS[0]}\n{below}", PAIRS)).loops) == ["FIC-101", "PIC-202"]


def test_a_title_above_the_tags_of_a_workbook(read: Read) -> None:
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    cells = [[stamp(i), f"{i}.5", stamp(i, -2), f"{i}"] for i in range(30)]
    sheet = [["Night report", "", "", ""], ["", "", "", ""], ["A.PV", "", "A.OP", ""], *cells]
    assert list(read(workbook(sheet), name="night.xlsx").loops) == ["A"]


def test_names_without_numbers_below_a_title_or_descriptions(read: Read) -> None:
    loops = read(table("Server:,PISRV01,,\nFeed,,Valve,", "{t},{i}.5,{t},{i}")).summary.loops
    assert [loop.loop for loop in loops] == ["Feed", "Valve"]
    loops = read(table("Flow1,,Valve1,\nFeed.PV,,Feed.OP,", "{t},{i}.5,{t},{i}")).summary.loops
    assert [(loop.loop, loop.pv, loop.op) for loop in loops] == [("Feed", "Feed.PV", "Feed.OP")]


TWO_PAIRS = [f"31.01.2024 06:00:{k:02d};{k % 9},5;31.01.2024 06:00:{k:02d};{k % 7},5" for k in range(40)]


def assert_both_are_read(read: Read, names: str) -> None:
    content = read("\n".join((names, *TWO_PAIRS)))
    loop = content.loops["FIC101"]
    assert loop.pv is not None
    assert loop.op is not None
    assert (loop.pv[8], loop.op[8]) == (8.5, 1.5)


@pytest.mark.parametrize(
    "names",
    [
        "FIC101_PV Time;FIC101_PV ValueY;FIC101_OP Time;FIC101_OP ValueY",
        "FIC101.PV Time;FIC101.PV;FIC101.OP Time;FIC101.OP",
        "FIC101.PV_Timestamp;FIC101.PV_Value;FIC101.OP_Timestamp;FIC101.OP_Value",
    ],
)
def test_tags_stand_before_the_words_of_time_and_value(read: Read, names: str) -> None:
    assert_both_are_read(read, names)


def test_a_time_of_another_name_leaves_the_tag_beside_it(read: Read) -> None:
    content = read("\n".join(("Time;FIC101.PV;Time;FIC101.OP", *TWO_PAIRS)))
    assert content.loops["FIC101"].op is not None


@pytest.mark.parametrize(
    "names",
    [
        "FIC101 Time;FIC101 PV;FIC101 Time;FIC101 OP",
        "FIC101.Time;FIC101.PV;FIC101.Time;FIC101.OP",
        "FIC1 Time;FIC101.PV;FIC1 Time;FIC101.OP",
    ],
)
def test_a_signal_beside_a_time_of_its_loop_keeps_its_name(read: Read, names: str) -> None:
    assert_both_are_read(read, names)


def test_a_unit_behind_the_value_stays_in_its_name(read: Read) -> None:
    content = read("\n".join(("FIC1.PV Time;FIC1.PV (t/h);FIC1.OP Time;FIC1.OP (%)", *TWO_PAIRS)))
    assert [(loop.loop, loop.pv, loop.op) for loop in content.summary.loops] == [
        ("FIC1", "FIC1.PV (t/h)", "FIC1.OP (%)")
    ]


@pytest.mark.parametrize("above", ["X axis", "Uhrzeit X-Achse", "Sampled"])
def test_what_stands_above_each_of_the_times_is_no_tag(read: Read, above: str) -> None:
    content = read(table(f"{above},A.PV,{above},A.OP", "{t},{i}.5,{u},{i}"))
    loop = content.loops["A"]
    assert (loop.pv is not None, loop.op is not None) == (True, True)


@pytest.mark.parametrize("below", ["", "Time,Value,Time,Value,Time,Value\n"])
@pytest.mark.parametrize("loops", [("FIC1", "FIC1", "FIC1"), ("FIC1", "FIC1", "TIC2")])
def test_the_loop_stands_above_the_times_and_the_signal_above_the_values(
    read: Read, below: str, loops: tuple[str, ...]
) -> None:
    names = ",".join(f"{loop},{word}" for loop, word in zip(loops, ("PV", "OP", "SP"), strict=True))
    rows = "".join(f"{stamp(i)},{i},{stamp(i)},{i + 40},{stamp(i)},50\n" for i in range(30))
    content = read(f"{names}\n{below}{rows}")
    assert content.loops["FIC1"].pv.tolist() == list(range(30))
    assert content.loops["FIC1"].op.tolist() == list(range(40, 70))
    assert (content.loops["FIC1"].sp is None) == (loops[2] != "FIC1")


def test_numbered_times_are_no_loops(read: Read) -> None:
    rows = "".join(f"{stamp(i)},{i},{stamp(i)},{i + 40}\n" for i in range(30))
    assert read(f"t1,PV,t2,OP\n{rows}", name="LIC7.csv").loops["LIC7"].op.tolist() == list(range(40, 70))
