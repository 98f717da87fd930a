"""The seconds of LabVIEW's measurement files count from the start that their header tells."""

import numpy as np
import pytest

from app.errors import DataError
from app.ingest.model import IngestOptions
from tests.ingest.conftest import Content, Read

ROWS = 60
START = "2026-03-01T06:00:00.250"


def lvm(names: str, rows: list[str], settings: str = "Time_Pref\tRelative", unit: str = "Volts") -> str:
    return f"""LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t.
X_Columns\tOne
{settings}
Operator\tsomebody
Date\t2026/02/28
Time\t22:00:00.0000000
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t{len(rows)}\t{len(rows)}\t
Date\t2026/03/01\t2026/03/01\t
Time\t06:00:00.2500000\t06:00:00.2500000\t
Y_Unit_Label\t{unit}\t{unit}\t
X_Dimension\tTime\tTime\t
X0\t0.0000000000000000E+0\t0.0000000000000000E+0\t
Delta_X\t0.500000\t0.500000\t
***End_of_Header***\t\t\t
{names}\tComment
""" + "".join(f"{row}\n" for row in rows)


def of_halves(zero: float = 0.0) -> list[str]:
    return [f"{zero + k / 2:.6f}\t{k % 7}.250000\t{k % 5}.500000\t" for k in range(ROWS)]


def check(content: Content, loop: str, start: str = START) -> None:
    assert list(content.loops) == [loop]
    first = int(np.datetime64(start, "ns").astype(np.int64))
    assert content.loops[loop].time_ns.tolist() == [first + k * 500_000_000 for k in range(ROWS)]
    assert content.loops[loop].op.tolist() == [k % 5 + 0.5 for k in range(ROWS)]
    assert not content.rejects.counts


@pytest.mark.parametrize(("names", "loop"), [("PV\tOP", "F1"), ("FIC1.PV\tFIC1.OP", "FIC1")])
def test_seconds_count_from_the_start_of_the_channels(read: Read, names: str, loop: str) -> None:
    content = read(lvm(f"X_Value\t{names}", of_halves()), name="F1.lvm")
    check(content, loop)
    assert content.summary.notes == ("times count from the start that the header tells: 2026/03/01 06:00:00.2500000",)
    assert content.summary.time_zone == "UTC"


def test_the_start_is_of_the_set_zone(read: Read) -> None:
    content = read(lvm("X_Value\tPV\tOP", of_halves()), options=IngestOptions(time_zone="Europe/Berlin"))
    check(content, "export", "2026-03-01T05:00:00.250")
    assert content.summary.time_zone == "Europe/Berlin"


def test_decimal_commas(read: Read) -> None:
    text = lvm("X_Value\tPV\tOP", of_halves()).replace("Decimal_Separator\t.", "Decimal_Separator\t,")
    head, names, rows = text.partition("X_Value")
    check(read(head.replace(":00.", ":00,") + names + rows.replace(".", ",")), "export")


def test_absolute_times_are_seconds_since_1904(read: Read) -> None:
    zero = (np.datetime64(START[:19]) - np.datetime64("1904-01-01T00:00:00")).astype(int)
    rows = of_halves(float(zero) + 0.25)
    check(read(lvm("X_Value\tPV\tOP", rows, "Time_Pref\tAbsolute")), "export")


def test_each_channel_with_times_of_its_own(read: Read) -> None:
    rows = [f"{k / 2:.6f}\t{k % 7}.250000\t{k / 2:.6f}\t{k % 5}.500000\t" for k in range(ROWS)]
    check(read(lvm("X_Value\tFIC1.PV\tX_Value\tFIC1.OP", rows, "X_Columns\tMulti\nTime_Pref\tRelative")), "FIC1")


def test_headings_of_several_segments_tell_no_start_of_all(read: Read) -> None:
    text = lvm("X_Value\tPV\tOP", of_halves(), "Multi_Headings\tYes\nTime_Pref\tRelative")
    check(read(text), "export", "1970-01-01T00:00:00")


def test_times_without_channels_are_no_signals(read: Read) -> None:
    rows = [f"{k / 2:.6f}\t{k / 2:.6f}\t" for k in range(ROWS)]
    content = read(lvm("X_Value\tX_Value", rows, "X_Columns\tMulti").replace("\tComment", ""))
    assert all(samples.pv is None for samples in content.loops.values())


def test_without_times_it_is_refused(read: Read) -> None:
    rows = [f"\t{k % 7}.25\t{k % 5}.5\t" for k in range(ROWS)]
    with pytest.raises(DataError, match="without times") as error:
        read(lvm("X_Value\tPV\tOP", rows, "X_Columns\tNo"))
    assert error.value.code == "unknown_layout"
