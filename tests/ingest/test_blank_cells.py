"""Blank cells of a wide table: the same samples give the same loop, whether they stand in a wide or a long table."""

import io
from collections.abc import Callable, Mapping
from datetime import datetime, timedelta

import numpy as np
import polars as pl
import pytest

from app.engine.simulate import keep
from app.ingest import IngestOptions, LoopSamples

from .conftest import Read
from .test_holes import SATURATING, changed, reported

N = 7200
FIRST = datetime(2026, 3, 4, 10)
STAMPS = [(FIRST + timedelta(seconds=k)).isoformat() for k in range(N)]
Cells = Mapping[str, Mapping[int, str]]  # of each signal, by second
RNG = np.random.default_rng(2)
PV = np.round(50 + np.sin(np.arange(N) / 30) + 0.02 * RNG.standard_normal(N), 4)
OP = np.round(40 + 3 * np.sin(np.arange(N) / 60) + 0.3 * np.sin(np.arange(N) / 11), 4)


def cells(values: np.ndarray, at: np.ndarray | range = range(N)) -> dict[int, str]:
    return {int(k): str(values[k]) for k in at}


def wide(signals: Cells, blank: str = "") -> str:
    rows = sorted({k for own in signals.values() for k in own})
    lines = [",".join([STAMPS[k], *(own.get(k, blank) for own in signals.values())]) for k in rows]
    return "\n".join([",".join(["Time", *(f"A.{signal}" for signal in signals)]), *lines]) + "\n"


def long(signals: Cells) -> str:
    rows = sorted((k, signal) for signal, own in signals.items() for k in own)
    lines = [f"A.{signal},{STAMPS[k]},{signals[signal][k]}" for k, signal in rows]
    return "\n".join(["TagName,Timestamp,Value", *lines]) + "\n"


def same(found: LoopSamples, expected: LoopSamples) -> None:
    assert np.array_equal(found.time_ns, expected.time_ns)
    assert set(found.resampled) == set(expected.resampled)
    for name in ("pv", "op", "sp", "automatic"):
        ours, theirs = getattr(found, name), getattr(expected, name)
        assert (ours is None) == (theirs is None)
        assert ours is None or np.array_equal(ours, theirs, equal_nan=True), name


def by_exception() -> Cells:
    """OP stored when it has moved, set point and mode when they change."""
    sp, mode = {0: "50", 100: "51", 5000: "50"}, {0: "AUTO", 6000: "MAN"}
    return {"PV": cells(PV), "OP": cells(OP, reported(OP, 0.2)), "SP": sp, "MODE": mode}


def swinging_doors() -> Cells:
    time_s = np.arange(float(N))
    kept = {"PV": keep(time_s, PV, 0.1, "swinging_door"), "OP": keep(time_s, OP, 0.1, "swinging_door")}
    return {signal: cells(values, np.flatnonzero(kept[signal])) for signal, values in (("PV", PV), ("OP", OP))}


def with_refused() -> Cells:
    signals = by_exception()
    return {**signals, "OP": {**signals["OP"], 3001: "Bad", 5001: "-9999"}}


def rests() -> Cells:
    """OP stored when it changes, at nearly every scan."""
    return {"PV": cells(PV), "OP": cells(SATURATING, changed(SATURATING))}


TABLES: dict[str, Callable[[], Cells]] = {
    "by exception": by_exception,
    "swinging doors": swinging_doors,
    "refused values": with_refused,
    "rests": rests,
    "a slower scan": lambda: {"PV": cells(PV), "OP": cells(OP, range(0, N, 5))},
    "a slower PV": lambda: {"PV": cells(PV, range(0, N, 5)), "OP": cells(OP)},
}
OPTIONS = (
    IngestOptions(),
    IngestOptions(chunk_bytes=20_000),
    IngestOptions(chunk_bytes=20_000, buffered_values=5_000),
)


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_a_wide_table_with_blanks_gives_what_a_long_one_gives(read: Read, table: Callable[[], Cells]) -> None:
    """Whole, in chunks and by disk."""
    signals = table()
    expected = read(long(signals)).loops["A"]
    assert np.isfinite(expected.op).sum() > 1000 or expected.samples < 1000
    for options in OPTIONS:
        same(read(wide(signals), options=options).loops["A"], expected)


