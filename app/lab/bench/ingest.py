"""Reading a plant's day from export files into PostgreSQL, beside polars reading the same file and nothing else."""

import json
import os
import shutil
import statistics
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import polars as pl

from app.lab.bench.bench import Bench, Figures, SkippedError
from app.lab.bench.loops import SIGNALS, records, times_ns
from app.lab.bench.measure import Memory, Stopwatch, children_of, processor_s
from app.lab.bench.servers import plant_backend, workers
from app.services.auditing import warming
from app.services.backend import Backend
from app.services.intake import uploads
from app.services.outward import UploadOut
from app.services.upkeep.sweep import sweep

LONGEST_S = 600.0
KINDS = 500  # loops are simulated so often; the others are these again, each with noise of its own
REST_S = 3.0  # before each run: virtual machines give freed memory back after 2 s, and get it anew slowly
RUNS = 3  # of polars with each number of threads, and of ours; the median of each counts
TARGETED = {"long CSV, by time": "by_time", "wide CSV": "wide"}
POLARS = """
import sys, time, resource, json
import polars as pl
start, path = time.perf_counter(), sys.argv[1]
frame = pl.read_parquet(path) if path.endswith("parquet") else pl.read_csv(path)
took = time.perf_counter() - start
cpu = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
print(json.dumps({"s": took, "cpu_s": cpu, "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3}))
"""


def run(bench: Bench) -> Figures:
    warming.warm_up()  # compiles for the workers too, however long it takes
    loops = bench.sizes.long_loops
    found: Figures = {"loops": loops, "values": loops * 1440 * len(SIGNALS), "rest_s": REST_S, "files": []}
    for name, write, count in (
        ("long CSV, by time", _long_by_time, loops),
        ("long CSV, a quarter of the loops", _long_by_time, loops // 4),
        ("wide CSV", _wide, loops),
        ("long parquet", _long_parquet, loops),
        ("wide parquet", _wide_parquet, loops),
    ):
        bench.tell(f"ingest: {name}, {count} loops")
        suffix = "parquet" if "parquet" in name else "csv"
        path = bench.folder / f"{uuid.uuid4().hex[:8]}.{suffix}"
        try:
            write(path, count)
            os.sync()  # the disk is not busy with the file itself when it is received
            found["files"].append(_measured(bench, name, path, count))
            key = TARGETED.get(name)
            if key is not None:
                found[key] = found["files"][-1]
        finally:
            path.unlink(missing_ok=True)
    return found


def _measured(bench: Bench, name: str, path: Path, loops: int) -> Figures:
    """In rounds of one run each: polars with one thread and with two, then ours. Of each, the run of median time."""
    alone: dict[int, list[Figures]] = {1: [], 2: []}
    ours: list[Figures] = []
    for _ in range(RUNS):
        for threads, told in alone.items():
            told.append(_polars(path, threads))
        ours.append(_end_to_end(bench, name, path))
    one, two = (_median_run(told, "s") for told in alone.values())
    own = _median_run(ours, "whole_s")
    values, size, whole_s = loops * 1440 * len(SIGNALS), path.stat().st_size, own["whole_s"]
    return {
        "file": name,
        "mb": size / 1e6,
        "values": values,
        **own,
        "peak_mb": max(run["peak_mb"] for run in ours),
        "values_a_s": values / whole_s,
        "mb_a_s": size / 1e6 / whole_s,
        "polars_s": {"1": one["s"], "2": two["s"]},
        "polars_runs_s": {"1": one["runs_s"], "2": two["runs_s"]},
        "polars_cpu_s": one["cpu_s"],
        "polars_peak_mb": two["peak_mb"],
        "share_of_polars_1": one["s"] / whole_s,
        "share_of_polars_2": two["s"] / whole_s,
        "reading_share_of_polars_2": two["s"] / own["read_s"],
    }


def _end_to_end(bench: Bench, name: str, path: Path) -> Figures:
    """The file received and read by one worker into an empty database; nothing of it stays."""
    with plant_backend(bench) as backend, _gone_afterwards(backend), workers(backend, 1) as parent:
        before = sum(map(processor_s, children_of(parent.pid)))
        with Memory(lambda: children_of(parent.pid)) as memory:
            time.sleep(REST_S)
            with Stopwatch() as receiving:
                receipt = uploads.receive_file(backend, path)
            with Stopwatch() as reading:
                state = _until_read(backend, receipt.upload.id)
        used = sum(map(processor_s, children_of(parent.pid))) - before
        base = memory.first_mb
    if state.state != "done":
        raise SkippedError(f"{name} was not read: {state.reason}")
    return {
        "loops_found": len(state.loops),
        "samples_added": state.samples_added,
        "received_s": receiving.seconds,
        "read_s": reading.seconds,
        "whole_s": receiving.seconds + reading.seconds,
        "processor_s": used,
        "peak_mb": memory.peak_mb,
        "before_mb": base,
    }


@contextmanager
def _gone_afterwards(backend: Backend) -> Iterator[None]:
    try:
        yield
    finally:
        shutil.rmtree(backend.settings.data_dir)


def _until_read(backend: Backend, upload_id: str) -> UploadOut:
    """The sweeps are those of `loopaudit beat`: a doorbell may be lost."""
    looked = started = time.monotonic()
    while (state := uploads.get_upload(backend, upload_id)).state not in ("done", "failed"):
        now = time.monotonic()
        if now - started > LONGEST_S:
            raise SkippedError(f"the file was not read within {LONGEST_S:.0f} s")
        if now - looked > backend.settings.sweep_s:
            sweep(backend)
            looked = now
        time.sleep(0.1)
    return state


def _median_run(runs: list[Figures], by: str) -> Figures:
    """The run of median time, with the times of all."""
    times = [run[by] for run in runs]
    return {**runs[times.index(statistics.median_low(times))], f"runs_{by}": times}


def _polars(path: Path, threads: int) -> Figures:
    time.sleep(REST_S)
    told = subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-c", POLARS, str(path)],
        env={**os.environ, "POLARS_MAX_THREADS": str(threads)},
        capture_output=True,
        text=True,
        check=False,
    )
    if told.returncode:
        raise SkippedError(f"polars could not read the file: {told.stderr[-300:]}")
    return json.loads(told.stdout)


