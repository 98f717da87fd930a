"""Columns under a number, a date or nothing, as somebody's own column in a spreadsheet or a numeric tag: the others are
read as without them."""

from datetime import datetime, timedelta

import polars as pl
import pytest

from app.errors import DataError
from app.ingest import TagMapping
from app.ingest.columns.plans import WidePlan

from .conftest import Read
from .test_tables import parquet, workbook

FIRST = datetime(2026, 3, 1)
STAMPS = [str(FIRST + timedelta(minutes=k)) for k in range(60)]
PV, OP = [50.25 + k % 7 for k in range(60)], [40.5 + k % 5 for k in range(60)]
NUMBERS = ("123", "0", "1e5", "4711.5", "12 %", "-1")
OTHERS = ("TRUE", "2026-03-01", "2026-03-01 06:00", "12:00")


def wide(names: str, *more: str) -> str:
    rows = (",".join((stamp, f"{pv}", f"{op}", *more)) for stamp, pv, op in zip(STAMPS, PV, OP, strict=True))
    return "\n".join((names, *rows)) + "\n"


@pytest.mark.parametrize("name", [*NUMBERS, *OTHERS])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_column_under_a_number(read: Read, name: str, separator: str) -> None:
    content = read(wide(f"Time,FIC101.PV,FIC101.OP,{name}", "7.5").replace(",", separator))
    assert content.loops["FIC101"].pv.tolist() == PV
    assert content.loops["FIC101"].op.tolist() == OP
    assert (content.summary.tags, content.rejects.total) == (3, 0)


@pytest.mark.parametrize("name", [123.0, "123", 1e5, 0.0])
def test_in_a_workbook(read: Read, name: str | float) -> None:
    names = ["Time", "FIC101.PV", "FIC101.OP", name]
    rows = [[stamp, pv, op, 7.5] for stamp, pv, op in zip(STAMPS, PV, OP, strict=True)]
    content = read(workbook([names, *rows]), name="export.xlsx")
    assert content.loops["FIC101"].pv.tolist() == PV


@pytest.mark.parametrize("name", NUMBERS)
def test_in_parquet(read: Read, name: str) -> None:
    frame = pl.DataFrame({"Time": STAMPS, "FIC101.PV": PV, "FIC101.OP": OP, name: [7.5] * 60})
    content = read(parquet(frame), name="export.parquet")
    assert content.loops["FIC101"].pv.tolist() == PV
    assert content.summary.tags == 3


def test_beside_its_own_loop_and_units(read: Read) -> None:
    content = read(wide("Time,4711.PV,4711.OP,4711\n,t/h,%,1", "7.5"))
    assert content.loops["4711"].pv.tolist() == PV
    assert content.loops["4711"].others["4711"].tolist() == [7.5] * 60


def test_many_of_them(read: Read) -> None:
    spare = [f"{number}" for number in range(500)]
    content = read(wide(",".join(("Time,FIC101.PV,FIC101.OP", *spare)), *["7.5"] * 500))
    assert content.loops["FIC101"].pv.tolist() == PV
    assert content.summary.tags == 502


@pytest.mark.parametrize("times", ["", "Probe"])
def test_where_the_times_have_no_name(read: Read, times: str) -> None:
    content = read(wide(f"{times},FIC101.PV,FIC101.OP,123", "7.5"))
    assert content.loops["FIC101"].pv.tolist() == PV


def test_tags_that_are_numbers_alone_are_told_by_a_mapping(read: Read) -> None:
    mapped = TagMapping.from_bytes(b"tag,loop,signal\n4711,FIC101,PV\n4712,FIC101,OP\n")
    content = read(wide("Time,4711,4712"), mapping=mapped)
    assert content.loops["FIC101"].pv.tolist() == PV
    assert content.loops["FIC101"].op.tolist() == OP


def test_titles_and_limits_with_numbers_are_no_names(read: Read) -> None:
    for above in ("Time,0,100", "Start,2026-03-01,60", "Time,5", "Timestamp,1,2\n,Feed,Valve"):
        content = read(f"{above}\n" + wide("Time,FIC101.PV,FIC101.OP"))
        assert content.loops["FIC101"].pv.tolist() == PV


def test_a_first_row_without_values_is_none_of_names(read: Read) -> None:
    head, *rows = wide("Time,FIC101.PV,FIC101.OP,123", "7.5").splitlines()
    content = read("\n".join((head, f"{STAMPS[0]},Bad,Bad,Bad", *rows[1:])) + "\n")
    assert content.loops["FIC101"].op.tolist()[1:] == OP[1:]


