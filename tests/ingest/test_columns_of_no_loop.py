"""Columns in which databases count rows, tags or series are no loops; properties beside objects are signals."""

from collections.abc import Callable

import pytest

from app.errors import DataError
from tests.ingest.conftest import Content, Read

ROWS = 60


def pv(k: int) -> str:
    return f"{50 + k % 9}.25"


def op(k: int) -> str:
    return f"{40 + k % 7}.5"


def at(k: int) -> str:
    return f"2024-05-01T00:00:{k:02d}Z"


def check(content: Content, *loops: str) -> None:
    assert list(content.loops) == list(loops)
    for samples in content.loops.values():
        assert samples.pv is not None
        assert samples.op is not None
        assert samples.pv.tolist() == [float(pv(k)) for k in range(ROWS)]
        assert samples.op.tolist() == [float(op(k)) for k in range(ROWS)]
        assert not samples.others
    assert not content.rejects.counts


def table(names: str, row: Callable[[int], str], rows: int = ROWS) -> str:
    return "\n".join((names, *map(row, range(rows)))) + "\n"


@pytest.mark.parametrize("name", ["flow_data_ndx", "GROUP_TABLE_NDX", "FIC101_PV_NUMERICID", "x.FIC101_OP_NumericID"])
def test_the_number_of_a_row_or_a_tag(read: Read, name: str) -> None:
    check(read(table(f"t_stamp,FIC1.PV,FIC1.OP,{name}", lambda k: f"{at(k)},{pv(k)},{op(k)},{k + 1}")), "FIC1")
    check(read(table(f"{name};FIC1.PV;FIC1.OP;t_stamp", lambda k: f"{k + 1};{pv(k)};{op(k)};{at(k)}")), "FIC1")


def test_a_datalogger_of_kepserverex(read: Read) -> None:
    ends = ("NUMERICID", "VALUE", "TIMESTAMP", "QUALITY")
    names = ",".join(f"FIC101_{signal}_{end}" for signal in ("PV", "OP") for end in ends)
    check(read(table(names, lambda k: f"0,{pv(k)},{at(k)},192,0,{op(k)},{at(k)},192")), "FIC101")


@pytest.mark.parametrize(
    "above", ["", "#datatype,string,long,dateTime:RFC3339,double,double\n#group,false,false,false\n"]
)
def test_a_pivot_of_influxdb(read: Read, above: str) -> None:
    content = read(above + table(",result,table,_time,PV,OP", lambda k: f",_result,0,{at(k)},{pv(k)},{op(k)}"))
    check(content, "export")
    names = ",result,table,_start,_stop,_time,_measurement,FIC1.PV,FIC1.OP"
    content = read(above + table(names, lambda k: f",,0,{at(0)},{at(59)},{at(k)},flows,{pv(k)},{op(k)}"))
    check(content, "FIC1")


def test_a_pivot_with_the_loop_in_a_column(read: Read) -> None:
    rows = [f",,{n},{at(k)},{loop},{pv(k)},{op(k)}" for n, loop in enumerate(("FIC1", "FIC2")) for k in range(ROWS)]
    check(read("\n".join((",result,table,_time,loop,PV,OP", *rows)) + "\n"), "FIC1", "FIC2")


def test_tables_of_one_time_are_not_mixed(read: Read) -> None:
    rows = [f",,{n},{at(k)},{float(pv(k)) + 20 * n},{op(k)}" for n in (0, 1) for k in range(ROWS)]
    with pytest.raises(DataError, match="the column 'table' tells the rows of one time apart"):
        read("\n".join((",result,table,_time,PV,OP", *rows)) + "\n")


def test_a_signal_called_table_is_kept(read: Read) -> None:
    content = read(table("Time,Table,FIC1.PV,FIC1.OP", lambda k: f"{at(k)},{k % 3},{pv(k)},{op(k)}"))
    assert list(content.loops) == ["Table", "FIC1"]


@pytest.mark.parametrize("name", ["MELT_NDX", "FIC101_NUMERICID"])
def test_a_signal_called_like_the_number_of_a_row_is_kept(read: Read, name: str) -> None:
    content = read(table(f"Time,{name},FIC1.PV,FIC1.OP", lambda k: f"{at(k)},{k % 8}.5,{pv(k)},{op(k)}"))
    assert list(content.loops) == [name, "FIC1"]


def test_signals_called_result_and_table_are_kept(read: Read) -> None:
    content = read(table("Time,Result,Table,FIC1.PV,FIC1.OP", lambda k: f"{at(k)},{k % 8}.5,{k % 3},{pv(k)},{op(k)}"))
    assert list(content.loops) == ["Result", "Table", "FIC1"]


def of_objects(heading: str, properties: dict[str, Callable[[int], str]]) -> str:
    rows = [
        f"{thing};{name};{at(k)};{value(k)}"
        for k in range(ROWS)
        for thing in ("FIC101", "TIC7")
        for name, value in properties.items()
    ]
    return "\n".join((heading, *rows)) + "\n"


@pytest.mark.parametrize("heading", ["Object;Property;Timestamp;Value", "ObjectName;PropertyName;TimeStamp;Value"])
def test_properties_that_are_no_signals_beside_those_that_are(read: Read, heading: str) -> None:
    content = read(of_objects(heading, {"PV": pv, "OUT": op, "ERR": lambda k: str(k % 3)}))
    assert {loop: list(samples.others) for loop, samples in content.loops.items()} == {
        "FIC101": ["FIC101.ERR"],
        "TIC7": ["TIC7.ERR"],
    }
    for loop in ("FIC101", "TIC7"):
        samples = content.loops[loop]
        assert samples.pv is not None
        assert samples.op is not None
        assert samples.pv.tolist() == [float(pv(k)) for k in range(ROWS)]
        assert samples.op.tolist() == [float(op(k)) for k in range(ROWS)]


def test_objects_beside_properties_that_are_taken_for_tags_are_not_mixed(read: Read) -> None:
    with pytest.raises(DataError, match="the column 'Object' tells the rows of one time apart") as error:
        read(of_objects("Object;Property;Timestamp;Value", {"PPA, PV": pv, "PPA, OUT": op}))
    assert error.value.code == "unknown_layout"