def _tags(loops: int) -> list[str]:
    return [f"LOOP{index:05d}.{signal}" for index in range(loops) for signal in SIGNALS]


def _matrix(loops: int) -> np.ndarray:
    """(1440, 3 loops) values as a historian writes them: five digits or so."""
    rng = np.random.default_rng(7)
    kinds = [np.stack((loop.pv, loop.op, loop.sp), axis=1) for loop in records(min(KINDS, loops))]
    matrix = np.empty((len(kinds[0]), 3 * loops), dtype=np.float32)
    for index in range(loops):
        own = kinds[index % len(kinds)] * rng.uniform(0.9, 1.1)
        own[:, :2] += rng.normal(scale=0.01, size=(len(own), 2))
        matrix[:, 3 * index : 3 * index + 3] = own
    return matrix


def _stamps() -> list[str]:
    seconds = times_ns().astype("datetime64[ns]").astype("datetime64[s]")
    return [f"{stamp}Z" for stamp in np.datetime_as_string(seconds)]


def _instants(loops: int) -> Iterator[tuple[str, pl.Series]]:
    """The values of all tags, instant by instant."""
    matrix = _matrix(loops)
    for stamp, row in zip(_stamps(), matrix, strict=True):
        yield stamp, pl.Series("Value", np.round(row.astype(np.float64), 3))


def _long_by_time(path: Path, loops: int) -> None:
    tags = pl.Series("Tagname", _tags(loops))
    with path.open("wb") as file:
        file.write(b"Tagname,TimeStamp,Value\n")
        for stamp, values in _instants(loops):
            frame = pl.DataFrame({"Tagname": tags, "TimeStamp": pl.repeat(stamp, len(tags), eager=True)})
            frame.with_columns(values).write_csv(file, include_header=False)


def _long_parquet(path: Path, loops: int) -> None:
    tags = pl.Series("Tagname", _tags(loops), dtype=pl.Categorical)
    matrix = _matrix(loops)
    times = pl.Series("TimeStamp", times_ns()).cast(pl.Datetime("ns")).cast(pl.Datetime("us"))
    parts = []
    for index in range(matrix.shape[0]):
        stamp = times[index : index + 1].new_from_index(0, len(tags))
        values = pl.Series("Value", np.round(matrix[index].astype(np.float64), 3))
        parts.append(pl.DataFrame([tags, stamp, values]))
    pl.concat(parts, rechunk=False).with_columns(pl.col("Tagname").cast(pl.String)).write_parquet(path)


def _wide_frame(loops: int) -> pl.DataFrame:
    matrix = np.round(_matrix(loops).astype(np.float64), 3)
    return pl.DataFrame(matrix, schema=_tags(loops)).insert_column(0, pl.Series("DateTime", _stamps()))


def _wide(path: Path, loops: int) -> None:
    _wide_frame(loops).write_csv(path)


def _wide_parquet(path: Path, loops: int) -> None:
    _wide_frame(loops).with_columns(pl.col("DateTime").str.to_datetime("%Y-%m-%dT%H:%M:%SZ")).write_parquet(path)
