"""Stamps cut to the minute: whichever way time runs and however the table stands, no sample is lost."""

from datetime import datetime, timedelta

import numpy as np
import polars as pl
import pytest

from app.ingest import IngestOptions

from .conftest import Content, Read
from .test_tables import parquet, workbook

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


def test_a_loop_that_stands_still_at_first(read: Read) -> None:
    stamps = [f"{FIRST + timedelta(seconds=10 * k):%Y-%m-%d %H:%M}" for k in range(1000)]
    rows = [f"{stamp},{max(k, 600)},{max(k, 700)}\n" for k, stamp in enumerate(stamps)]
    content = read("Time,A.PV,A.OP\n" + "".join(rows))
    assert content.loops["A"].pv.tolist() == [max(k, 600) for k in range(1000)]
    assert content.rejects.total == 0


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


def cut(unit: str, samples: int = 600, ms: int = 1000) -> tuple[list[str], np.ndarray]:
    """Stamps of an even record cut to a unit but written with `:00`, and when the samples were."""
    at = np.datetime64("2024-03-14T08:00:00.000", "ms") + ms * np.arange(samples)
    stamps = at.astype(f"datetime64[{unit}]").astype("datetime64[ms]")
    return [str(stamp).replace("T", " ") for stamp in stamps], at.astype("datetime64[ns]").astype(np.int64)


def kinds(stamps: list[str], digits: int) -> dict[str, str | bytes]:
    """The same table in all kinds of file."""
    written = [stamp[: len(stamp) - 4 + digits] for stamp in stamps]
    values = [(float(k), float(k % 5)) for k in range(len(stamps))]
    rows = [[stamp, pv, op] for stamp, (pv, op) in zip(written, values, strict=True)]
    long = "".join(f"A.PV,{stamp},{pv}\nA.OP,{stamp},{op}\n" for stamp, pv, op in rows)
    columns = {"A.PV": [pv for pv, _ in values], "A.OP": [op for _, op in values]}
    frame = pl.DataFrame({"Time": pl.Series(stamps).str.to_datetime("%Y-%m-%d %H:%M:%S%.3f"), **columns})
    return {
        "wide": "Time,A.PV,A.OP\n" + "".join(f"{','.join(map(str, row))}\n" for row in rows),
        "long": "tag,time,value\n" + long,
        "parquet": parquet(frame),
        "long parquet": parquet(frame.unpivot(index="Time", variable_name="tag")),
        "workbook": workbook([["Time", "A.PV", "A.OP"], *rows]),
    }


@pytest.mark.parametrize(
    ("unit", "ms", "digits"),
    [("m", 1000, 0), ("m", 1000, 4), ("m", 100, 0), ("m", 20_000, 0), ("s", 250, 0), ("s", 250, 4)],
)
def test_stamps_that_are_cut_but_written_in_full(read: Read, unit: str, ms: int, digits: int) -> None:
    samples = 600 if ms > 100 else 3000
    stamps, at = cut(unit, samples, ms)
    for kind, data in kinds(stamps, digits).items():
        content = read(data)
        loop = content.loops["A"]
        np.testing.assert_array_equal(loop.time_ns, at, err_msg=kind)
        assert loop.pv.tolist() == list(range(samples)), kind
        assert content.rejects.total == 0, kind
        assert sum(note.startswith(NOTE) for note in content.summary.notes) == 1, kind


@pytest.mark.parametrize("way", [1, -1])
def test_in_pieces_the_minute_is_seen_as_soon_as_two_stamps_are_there(read: Read, way: int) -> None:
    stamps, at = cut("m", 3000, 100)
    rows = [f"{stamp[:-4]},{k},{k % 5}\n" for k, stamp in enumerate(stamps)]
    text = "Time,A.PV,A.OP\n" + "".join(rows[::way])
    np.testing.assert_array_equal(read(text, options=IngestOptions(chunk_bytes=500)).loops["A"].time_ns, at)


def test_stamps_of_two_minutes_among_seconds_are_of_seconds(read: Read) -> None:
    at = [f"{FIRST + timedelta(seconds=40 + k // 4):%Y-%m-%d %H:%M:%S}" for k in range(400)]
    loop = read("Time,A.PV,A.OP\n" + "".join(f"{stamp},{k},{k % 5}\n" for k, stamp in enumerate(at))).loops["A"]
    assert np.unique(np.diff(loop.time_ns)).tolist() == [250_000_000]


def test_stamps_that_are_cut_to_ten_seconds(read: Read) -> None:
    stamps, at = cut("ms", 600)
    rows = "".join(f"{stamps[k - k % 10]},{k},{k % 5}\n" for k in range(600))
    np.testing.assert_array_equal(read("Time,A.PV,A.OP\n" + rows).loops["A"].time_ns, at)


@pytest.mark.parametrize("scale", [1, 1000])
def test_numbers_since_1970_are_cut_as_texts_are(read: Read, scale: int) -> None:
    _, at = cut("s", 600, 250)
    seconds = at // 10**9 * scale
    wide = "Time,A.PV,A.OP\n" + "".join(f"{s},{k},{k % 5}\n" for k, s in enumerate(seconds))
    long = "tag,time,value\n" + "".join(f"A.PV,{s},{k}\nA.OP,{s},{k % 5}\n" for k, s in enumerate(seconds))
    for text in (wide, long):
        content = read(text)
        np.testing.assert_array_equal(content.loops["A"].time_ns, at)
        assert content.rejects.total == 0
