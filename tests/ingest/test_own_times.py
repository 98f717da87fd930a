"""Logs in which each tag has a time of its own, and text that is none."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from app.errors import DataError
from tests.ingest.conftest import Read

START = datetime(2024, 3, 5)
FIRST_NS = int(np.datetime64(START, "ns").astype(np.int64))
PARTS = ("VALUE", "TIMESTAMP", "QUALITY")


def log(separator: str, late_s: int, numbered: bool = False) -> str:
    """OP is stored so much later than PV."""
    parts = ("NUMERICID", *PARTS) if numbered else PARTS
    names = [f"FIC101{separator}{signal}{separator}{part}" for signal in ("PV", "OP") for part in parts]
    rows = []
    for k in range(60):
        at = [START + timedelta(seconds=10 * k + late) for late in (0, late_s)]
        fields = [f"{50 + k}.5,{at[0]}.000,{0 if k == 7 else 192}", f"{k},{at[1]}.000,192"]
        rows.append(",".join(f"0,{field}" if numbered else field for field in fields))
    return "\n".join((",".join(names), *rows)) + "\n"


@pytest.mark.parametrize("separator", ["_", "."])
@pytest.mark.parametrize("numbered", [False, True])
def test_each_tag_is_read_at_its_own_times(read: Read, separator: str, numbered: bool) -> None:
    content = read(log(separator, 5, numbered))
    loop = content.loops["FIC101"]
    assert content.summary.layout == "own_times"
    assert loop.time_ns.tolist() == [FIRST_NS + 10 * k * 10**9 for k in range(60)]
    assert loop.pv is not None
    assert np.flatnonzero(np.isnan(loop.pv)).tolist() == [7]
    assert loop.op is not None
    assert loop.op.tolist()[10] == 9.5, "half way between 9, 5 s before, and 10, 5 s later"
    assert dict(content.rejects.counts) == {"bad_quality": 1}
    assert not any("further times" in note for note in content.summary.notes)


def test_times_that_are_one_are_read_as_any_wide_table(read: Read) -> None:
    content = read(log("_", 0))
    assert content.summary.layout == "wide"
    assert content.loops["FIC101"].op is not None


@pytest.mark.parametrize(("other", "field"), [("FIC101_SP_VALUE", "sp"), ("FIC101_MODE_VALUE", "automatic")])
def test_columns_without_times_of_their_own_are_not_lost(read: Read, other: str, field: str) -> None:
    names, *rows = log("_", 5).splitlines()
    content = read("\n".join((f"{names},{other}", *(f"{row},{1 + k // 30}" for k, row in enumerate(rows)))))
    assert content.summary.layout == "wide"
    assert getattr(content.loops["FIC101"], field) is not None
    assert any("further times were not read" in note for note in content.summary.notes)


@pytest.mark.parametrize(
    "line",
    [
        "plant,tag=FIC101.PV value={0}.5 {1}000000000",
        "FIC101 PV={0}.5,OP={0} {1}",
        "loop,name=FIC101,site=a PV={0}.5,OP={0}i {1}000",
    ],
)
def test_line_protocol_is_called_so(read: Read, line: str) -> None:
    with pytest.raises(DataError, match="this is InfluxDB line protocol, which is not read") as error:
        read("".join(line.format(k, 1709596800 + k) + "\n" for k in range(40)))
    assert error.value.code == "not_an_export"
