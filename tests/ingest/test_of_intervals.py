"""Columns that hold what values were at least, at most or on average in an interval, as recorders export them."""

import pytest

from .conftest import Read


def table(*names: str) -> str:
    rows = (f"14/06/2014 10:{k // 60:02d}:{k % 60:02d},{k % 9}.5,{k % 7}.5" for k in range(90))
    return "\n".join((f"Time,{','.join(names)}", *rows)) + "\n"


@pytest.mark.parametrize("names", [("FIC1.PV Min", "FIC1.PV Max"), ("FIC1_PV_AVG", "FIC1_OP_AVG"), ("TT (Max)", "TT")])
def test_samples_are_asked_for(read: Read, names: tuple[str, str]) -> None:
    told = [note for note in read(table(*names)).summary.notes if "needed are the samples themselves" in note]
    assert len(told) == 1


@pytest.mark.parametrize("names", [("FIC1.PV", "FIC1.OP"), ("TCLIMAX", "T2"), ("FIC1.PV", "FIC1.PV Max")])
def test_they_are_not_where_there_are_some(read: Read, names: tuple[str, str]) -> None:
    assert not [note for note in read(table(*names)).summary.notes if "needed are the samples themselves" in note]