def test_an_op_by_exception_is_known_at_all_times_of_pv(read: Read) -> None:
    loop = read(wide(by_exception())).loops["A"]
    assert set(loop.resampled) == {"OP", "SP", "MODE"}
    np.testing.assert_allclose(loop.op[:7000], OP[:7000], atol=0.4)
    assert loop.sp[[0, 99, 100, 4999, 5000, 7199]].tolist() == [50, 50, 51, 51, 50, 50]
    assert loop.automatic[[0, 5999, 6000, 7199]].tolist() == [1, 1, 0, 0]


def test_a_refused_value_is_no_blank(read: Read) -> None:
    loop = read(wide(with_refused())).loops["A"]
    unknown = np.flatnonzero(np.isnan(loop.op[:7000]))
    assert {3001, 5001} <= set(unknown.tolist())
    assert np.sum(np.diff(unknown) > 1) == 1


def test_rows_doubled_by_a_union_leave_blanks_what_they_are(read: Read) -> None:
    head, *rows = wide(by_exception()).splitlines()
    parted = []
    for k, row in enumerate(rows):
        parted += [row] if k % 3 else [",".join([*row.split(",")[:2], "", "", ""]), row]
    same(read("\n".join([head, *parted]) + "\n").loops["A"], read(long(by_exception())).loops["A"])


def test_a_few_holes_stay_holes(read: Read) -> None:
    """Of all signals, or of one: the rows stay, and nothing is drawn over them."""
    out = {"PV": np.s_[1000:1100], "OP": np.s_[1050:3000], "SP": np.s_[1000:1100]}
    whole = {"PV": PV, "OP": OP, "SP": np.full(N, 50.0)}
    signals = {signal: cells(whole[signal], np.delete(np.arange(N), hole)) for signal, hole in out.items()}
    rows = wide({**signals, "MODE": dict.fromkeys(range(N), "AUTO")})
    loop = read(rows).loops["A"]
    assert loop.samples == N
    assert loop.resampled == ()
    for signal, values in (("PV", loop.pv), ("OP", loop.op), ("SP", loop.sp)):
        expected = whole[signal].copy()
        expected[out[signal]] = np.nan
        assert np.array_equal(values, expected, equal_nan=True)


def test_a_rest_alone_is_a_hole_where_the_cell_is_blank(read: Read) -> None:
    at = np.delete(np.arange(N), np.s_[3000:4000])
    loop = read(wide({"PV": cells(PV), "OP": cells(np.round(OP + np.arange(N) * 1e-4, 4), at)})).loops["A"]
    assert np.array_equal(np.flatnonzero(np.isnan(loop.op)), np.arange(3000, 4000))


@pytest.mark.parametrize("word", ["NULL", "null", " NULL", "-", "N/A", "None"])
def test_a_word_for_nothing_is_a_blank(read: Read, word: str) -> None:
    found, expected = read(wide(by_exception(), word)), read(wide(by_exception()))
    assert found.rejects.total == 0
    same(found.loops["A"], expected.loops["A"])


def test_a_word_for_nothing_is_none_in_a_long_table(read: Read) -> None:
    signals = {"PV": cells(PV), "OP": {**cells(OP), 700: "NULL", 800: "Bad"}}
    content = read(long(signals))
    assert dict(content.rejects.counts) == {"not_a_number": 1}
    assert np.flatnonzero(np.isnan(content.loops["A"].op)).tolist() == [700, 800]


def test_nothing_in_a_typed_table_is_a_blank(read: Read) -> None:
    signals = {signal: by_exception()[signal] for signal in ("PV", "OP", "SP")}
    columns = {"Time": pl.Series(STAMPS).str.to_datetime()}
    for signal, own in signals.items():
        columns[f"A.{signal}"] = pl.Series([float(own[k]) if k in own else None for k in range(N)])
    stream = io.BytesIO()
    pl.DataFrame(columns).write_parquet(stream)
    same(read(stream.getvalue(), name="night.parquet").loops["A"], read(long(signals)).loops["A"])
