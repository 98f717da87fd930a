"""Files with a little damage: it costs the rows or fields that have it, and nothing else."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from app.errors import DataError
from app.ingest import IngestOptions

from .conftest import Read
from .test_tables import workbook

START = datetime(2024, 3, 1)
COUNT = 40
STAMPS = [str(START + timedelta(seconds=10 * i)) for i in range(COUNT)]
WIDE = ["DateTime,A.PV,A.OP", *(f"{stamp},{i + 0.125},{50 + i}" for i, stamp in enumerate(STAMPS))]
BARE = [
    f"{stamp},A.{word},{i + at},float,GOOD" for i, stamp in enumerate(STAMPS) for at, word in ((0.5, "PV"), (50, "OP"))
]


def text(lines: list[str]) -> str:
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("stamp", ["2024-03-01T00:00:00Z", "2024-03-01T00:00:00", "01.03.2024 00:00:00"])
def test_a_first_stamp_in_another_writing_costs_its_row(read: Read, stamp: str) -> None:
    content = read(text([WIDE[0], stamp + WIDE[1][19:], *WIDE[2:]]))
    assert content.loops["A"].pv.tolist() == [i + 0.125 for i in range(1, COUNT)]
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(2, "bad_time")]


@pytest.mark.parametrize("hole", [512, 4096])
def test_a_hole_that_a_lost_power_left_costs_its_row(read: Read, hole: int) -> None:
    content = read(text([*WIDE[:20], "\0" * hole, *WIDE[21:]]))
    assert content.loops["A"].samples == COUNT - 1
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(21, "ragged_row")]


def test_byte_order_marks_inside_name_no_other_tag(read: Read) -> None:
    """Files that were put behind one another each begin with one."""
    content = read(text(BARE[:20]) + "\ufeff" + text(BARE[20:-1]) + "\ufeff" + BARE[-1])
    assert list(content.loops) == ["A"]
    assert content.loops["A"].samples == COUNT
    assert content.rejects.total == 0


def test_a_byte_that_is_no_letter_leaves_the_others(read: Read) -> None:
    names = "Zeit;Füllstand Behälter.PV;Füllstand Behälter.OP"
    rows = text([line.replace(",", ";") for line in WIDE[1:]]).encode()
    content = read(names.encode() + b"\n" + rows.replace(b"50", b"\xff0", 1))
    assert list(content.loops) == ["Füllstand Behälter"]
    assert dict(content.rejects.counts) == {"not_a_number": 1}


@pytest.mark.parametrize("row", ["2024-03-01 00:06:30,A", "2024-03-01 00:06:30,A.PV3.5,float,GOOD"])
def test_a_row_of_a_long_table_that_lost_a_field_is_of_no_tag(read: Read, row: str) -> None:
    content = read(text([*BARE[:-1], row]))
    assert [loop.loop for loop in content.summary.loops] == ["A"]
    assert content.summary.tags == 2
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(2 * COUNT, "ragged_row")]


@pytest.mark.parametrize("bad", [(), (300,), (0,), (0, 1), (0, 1, 300)])
def test_a_quality_that_is_given_where_it_is_bad_may_be_left_out_elsewhere(read: Read, bad: tuple[int, ...]) -> None:
    rows = [
        f"A.{word},{START + timedelta(seconds=10 * i)},{i + at},bar" + ",Bad" * (i in bad)
        for i in range(400)
        for at, word in ((0.5, "PV"), (50, "OP"))
    ]
    content = read(text(["Tag,Time,Value,Unit,Status", *rows]))
    assert content.loops["A"].samples == 400
    assert np.flatnonzero(np.isnan(content.loops["A"].pv)).tolist() == list(bad)
    assert dict(content.rejects.counts) == ({"bad_quality": 2 * len(bad)} if bad else {})


@pytest.mark.parametrize("at", [0, 30])
@pytest.mark.parametrize(
    "row",
    ["V,3.5,float,GOOD", "t,GOOD", ",float,GOOD", "2024-03-01 00:06:30,3.5,float,GOOD", "# a note, of two fields"],
)
def test_a_spoiled_row_hides_no_table_without_names(read: Read, row: str, at: int) -> None:
    content = read(text([*BARE[:at], row, *BARE[at:]]))
    assert content.summary.layout == "long_bare"
    assert content.loops["A"].pv.tolist() == [i + 0.5 for i in range(COUNT)]
    assert dict(content.rejects.counts) == ({} if row.startswith("#") else {"ragged_row": 1})


def test_a_comment_that_has_names_is_none(read: Read) -> None:
    rows = [f"{stamp},{i}" for i, stamp in enumerate(STAMPS)]
    assert list(read(text(["#time,A.PV", *rows]), name="B.PV.csv").loops) == ["A"]
    assert list(read(text(["# of A.PV", *rows]), name="B.PV.csv").loops) == ["B"]


def test_a_field_too_many_leaves_the_qualities_what_they_are(read: Read) -> None:
    rows = [*BARE[:10], BARE[10].replace(",A", ",,A"), BARE[11].replace("GOOD", "BAD"), *BARE[12:]]
    content = read(text(rows))
    assert dict(content.rejects.counts) == {"ragged_row": 1, "bad_quality": 1}


@pytest.mark.parametrize("chunk_bytes", [200, 1 << 20])
@pytest.mark.parametrize("between", [", ", ",   ", " ,", " , "])
def test_blanks_between_quotes_and_commas(read: Read, between: str, chunk_bytes: int) -> None:
    lines = [between.join(f'"{field}"' for field in line.split(",")) for line in WIDE]
    content = read(text(lines), options=IngestOptions(chunk_bytes=chunk_bytes))
    assert content.loops["A"].op.tolist() == [50 + i for i in range(COUNT)]
    assert content.rejects.total == 0


def test_blank_rows_below_the_names_are_no_heading_of_four_rows(read: Read) -> None:
    names = "DateTime,TagName,Value,Quality,OPCQuality,wwTagKey"
    rows = [f"{stamp},{tag},{i},0,192,1" for i, stamp in enumerate(STAMPS) for tag in ("A.PV", "A.OP")]
    content = read(text([names, *[",,,,,"] * 3, *rows]))
    assert content.summary.layout == "aveva"
    assert list(content.loops) == ["A"]


@pytest.mark.parametrize("fields", ["{0} 1.5 {0}50 {0} 7", "{0} 1.5 {0}  50 {0} 7"])
def test_a_spoiled_first_row_hides_no_groups_of_times_and_values(read: Read, fields: str) -> None:
    stamps = [(START + timedelta(seconds=10 * i)).strftime("%d-%b-%y_%H:%M:%S") for i in range(COUNT)]
    rows = [f"{stamp} {i + 0.5} {stamp} {50 + i} {stamp} 7" for i, stamp in enumerate(stamps)]
    lines = ["A.PV  A.OP  A.SP ", fields.format(stamps[0]), *rows[1:]]
    content = read(text(lines).replace(" ", "\t").replace("_", " "))
    assert content.summary.layout == "pi_datalink"
    assert content.loops["A"].pv.tolist() == [i + 0.5 for i in range(1, COUNT)]
    assert dict(content.rejects.counts) == {"ragged_row": 1}


@pytest.mark.parametrize("long", [False, True])
def test_a_number_in_another_writing_does_not_change_the_others_of_its_tag(read: Read, long: bool) -> None:
    """All of them have three decimals, which could be parted thousands as well: 257,176 was 257176."""
    values = [f"257,{i + 101}" for i in range(COUNT)]
    values[20] = "1,234.5"
    rows = [f"{stamp};{values[i]};{i},5" for i, stamp in enumerate(STAMPS)]
    if long:
        rows = [
            f"A.{word};{row.split(';')[0]};{row.split(';')[at]}" for row in rows for at, word in ((1, "PV"), (2, "OP"))
        ]
    content = read(text(["Tagname;TimeStamp;Value" if long else "Zeit;A.PV;A.OP", *rows]))
    kept = [257 + (i + 101) / 1000 if i != 20 else np.nan for i in range(COUNT)]
    np.testing.assert_allclose(content.loops["A"].pv, kept)
    assert dict(content.rejects.counts) == {"not_a_number": 1}


@pytest.mark.parametrize(("field", "number"), [("–1.5", -1.5), ("−1.5", -1.5), ("1.5\u00a0", 1.5), ("\u202f1.5", 1.5)])
def test_dashes_and_blanks_of_typesetters(read: Read, field: str, number: float) -> None:
    assert read(text([*WIDE[:-1], f"{STAMPS[-1]},{field},1"])).loops["A"].pv[-1] == number


def test_a_hole_makes_no_text_of_what_is_binary(read: Read) -> None:
    with pytest.raises(DataError, match="binary"):
        read(b"\x7fELF" + bytes(4000))


def test_names_in_cells_of_several_lines(read: Read) -> None:
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    rows = [[stamp, float(i), 50.0 + i] for i, stamp in enumerate(STAMPS)]
    content = read(workbook([["DateTime", "A.PV\nm3/h", "A.OP\n%"], *rows]), name="night.xlsx")
    assert content.loops["A"].pv.tolist() == list(range(COUNT))


@pytest.mark.parametrize(
    "spoiled", ["0/12/24 08:00:00", "3/12/24 08:00:00", "03/22/24 08:00:00", "22/12/24 08:00:00", "03/12/2 08:00:00"]
)
def test_a_spoiled_date_does_not_tell_the_order_of_all(read: Read, spoiled: str) -> None:
    """The first one was a year alone, and all were read as of December 2003."""
    stamps = [f"03/12/24 08:{i // 60:02}:{i % 60:02}" for i in range(200)]
    whole = read(text(["Time,A.PV,A.OP", *(f"{stamp},{i},1" for i, stamp in enumerate(stamps))]))
    stamps[100] = spoiled
    content = read(text(["Time,A.PV,A.OP", *(f"{stamp},{i},1" for i, stamp in enumerate(stamps))]))
    assert content.summary.time_format == whole.summary.time_format
    assert np.isin(whole.loops["A"].time_ns, content.loops["A"].time_ns).sum() == 199


def test_two_rows_in_one_line_make_no_group_of_their_own(read: Read) -> None:
    stamps = [(START + timedelta(seconds=10 * i)).strftime("%d-%b-%y %H:%M:%S") for i in range(COUNT)]
    rows = [f"{stamp}\t{i}\t{stamp}\t{50 + i}" for i, stamp in enumerate(stamps)]
    content = read(text(["A.PV\t\tA.OP\t", *rows[:9], rows[9] + "\t" + rows[10], *rows[11:]]))
    assert list(content.loops) == ["A"]
    assert dict(content.rejects.counts) == {"ragged_row": 1}


def test_a_line_that_tells_a_spreadsheet_the_delimiter_names_nothing(read: Read) -> None:
    assert read(text(["sep=,", *BARE])).loops["A"].samples == COUNT
    rows = [f"{stamp},{i}" for i, stamp in enumerate(STAMPS)]
    assert read(text(['"sep=,"', *rows]), name="B.PV.csv").loops["B"].samples == COUNT
    groups = [f"{stamp}\t{i}\t{stamp}\t{50 + i}" for i, stamp in enumerate(STAMPS)]
    assert list(read(text(["sep=\t", "A.PV\t\tA.OP\t", *groups])).loops) == ["A"]


def test_blank_lines_above_the_heading_of_a_loop_monitor(read: Read) -> None:
    heading = [
        "PROCESSDATA\tA Data",
        f"8\t10\t{STAMPS[0]}\t40",
        "tagname\tA.MV\tA.PV\tbOpOFL\tbPvOFL",
        "desc",
        "fsMax=1",
    ]
    rows = [f"{stamp}\t{50 + i}\t{i}\t0\t{int(i == 3)}" for i, stamp in enumerate(STAMPS)]
    content = read(text(["", "", *heading, *rows]))
    assert content.summary.layout == "dcs_tab"
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(11, "off_line")]


@pytest.mark.parametrize("field", ["", "Bad"])
def test_a_loop_that_lost_its_values_is_told(read: Read, field: str) -> None:
    content = read(text([*WIDE[:1], *(f"{stamp},{field},{i}" for i, stamp in enumerate(STAMPS))]))
    assert "columns that hold no number were left out: A.PV" in content.summary.notes


@pytest.mark.parametrize("cell", ["pump off", 7.0])
def test_a_stray_cell_beside_groups_of_times_and_values(read: Read, cell: str | float) -> None:
    """Cells have no row too long that would tell: no value was read."""
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    stamps = [str(START + timedelta(seconds=10 * i)) for i in range(100)]
    rows: list[list[str | float]] = [[at, float(i), at, 50.0 + i] for i, at in enumerate(stamps)]
    rows[8].append(cell)
    content = read(workbook([["A.PV", "", "A.OP", ""], *rows]), name="night.xlsx")
    assert content.summary.layout == "pi_datalink"
    assert content.loops["A"].op.tolist() == [50.0 + i for i in range(100)]
