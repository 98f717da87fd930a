"""Stamps cut to the minute: whichever way time runs and however the table stands, no sample is lost."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from app.ingest import IngestOptions

from .conftest import Content, Read

SAMPLES = 295  # the first and the last minute are not whole
FIRST = datetime(2026, 3, 4, 10, 0, 20)
STAMPS = [f"{FIRST + timedelta(seconds=10 * k):%Y-%m-%d %H:%M}" for k in range(SAMPLES)]
AT = np.datetime64(FIRST, "ns").astype(np.int64) + 10**10 * np.arange(SAMPLES)
NOTE = "time stamps are cut and repeat"


def check(content: Content) -> None:
    loop = content.loops["A"]
    np.testing.assert_array_equal(loop.time_ns, AT)
    assert loop.pv.tolist() == list(range(SAMPLES))
    assert loop.op.tolist() == [k % 5 for k in range(SAMPLES)]
    assert content.rejects.total == 0
    assert sum(note.startswith(NOTE) for note in content.summary.notes) == 1


@pytest.mark.parametrize("chunk_bytes", [16 << 20, 2000, 300])
@pytest.mark.parametrize("way", [1, -1])
def test_in_a_wide_table(read: Read, way: int, chunk_bytes: int) -> None:
    rows = [f"{stamp},{k},{k % 5}\n" for k, stamp in enumerate(STAMPS)]
    check(read("Time,A.PV,A.OP\n" + "".join(rows[::way]), options=IngestOptions(chunk_bytes=chunk_bytes)))


@pytest.mark.parametrize("options", [IngestOptions(), IngestOptions(chunk_bytes=500, buffered_values=1000)])
@pytest.mark.parametrize("by_tag", [True, False])
@pytest.mark.parametrize("way", [1, -1])
def test_in_a_long_table(read: Read, way: int, by_tag: bool, options: IngestOptions) -> None:
    pv = [f"A.PV,{stamp},{k}\n" for k, stamp in enumerate(STAMPS)]
    op = [f"A.OP,{stamp},{k % 5}\n" for k, stamp in enumerate(STAMPS)]
    rows = [*pv[::way], *op[::way]] if by_tag else [row for pair in zip(pv, op, strict=True) for row in pair][::way]
    check(read("tag,time,value\n" + "".join(rows), options=options))


def test_a_tag_that_stands_still_beside_one_that_does_not(read: Read) -> None:
    rows = [f"A.PV,{stamp},{k}\nA.OP,{stamp},7\n" for k, stamp in enumerate(STAMPS)]
    loop = read("tag,time,value\n" + "".join(rows)).loops["A"]
    assert loop.op.tolist() == [7] * SAMPLES


def test_rows_of_a_long_table_that_were_sent_twice_are_no_cut_stamps(read: Read) -> None:
    rows = [f"A.PV,{FIRST + timedelta(minutes=k):%Y-%m-%d %H:%M},{k}\n" for k in range(60)]
    content = read("tag,time,value\n" + "".join(row for row in rows for _ in range(2)))
    assert np.unique(np.diff(content.loops["A"].time_ns)).tolist() == [60 * 10**9]
    assert not any(note.startswith(NOTE) for note in content.summary.notes)
