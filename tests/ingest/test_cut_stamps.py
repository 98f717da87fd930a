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


@pytest.mark.parametrize("form", ["%Y-%m-%dT%H:%M:%S", "%Y-%m-%d %H:%M"])
@pytest.mark.parametrize("missing", [0, 7])
@pytest.mark.parametrize("by_tag", [True, False])
def test_of_two_values_of_a_stamp_the_later_one_holds(read: Read, by_tag: bool, missing: int, form: str) -> None:
    """As corrected, or of two servers, of which one misses some values."""
    step = timedelta(seconds=1) if "%S" in form else timedelta(minutes=1)
    stamps = [f"{FIRST + k * step:{form}}" for k in range(200)]
    twice = [(k, d) for k in range(200) for d in (0.0003, 0.0) if not (d and missing and k % missing == 3)]
    rows = {s: [f"A.{s},{stamps[k]},{k + d:.4f}\n" for k, d in twice] for s in ("PV", "OP")}
    text = [*rows["PV"], *rows["OP"]] if by_tag else [row for pair in zip(*rows.values(), strict=True) for row in pair]
    content = read("tag,time,value\n" + "".join(text))
    loop = content.loops["A"]
    assert loop.pv.tolist() == loop.op.tolist() == list(range(200))
    assert np.unique(np.diff(loop.time_ns)).tolist() == [step // timedelta(microseconds=1) * 1000]
    assert dict(content.rejects.counts) == {"duplicate_time": 2 * (len(twice) - 200)}
    assert not any(note.startswith(NOTE) for note in content.summary.notes)


def test_stamps_that_come_two_or_three_times_are_cut(read: Read) -> None:
    stamps = [f"{FIRST + timedelta(seconds=25 * k):%Y-%m-%d %H:%M}" for k in range(200)]
    content = read("tag,time,value\n" + "".join(f"A.PV,{stamp},{k}\n" for k, stamp in enumerate(stamps)))
    assert content.loops["A"].pv.tolist() == list(range(200))
