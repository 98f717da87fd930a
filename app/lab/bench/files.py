"""Reading small files, as a plant that exports a file a loop sends them: how they are written is found out anew in
each. Beside it polars reads the same files and does nothing else."""

import time
from collections.abc import Callable
from pathlib import Path

import polars as pl

from app.ingest import read_export
from app.lab.bench.bench import Bench, Figures, SkippedError
from app.lab.bench.loops import SIGNALS, SimulatedRecord, records, times_ns

FILES = 30  # of each kind, of which no two are of one loop: what is remembered of one is of no use to the next
Rows = Callable[[SimulatedRecord], pl.DataFrame]


def run(bench: Bench) -> Figures:
    found = []
    for name, rows in (("a column a signal", _wide), ("a row a value", _long), ("date and clock apart", _parted)):
        bench.tell(f"files: {name}, {FILES} files of a loop's day")
        folder = bench.folder / name.replace(" ", "_")
        folder.mkdir()
        found.append({"file": name, **_measured(_written(folder, rows))})
    return {"each": FILES, "kinds": found}


def _measured(paths: list[Path]) -> Figures:
    """In ms of processor time a file, all threads together. The first file of each is not timed."""
    opened, ours, alone = [], [], []
    for path in paths:
        start = time.process_time()
        export = read_export(path)
        opened.append(time.process_time() - start)
        (loop,) = export.loops()
        ours.append(time.process_time() - start)
        if loop.samples != len(times_ns()):
            raise SkippedError(f"{path.name} was not read whole: {loop.samples} samples")
        start = time.process_time()
        pl.read_csv(path)
        alone.append(time.process_time() - start)
    mean_ms = (1e3 * sum(times[1:]) / (len(paths) - 1) for times in (opened, ours, alone))
    return dict(zip(("opened_ms", "read_ms", "polars_ms"), mean_ms, strict=True))


def _written(folder: Path, rows: Rows) -> list[Path]:
    paths = []
    for loop in records(FILES):
        paths.append(folder / f"{loop.tag}.csv")
        rows(loop).write_csv(paths[-1])
    return paths


def _stamped(form: str) -> pl.Series:
    return pl.Series(times_ns()).cast(pl.Datetime("ns")).dt.strftime(form)


def _values(loop: SimulatedRecord) -> dict[str, pl.Series]:
    return {
        f"{loop.tag}.{signal}": pl.Series(values)
        for signal, values in zip(SIGNALS, (loop.pv, loop.op, loop.sp), strict=True)
    }


def _wide(loop: SimulatedRecord) -> pl.DataFrame:
    return pl.DataFrame({"Time": _stamped("%Y-%m-%d %H:%M:%S"), **_values(loop)})


def _parted(loop: SimulatedRecord) -> pl.DataFrame:
    return pl.DataFrame({"Date": _stamped("%d-%b-%Y"), "Time": _stamped("%H:%M:%S"), **_values(loop)})


def _long(loop: SimulatedRecord) -> pl.DataFrame:
    stamps = _stamped("%Y-%m-%dT%H:%M:%SZ")
    parts = [
        pl.DataFrame({"Tagname": pl.repeat(tag, len(stamps), eager=True), "TimeStamp": stamps, "Value": values})
        for tag, values in _values(loop).items()
    ]
    return pl.concat(parts)
