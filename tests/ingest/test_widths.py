"""Rows that have more fields than names: which value is whose is not known there, so none is read."""

import numpy as np
import pytest

from app.errors import DataError
from app.ingest import IngestOptions, parse_named

from .conftest import Read

MINUTES = [f"2024-03-01 00:0{i}:00" for i in range(5)]


def refusal(read: Read, text: str) -> DataError:
    with pytest.raises(DataError) as refused:
        read(text)
    return refused.value


@pytest.mark.parametrize("more_names", ["", ",", ",,,"])
def test_decimal_commas_between_fields_that_commas_part(read: Read, more_names: str) -> None:
    rows = "".join(f"{stamp},50,00,49,9{i},50,1{i}\n" for i, stamp in enumerate(MINUTES))
    error = refusal(read, f"time,SP,PV,OP{more_names}\n{rows}")
    assert error.code == "more_fields_than_names"
    assert "7 fields ('2024-03-01 00:00:00,50,00,49,90,50,10') below 4 names; it looks like decimal commas" in str(
        error
    )


@pytest.mark.parametrize("decimals", ["{0}", "0{0}"])
def test_decimal_commas_of_one_signal_below_an_empty_name(read: Read, decimals: str) -> None:
    """PV has points, and OP commas: its decimals were read as SP, and SP stood below no name."""
    rows = "".join(f"2024-03-01 00:0{i}:00,5{i}.5,4{i},{decimals.format(i)},50\n" for i in range(10))
    error = refusal(read, f"time,PV,OP,SP,\n{rows}")
    assert error.code == "more_fields_than_names"
    assert "5 fields ('2024-03-01 00:00:00,50.5,40," in str(error)
    assert "it looks like decimal commas" in str(error)


def test_whole_numbers_before_a_column_without_a_name_are_no_decimals(read: Read) -> None:
    rows = "".join(f"2024-03-01 00:0{i}:00,5{i}.5,4{i},5{i % 3},7\n" for i in range(10))
    content = read(f"time,PV,OP,SP,\n{rows}")
    (loop,) = content.loops.values()
    assert loop.sp.tolist() == [50 + i % 3 for i in range(10)]
    assert "columns without a name were not read: column 5" in content.summary.notes


@pytest.mark.parametrize("of", ["00", "0{k3}", "00{k3}", "{k6}"])
@pytest.mark.parametrize("name", ["Shift", "Step", "Batch", ""])
def test_codes_and_steps_behind_whole_numbers_are_no_decimals(read: Read, of: str, name: str) -> None:
    """Such as 07, or a step that lasts: decimals change with the number before them. The file was refused for them."""
    rows = "".join(
        f"2024-03-01 00:{i:02}:00,5{i % 10}.5,{40 + i % 9},{of.format(k3=i // 20, k6=i // 6)},Good\n" for i in range(60)
    )
    content = read(f"time,PV,OP,{name},\n{rows}")
    (loop,) = content.loops.values()
    assert loop.op.tolist() == [40 + i % 9 for i in range(60)]


def test_words_behind_the_only_digits_of_a_signal_are_not_its_values(read: Read) -> None:
    rows = "".join(f"2024-03-01 00:{i:02}:00,{40 + i % 9},{i % 10},Good,5.5\n" for i in range(60))
    (loop,) = read(f"time,PV,OP,Remark,\n{rows}").loops.values()
    assert loop.op.tolist() == [i % 10 for i in range(60)]


@pytest.mark.parametrize("name", ["MODE", "Step", "TI102", ""])
def test_decimals_below_any_other_name_are_refused(read: Read, name: str) -> None:
    rows = "".join(f"2024-03-01 00:{i:02}:00,5{i % 10}.5,{40 + i % 9},{i * 37 % 100:02},1\n" for i in range(60))
    assert refusal(read, f"time,PV,OP,{name},\n{rows}").code == "more_fields_than_names"


def test_long_rows_with_parted_decimals(read: Read) -> None:
    rows = "".join(f"A.PV,{stamp},50,0{i},Good\nA.OP,{stamp},40,1{i},Good\n" for i, stamp in enumerate(MINUTES))
    assert refusal(read, "Tagname,TimeStamp,Value,Quality\n" + rows).code == "more_fields_than_names"
    assert refusal(read, rows).code == "more_fields_than_names"


def test_rows_with_a_field_more_than_names_do_not_move_the_others(read: Read) -> None:
    rows = "".join(f"{stamp},row {i},{i}.5,1{i}\n" for i, stamp in enumerate(MINUTES))
    error = refusal(read, "time,A.PV,A.OP\n" + rows)
    assert error.code == "more_fields_than_names"
    assert "which field belongs to which name is not told" in str(error)


