"""What is said of files of no known layout, and what is to be sent instead."""

from collections.abc import Callable

import pytest

from app.errors import DataError

from .conftest import Read


def clock(k: int) -> str:
    return f"06:{k // 60:02d}:{k % 60:02d}"


@pytest.mark.parametrize("heading", ["DATE TIME FIC1.PV FIC1.OP", "   DATE      TIME      FIC1.PV    FIC1.OP", ""])
def test_fields_parted_by_blanks_alone(read: Read, heading: str) -> None:
    rows = "\n".join(f"01/31/24  {clock(k)}   {50 + k % 9}.5   {30 + k % 7}" for k in range(90))
    with pytest.raises(DataError, match=r"parted by blanks alone, .* needed are commas, semicolons or tabs") as refused:
        read(f"{heading}\n{rows}\n", "trend.txt")
    assert refused.value.code == "unknown_layout"


def test_words_in_one_column_are_no_such_fields(read: Read) -> None:
    with pytest.raises(DataError, match="no column of times"):
        read("\n".join(f"remark {k} of the shift" for k in range(90)))


@pytest.mark.parametrize("time", [clock, lambda k: f"{clock(k)}.250", lambda k: f"{clock(k)[:5]} AM"])
def test_clocks_without_a_date(read: Read, time: Callable[[int], str]) -> None:
    rows = "\n".join(f"{time(k)},{50 + k % 9},{30 + k % 7}" for k in range(90))
    with pytest.raises(DataError, match="a clock without a date; needed is the date beside it"):
        read(f"Time,FIC1.PV,FIC1.OP\n{rows}\n")