def test_tags_of_two_rows_that_are_numbers(read: Read) -> None:
    rows = (f"{stamp},{pv},{op},{pv + 1},{op + 1}" for stamp, pv, op in zip(STAMPS, PV, OP, strict=True))
    content = read("\n".join((",FIC101,,4711,", "Time,PV,OP,PV,OP", *rows)) + "\n")
    assert content.loops["FIC101"].pv.tolist() == PV
    assert content.loops["4711"].pv.tolist() == [pv + 1 for pv in PV]


@pytest.mark.parametrize(("separator", "empty"), [(",", 1), (",", 3), (";", 1), ("\t", 2)])
def test_last_columns_without_a_name_are_told(read: Read, separator: str, empty: int) -> None:
    content = read(wide("Time,FIC101.PV,FIC101.OP" + "," * empty, *["7.5"] * empty).replace(",", separator))
    assert content.loops["FIC101"].op.tolist() == OP
    shown = ", ".join(f"column {4 + at}" for at in range(empty))
    assert f"columns without a name were not read: {shown}" in content.summary.notes


def test_a_last_column_without_a_name_in_a_long_table(read: Read) -> None:
    own = (("PV", PV), ("OP", OP))
    rows = (f"{stamp},FIC101.{tag},{all_of[k]},7.5" for tag, all_of in own for k, stamp in enumerate(STAMPS))
    content = read("\n".join(("Time,Tag,Value,", *rows)) + "\n")
    assert content.loops["FIC101"].pv.tolist() == PV
    assert "columns beside tag, time and value were not read: column 4" in content.summary.notes


def test_whole_numbers_below_fewer_names_may_be_parted_decimals(read: Read) -> None:
    rows = "".join(f"{stamp},50,{10 + k},40\n" for k, stamp in enumerate(STAMPS))
    with pytest.raises(DataError, match="decimal commas"):
        read(f"Time,FIC101.PV,FIC101.OP,\n{rows}")


SETTINGS = ("Scale,PV,0,100,OP,0,100", "Range,PV,0,OP", "Tag,FIC101.PV,FIC101.OP,2", "Time range,1,FIC101.PV,FIC101.OP")


@pytest.mark.parametrize("above", [*SETTINGS, "Range,PV,OP,100", "Time,FIC101.PV,FIC101.OP,5"])
@pytest.mark.parametrize("times", ["Time", "Timestamp", ""])
def test_settings_above_the_names_are_no_names(read: Read, above: str, times: str) -> None:
    more = above.count(",") == 3 and above not in SETTINGS  # as many cells as the rows
    content = read(f"{above}\n" + wide(f"{times},FIC101.PV,FIC101.OP" + ",TIC2.PV" * more, *["7.5"] * more))
    assert content.loops["FIC101"].pv.tolist() == PV
    assert content.loops["FIC101"].op.tolist() == OP


def test_settings_above_names_that_tell_no_signal(read: Read) -> None:
    content = read("Time,FIC101.PV,5\n" + wide("Time,Flow,Valve"))
    assert content.loops["Flow"].others["Flow"].tolist() == PV


def test_columns_without_a_name_are_looked_for_once_however_many_there_are(
    read: Read, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is read of a plan is worked out from all columns: of 10,000, to ask for each took ten times the file."""
    asked: list[None] = []
    worked_out = WidePlan.read.fget
    monkeypatch.setattr(WidePlan, "read", property(lambda plan: asked.append(None) or worked_out(plan)))
    spare = [f"TIC{number}.PV" for number in range(200)]
    content = read(wide(",".join(("Time,FIC101.PV,FIC101.OP", *spare, "")), *["7.5"] * 201))
    assert "columns without a name were not read: column 204" in content.summary.notes
    assert len(asked) < 20


@pytest.mark.parametrize("names", ["Time,4711", "Zeit;12.5", "Time,4711\n,t/h"])
def test_the_only_tag_of_a_file_is_a_number(read: Read, names: str) -> None:
    """Its row of names was refused as one of data, and the tag called after the file."""
    separator = ";" if ";" in names else ","
    rows = "\n".join(f"{stamp}{separator}{pv}" for stamp, pv in zip(STAMPS, PV, strict=True))
    content = read(f"{names}\n{rows}\n", name="export.csv")
    tag = names.splitlines()[0].split(separator)[1]
    assert (content.rejects.total, content.summary.tags) == (0, 1)
    assert content.summary.loops[0].others == (tag,)


@pytest.mark.parametrize("above", ["Timestamp,123,", "Date,20260701", "Date,20260701\nTime,120000"])
def test_what_names_no_two_columns_leaves_the_tag_to_the_file(read: Read, above: str) -> None:
    """A comma too many above the rows, or when the export was made: as before, the tag is the file's name."""
    rows = "\n".join(f"{stamp},{pv}" for stamp, pv in zip(STAMPS, PV, strict=True))
    content = read(f"{above}\n{rows}\n", name="4712.csv")
    assert content.summary.loops[0].others == ("4712",)