@pytest.mark.parametrize(("above", "below"), [("", ",m3/h,%,m3/h\n"), ("#NAMES\n", "#TYPES\nD,D,D,D\n#ROWS,5\n")])
def test_a_name_that_is_lost_moves_no_others(read: Read, above: str, below: str) -> None:
    """The units had a field to each column, and A.PV was lost: its values were read as those of A.OP."""
    rows = "".join(f"{stamp},{i}.5,1{i},7\n" for i, stamp in enumerate(MINUTES))
    assert refusal(read, f"{above}time,A.OP,A.SP\n{below}{rows}").code == "more_fields_than_names"


def test_some_rows_with_a_field_more(read: Read) -> None:
    rows = [f"{stamp},{i},1{i},\n" for i, stamp in enumerate(MINUTES)]
    rows[3] = f"{MINUTES[3]},3,5,13\n"
    content = read("time,A.PV,A.OP\n" + "".join(rows))
    assert content.loops["A"].op.tolist() == [10, 11, 12, 14]
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(5, "ragged_row")]


@pytest.mark.parametrize("heading", ["time,A.PV,A.OP", "time,A.PV,A.OP,", "time,A.PV,A.OP,,,"])
def test_empty_fields_behind_the_last_name(read: Read, heading: str) -> None:
    rows = "".join(f"{stamp},{i},1{i},,\n" for i, stamp in enumerate(MINUTES))
    content = read(f"{heading}\n{rows}")
    assert content.loops["A"].op.tolist() == [10, 11, 12, 13, 14]
    assert content.rejects.total == 0


def test_a_field_too_many_where_not_all_columns_are_read(read: Read) -> None:
    rows = [f"{stamp},{i},5{i}.5,4{i}.5" for i, stamp in enumerate(MINUTES)]
    rows[1] = f"{MINUTES[1]},1,51,5,41.5"
    content = read("time,id,A.PV,A.OP\n" + "\n".join(rows) + "\n")
    assert content.loops["A"].pv.tolist() == [50.5, 52.5, 53.5, 54.5]
    assert content.loops["A"].op.tolist() == [40.5, 42.5, 43.5, 44.5]
    assert [(reject.line, reject.code, reject.text) for reject in content.rejects.listed] == [
        (3, "ragged_row", rows[1])
    ]


def test_a_lost_field_where_not_all_columns_are_read(read: Read) -> None:
    rows = [f"{stamp},5{i}.5,4{i}.5,{i}" for i, stamp in enumerate(MINUTES)]
    rows[1] = f"{MINUTES[1]},41.5,1"
    content = read("time,A.PV,A.OP,id\n" + "\n".join(rows) + "\n")
    assert content.loops["A"].pv.tolist() == [50.5, 52.5, 53.5, 54.5]
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(3, "ragged_row")]


@pytest.mark.parametrize("remark", ["feed", '"feed, cold"', '"feed ""cold"""', '"feed, ""cold"", raw"'])
def test_a_long_row_with_a_field_too_many_before_columns_that_are_not_read(read: Read, remark: str) -> None:
    rows = [f"A.{signal},{stamp},5{i}.5,t/h,{remark}" for i, stamp in enumerate(MINUTES) for signal in ("PV", "OP")]
    rows[2] = f"A.PV,{MINUTES[1]},51,5,t/h,{remark}"
    rows[6] += ","
    content = read("Tag,Time,Value,Unit,Remark\n" + "\n".join(rows) + "\n")
    assert content.loops["A"].op.tolist() == [50.5, 51.5, 52.5, 53.5, 54.5]
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(4, "ragged_row")]


def test_rows_that_a_spreadsheet_ended_before_empty_cells(read: Read) -> None:
    rows = [f"2024-03-01 00:{i:02d}:00,{i}.5,1{i}.5" + (",start" if i == 0 else "," * (i < 16)) for i in range(48)]
    rows[20] = rows[20].rpartition(",")[0]
    content = read("time,A.PV,A.OP,Comment\n" + "\n".join(rows) + "\n")
    assert content.loops["A"].pv.tolist() == [i + 0.5 for i in range(48) if i != 20]
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(22, "ragged_row")]


@pytest.mark.parametrize("end", ["", "\n", "\r\n"])
def test_a_field_too_many_in_a_table_that_is_asked_for_its_columns(end: str) -> None:
    rows = ["time,PV,Sim,OP", "0,1,1.5,10", "1,2,5,2.5,11", '2,3,"3.5",12,', "3,4,4.5,13"]
    table = parse_named((end or "\n").join(rows) + end, IngestOptions())
    np.testing.assert_array_equal(table.numbers("OP"), [10, np.nan, 12, 13])
    np.testing.assert_array_equal(table.numbers("PV"), [1, np.nan, 3, 4])
    assert table.damage == ("1 row has more fields than there are names, and was left empty",)


