"""A large file: every loop comes once and whole, as from a small one, and memory does not grow with the file."""

import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from app.ingest import IngestOptions, read_export
from app.ingest.columns.plain_names import plain
from app.ingest.files.ahead import ahead
from app.ingest.files.opening import TextFile
from app.ingest.rejecting import RejectLog
from app.ingest.tables import spilling
from app.ingest.tables.frames import Dialect, FrameReader, Rows
from app.ingest.tables.pieces import Gathered
from app.ingest.tags.modes import automatic_flags
from app.ingest.times.stamps import find_form
from app.ingest.times.told_units import told_unit
from app.ingest.times.told_zones import told_utc_offset_ns

MEASURE = """
import sys
from pathlib import Path
from app.ingest import IngestOptions, read_export
options = IngestOptions(chunk_bytes=1 << 20, buffered_values=60_000, spill_folder=Path(sys.argv[1]).parent)
samples = sum(stretch.samples for stretch in read_export(Path(sys.argv[1]), options=options).loops())
# Not ru_maxrss, which begins with what the process that started this one holds.
print(samples, *(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")))
"""


def long_file(path: Path, loops: int, instants: int) -> Path:
    """By time: the rows of a loop are spread over the whole file."""
    with path.open("w") as file:
        file.write("Tagname,TimeStamp,Value\n")
        for k in range(instants):
            stamp = f"2026-01-31T{k // 3600:02d}:{k // 60 % 60:02d}:{k % 60:02d}Z"
            file.writelines(f"L{n}.{s},{stamp},{n + k % 7}.5\n" for n in range(loops) for s in ("PV", "OP"))
    return path


@pytest.mark.parametrize("parts", [64, 5])
def test_each_loop_of_a_file_parted_on_disk_comes_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, parts: int
) -> None:
    path = long_file(tmp_path / "night.csv", 150, 40)
    whole = {loop.loop: loop for loop in read_export(path).loops()}
    monkeypatch.setattr(spilling, "PARTS", parts)
    options = IngestOptions(chunk_bytes=5000, buffered_values=2000, spill_folder=tmp_path)
    parted = list(read_export(path, options=options).loops())
    assert sorted(loop.loop for loop in parted) == sorted(whole)
    assert len(whole) == 150
    for loop in parted:
        assert np.array_equal(loop.time_ns, whole[loop.loop].time_ns)
        assert np.array_equal(loop.pv, whole[loop.loop].pv)
        assert np.array_equal(loop.op, whole[loop.loop].op)
    assert [found.name for found in tmp_path.iterdir()] == ["night.csv"]


@pytest.mark.parametrize("most_values", [10, 1000, 10**6])
def test_a_part_that_is_too_large_is_parted_again(monkeypatch: pytest.MonkeyPatch, most_values: int) -> None:
    monkeypatch.setattr(spilling, "PARTS", 4)
    loop_of_code = np.arange(200, dtype=np.uint32) // 2
    spill = spilling.Spill(None, most_values)
    for k in range(20):
        lines = np.arange(200 * k, 200 * (k + 1), dtype=np.uint32)
        codes = np.random.default_rng(k).permutation(200).astype(np.uint32)
        spill.add(Gathered(codes, lines.astype(np.int64), codes / 8, lines), loop_of_code)
    came: list[int] = []
    for pieces in spill.parts():
        codes = np.concatenate([piece.codes for piece in pieces])
        lines = np.concatenate([piece.lines for piece in pieces])
        assert np.all(np.diff(lines) > 0)
        loops = np.unique(loop_of_code[codes]).tolist()
        assert len(codes) * spilling.VALUES_A_ROW <= most_values or len(loops) == 1
        assert len(codes) == 40 * len(loops)
        came += loops
    spill.close()
    assert sorted(came) == list(range(100))


def test_the_rows_of_a_long_table_that_are_held_are_as_many_as_was_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = long_file(tmp_path / "night.csv", 20, 40)
    opened: list[object] = []
    temporary = spilling.tempfile.TemporaryFile
    monkeypatch.setattr(spilling.tempfile, "TemporaryFile", lambda **of: opened.append(of) or temporary(**of))
    for values, parts in ((1600 * spilling.VALUES_A_ROW + 1, 0), (1000, 20)):
        list(read_export(path, options=IngestOptions(chunk_bytes=5000, buffered_values=values)).loops())
        assert len(opened) == parts


