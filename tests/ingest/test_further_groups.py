"""Rows that hold several tags, each with a value, are not read as those of the first one."""

import pytest

from app.errors import DataError

from .conftest import Read

STAMPS = [f"2026-03-01 00:{i:02d}:00" for i in range(60)]


def table(names: str, row: str) -> str:
    rows = (row.format(t=stamp, pv=f"5{i % 7}.{i % 10}1", op=f"4{i % 5}.{i % 9}1") for i, stamp in enumerate(STAMPS))
    return "\n".join((*([names] if names else []), *rows, ""))


@pytest.mark.parametrize(
    ("names", "row", "columns"),
    [
        ("Time,Tag,Signal,Value,Tag,Signal,Value", "{t},FIC1,PV,{pv},FIC1,OP,{op}", "5 and 7"),
        ("Time,Tag,Value,Tag,Value", "{t},FIC1.PV,{pv},FIC1.OP,{op}", "4 and 5"),
        ("Time,Tag,Value,Time,Tag,Value", "{t},FIC1.PV,{pv},{t},FIC1.OP,{op}", "5 and 6"),
        ("Tag,Time,Value,Quality,Tag,Time,Value,Quality", "FIC1.PV,{t},{pv},Good,FIC1.OP,{t},{op},Good", "5 and 7"),
        ("", "{t},FIC1.PV,{pv},FIC1.OP,{op}", "4 and 5"),
        ("", "FIC1.PV,{t},{pv},FIC1.OP,{t},{op}", "4 and 6"),
    ],
)
def test_further_tags_of_a_row_are_refused_by_name(read: Read, names: str, row: str, columns: str) -> None:
    with pytest.raises(DataError, match=f"columns {columns} have a further one") as error:
        read(table(names, row))
    assert error.value.code == "unknown_layout"


@pytest.mark.parametrize(
    ("names", "row"),
    [
        ("Time,Tag,Value,Tag,Description", "{t},FIC1.PV,{pv},FIC1.PV,Feed"),
        ("Time,Tag,Value,Value", "{t},FIC1.PV,{pv},{op}"),
        ("Time,Tag,Value,Tag,Value", "{t},FIC1.PV,{pv},,"),
        ("", "{t},FIC1.PV,{pv},Feed PV,3"),
    ],
)
def test_what_else_stands_beside_a_value_is_passed_over(read: Read, names: str, row: str) -> None:
    content = read(table(names, row))
    assert content.loops["FIC1"].samples == len(STAMPS)


@pytest.mark.parametrize(
    "row",
    [
        "{t},FIC1.PV,{pv},FT101 PV,0.5",
        "{t},FIC1.PV,{pv},FIC1.SP,80.5",
        "FIC1.PV,{t},{pv},Good,PV,1.5",
    ],
)
def test_what_does_not_move_is_no_further_value(read: Read, row: str) -> None:
    content = read(table("", row))
    assert content.loops["FIC1"].samples == len(STAMPS)
    assert "were not read" in " ".join(content.summary.notes)
