"""Rows that have more fields than names: which value is whose is not known there, so none is read."""

import pytest

from app.errors import DataError

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


def test_long_rows_with_parted_decimals(read: Read) -> None:
    rows = "".join(f"A.PV,{stamp},50,0{i},Good\nA.OP,{stamp},40,1{i},Good\n" for i, stamp in enumerate(MINUTES))
    assert refusal(read, "Tagname,TimeStamp,Value,Quality\n" + rows).code == "more_fields_than_names"
    assert refusal(read, rows).code == "more_fields_than_names"


def test_rows_with_a_field_more_than_names_do_not_move_the_others(read: Read) -> None:
    rows = "".join(f"{stamp},row {i},{i}.5,1{i}\n" for i, stamp in enumerate(MINUTES))
    error = refusal(read, "time,A.PV,A.OP\n" + rows)
    assert error.code == "more_fields_than_names"
    assert "which field belongs to which name is not told" in str(error)


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