def test_each_loop_of_a_wide_file_put_aside_comes_once(tmp_path: Path) -> None:
    path = tmp_path / "night.csv"
    tags = [f"L{n}.{signal}" for n in range(70) for signal in ("PV", "OP")]
    rows = [",".join(["DateTime", *tags])]
    rows += [f"2026-01-31T00:{k:02d}:00Z," + ",".join(f"{n + k / 8}" for n in range(140)) for k in range(60)]
    path.write_text("\n".join(rows) + "\n")
    whole = {loop.loop: loop for loop in read_export(path).loops()}
    options = IngestOptions(chunk_bytes=5000, buffered_values=500, spill_folder=tmp_path)
    parted = list(read_export(path, options=options).loops())
    assert sorted(loop.loop for loop in parted) == sorted(whole)
    for loop in parted:
        assert np.array_equal(loop.time_ns, whole[loop.loop].time_ns)
        assert np.array_equal(loop.pv, whole[loop.loop].pv)
    assert len(whole) == 70
    assert [found.name for found in tmp_path.iterdir()] == ["night.csv"]


def wide_parquet(path: Path, loops: int, instants: int) -> Path:
    tags = [f"L{n}.{signal}" for n in range(loops) for signal in ("PV", "OP")]
    values = np.arange(instants)[:, None] % 7 + np.arange(len(tags)) / 8
    times = pl.datetime_range(pl.datetime(2026, 1, 1), pl.datetime(2026, 1, 31), "1m", eager=True)[:instants]
    pl.DataFrame(values, schema=tags).insert_column(0, times.alias("DateTime")).write_parquet(path)
    return path


def test_memory_does_not_grow_with_the_columns_of_a_table(tmp_path: Path) -> None:
    peaks = []
    for name, loops in (("narrow.parquet", 600), ("wide.parquet", 2400)):
        path = wide_parquet(tmp_path / name, loops, 1440)
        told = subprocess.run([sys.executable, "-c", MEASURE, str(path)], capture_output=True, text=True, check=True)
        samples, peak = map(int, told.stdout.split())
        assert samples == 1440 * loops
        peaks.append(peak)
    assert peaks[1] < 1.4 * peaks[0]


def test_memory_does_not_grow_with_the_file(tmp_path: Path) -> None:
    peaks = []
    for name, instants in (("small.csv", 200), ("large.csv", 2000)):
        path = long_file(tmp_path / name, 200, instants)
        told = subprocess.run([sys.executable, "-c", MEASURE, str(path)], capture_output=True, text=True, check=True)
        samples, peak = map(int, told.stdout.split())
        assert samples == 200 * instants
        peaks.append(peak)
    assert (tmp_path / "large.csv").stat().st_size > 9 * (tmp_path / "small.csv").stat().st_size
    assert peaks[1] < 1.3 * peaks[0]


@pytest.mark.parametrize("form", ["{k}-1 {long}", "{long} {k}-1", "2026-01-31 00:00:0{k}.{long}"])
@pytest.mark.parametrize("name", ["", "Remark"])
def test_long_cells_are_not_kept_behind_their_file(form: str, name: str) -> None:
    """What is found out of a column is remembered, for the next layout that asks."""
    find_form(["1-1 x"], "", IngestOptions())
    tracemalloc.start()
    for k in range(3):
        find_form([form.format(k=k, long="1" * 80_000)], name * 40_000, IngestOptions())
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert held < 40_000


def test_long_names_and_words_are_not_kept_behind_their_file() -> None:
    find_form(["1-1 x"], "", IngestOptions())
    tracemalloc.start()
    for k in range(8):
        name = f"{k} Time (UTC) " + "x" * 200_000
        assert [told_utc_offset_ns(name), told_unit(name), plain(name)[:5]] == [0, None, f"{k}time"]
        assert automatic_flags(pl.Series([name])).tolist() == [-1]
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert held < 300_000  # of the last name, which is still here


def test_counting_the_fields_of_one_row_takes_no_memory_for_those_of_all(tmp_path: Path) -> None:
    path = tmp_path / "sparse.csv"
    path.write_bytes(b"2026-01-31 00:00:00\n" + (b"," * 2000 + b"\n") * 1000)
    types = {index: pl.Float64() for index in range(1, 2001)}
    reader = FrameReader(
        TextFile(path, IngestOptions()), Dialect(",", ".", 2001), types, RejectLog(IngestOptions().max_rejects)
    )
    rows = Rows(pl.DataFrame(), 1, path.read_bytes())
    tracemalloc.start()
    assert reader.short_rows(rows, np.array([0, 1])).tolist() == [0]
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2 * len(rows.data)


def test_an_error_comes_where_it_was_raised() -> None:
    def three() -> "object":
        yield 1
        yield 2
        raise ValueError("odd")

    items = ahead(three())
    assert [next(items), next(items)] == [1, 2]
    with pytest.raises(ValueError, match="odd"):
        next(items)