HOURS = [f"2024-03-01 {i // 60:02d}:{i % 60:02d}:00" for i in range(240)]


def test_many_rows_that_lost_a_field_are_none_that_end_early(read: Read) -> None:
    rows = [f"{stamp},{i},1{i},2{i},3{i}" if i % 8 else f"{stamp},1{i},2{i},3{i}" for i, stamp in enumerate(HOURS)]
    content = read("time,A.PV,A.OP,B.PV,B.OP\n" + "\n".join(rows) + "\n")
    assert dict(content.rejects.counts) == {"ragged_row": 30}
    assert content.loops["A"].pv.tolist() == [i for i in range(240) if i % 8]


@pytest.mark.parametrize("seldom", [4, 20])
@pytest.mark.parametrize(
    ("names", "row"),
    [
        ("Loop,Signal,Time,Value,Remark", "A,{signal},{stamp},{i}"),
        ("Loop,Time,PV,OP,Remark", "A,{stamp},{i},{i}"),
        ("Tag,Time,Value,Unit,Remark", "A.{signal},{stamp},{i}"),
    ],
)
def test_rows_that_leave_out_what_is_not_read(read: Read, names: str, row: str, seldom: int) -> None:
    left = names.split("Value" if "Value" in names else "OP")[1].count(",")
    rows = [
        row.format(signal=signal, stamp=stamp, i=i) + (",ok" * left if i % seldom else "")
        for i, stamp in enumerate(HOURS)
        for signal in (["PV", "OP"] if "{signal}" in row else ["PV"])
    ]
    content = read(f"{names}\n" + "\n".join(rows) + "\n")
    assert content.rejects.total == 0
    assert content.loops["A"].pv.tolist() == content.loops["A"].op.tolist() == list(range(240))


@pytest.mark.parametrize(("name", "last"), [("Remark", "ok"), ("A.SP", "15")])
def test_most_rows_leave_out_what_stands_last(read: Read, name: str, last: str) -> None:
    rows = [f"{stamp},{i % 7 + 50},{i % 5 + 10}" + (f",{last}" if i % 6 == 0 else "") for i, stamp in enumerate(HOURS)]
    content = read("\n".join((f"time,A.PV,A.OP,{name}", *rows)) + "\n")
    assert content.loops["A"].pv.tolist() == [i % 7 + 50 for i in range(240)]
    assert content.rejects.total == 0


def test_most_rows_lost_a_field_before_the_last(read: Read) -> None:
    """What stands in their place of OP is nothing like OP."""
    rows = [f"{stamp},50," + (f"{i % 5 + 10}," if i % 6 == 0 else "") + "900" for i, stamp in enumerate(HOURS)]
    content = read("\n".join(("time,A.PV,A.OP,A.SP", *rows)) + "\n")
    assert dict(content.rejects.counts) == {"ragged_row": 200}


@pytest.mark.parametrize("remarks", ["Comment", "Bemerkung"])
def test_all_rows_end_before_a_last_name_of_remarks(read: Read, remarks: str) -> None:
    rows = "".join(f"{k}.000000\t{k % 7}.5\t{k % 5 + 50}.25\n" for k in range(40))
    content = read(f"X_Value\tPV\tOP\t{remarks}\n{rows}", name="F1.txt")
    assert content.loops["F1"].pv.tolist() == [k % 7 + 0.5 for k in range(40)]
    assert content.loops["F1"].op.tolist() == [k % 5 + 50.25 for k in range(40)]
    assert content.rejects.total == 0


@pytest.mark.parametrize(
    ("names", "row"),
    [
        ("time,PV,OP,SP", "{k},{k},5"),
        ("time,PV,OP,Comment", "{k},{k},a word"),
        ("time,SP,PV,OP,Comment", "{k},{k}.5,5,"),
        ("date,time,PV,OP,SP,Comment", "2026-03-01 00:00:{k},{k}.5,5,7,"),
        ("time,PV,quality,OP,Comment", "{k},{k}.5,5,"),
        ("time,PV,OP,SP,Comment", "{k},50,{k},5"),
    ],
)
def test_all_rows_lost_a_field_before_the_last(read: Read, names: str, row: str) -> None:
    """Or have the decimals of PV in one of their own."""
    rows = "".join(f"{row.format(k=k)}\n" for k in range(10, 50))
    with pytest.raises(DataError, match="none of 40 rows"):
        read(f"{names}\n{rows}", name="F1.csv")
