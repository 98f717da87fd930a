"""The plant: from rows in PostgreSQL to verdicts in PostgreSQL, through Redis and worker processes."""

import statistics
import time
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any

from sqlalchemy import func, select

from app.lab.bench.bench import Bench, Figures
from app.lab.bench.loops import SimulatedRecord, records, times_ns
from app.lab.bench.measure import Memory, children_of, processor_s
from app.lab.bench.servers import plant_backend, workers
from app.services.auditing import audits, warming
from app.services.auditing.audits import LoopFilter
from app.services.backend import Backend
from app.storage import loops, series, tables
from app.storage.samples import Samples
from app.storage.series import Stretch
from app.storage.tables import audit_items, verdicts

BATCH = 250
LONGEST_RUN_S = 3600.0
SCALING = (
    ("some_1", 1),
    ("some_2", 2),
    ("some_2_again", 2),
    ("some_1_again", 1),
    ("some_1_third", 1),
    ("some_2_third", 2),
)


def run(bench: Bench) -> Figures:
    sizes = bench.sizes
    warming.warm_up()  # compiles for the workers too, however long it takes
    with plant_backend(bench) as backend:
        bench.tell(f"plant: simulating {sizes.loops} loops and storing their day")
        started = time.perf_counter()
        load(backend, records(sizes.loops))
        found: Figures = {"loops": sizes.loops, "samples": 1440, "loaded_s": time.perf_counter() - started}
        some = LoopFilter(tags=_first_tags(backend, sizes.scaling_loops))
        bench.tell("plant: a run that nobody times")
        _audit(backend, 2, some)
        for name, count in SCALING:
            bench.tell(f"plant: {sizes.scaling_loops} loops with {count} worker(s)")
            found[name] = _audit(backend, count, some)
        found["scaling"] = _scaling(found)
        bench.tell(f"plant: {sizes.loops} loops with 2 workers")
        found["whole"] = _audit(backend, 2, LoopFilter())
        found["storage"] = _sizes(backend)
    return found


def _scaling(found: Figures) -> float:
    """The median time of the runs of one worker over that of the runs of two."""
    wall_s = {count: statistics.median(found[name]["wall_s"] for name, c in SCALING if c == count) for count in (1, 2)}
    return wall_s[1] / wall_s[2]


def load(backend: Backend, plant: Iterable[SimulatedRecord]) -> None:
    """Stores a day of each loop, as reading an upload would."""
    times = times_ns()
    for batch in _batches(plant):
        with backend.database.write() as connection:
            ids = loops.ensure(connection, (loop.tag for loop in batch))
            stretches = [
                Stretch(ids[loop.tag], Samples(times, {"pv": loop.pv, "op": loop.op, "sp": loop.sp})) for loop in batch
            ]
            series.add(connection, stretches, None)
            loops.fill_in(connection, {ids[loop.tag]: {"unit": loop.unit} for loop in batch})
    analyse(backend)


def analyse(backend: Backend) -> None:
    """What autovacuum does within minutes, as far as plans depend on it: an index alone is read only of pages that it
    has been through."""
    with backend.database.writer.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
        connection.exec_driver_sql("ANALYZE")
        connection.exec_driver_sql("VACUUM loops, newest_rows")


def _batches(plant: Iterable[SimulatedRecord]) -> Iterator[list[SimulatedRecord]]:
    waiting = iter(plant)
    while batch := list(islice(waiting, BATCH)):
        yield batch


def _first_tags(backend: Backend, count: int) -> tuple[str, ...]:
    with backend.database.read() as connection:
        return tuple(row.tag for row in loops.page(connection, count))


def _audit(backend: Backend, count: int, wanted: LoopFilter) -> Figures:
    with workers(backend, count) as parent:
        children = children_of(parent.pid)
        before = sum(map(processor_s, (parent.pid, *children)))
        with Memory(lambda: children_of(parent.pid)) as memory:
            started = time.perf_counter()
            run = audits.start_audit(backend, wanted)
            finished = _until_ended(backend, run.id)
            wall_s = time.perf_counter() - started
        used = sum(map(processor_s, (parent.pid, *children_of(parent.pid)))) - before
    engine_s = _engine_s(backend, int(run.id))
    return {
        "workers": count,
        "loops": run.total,
        "done": finished.done,
        "failed": finished.failed,
        "wall_s": wall_s,
        "wall_min": wall_s / 60,
        "loops_a_s": run.total / wall_s,
        "ms_a_loop": 1e3 * count * wall_s / max(run.total, 1),
        "engine_ms_a_loop": 1e3 * engine_s / max(finished.done, 1),
        "engine_share": engine_s / (count * wall_s),
        "engine_share_of_processor": engine_s / used if used > 0 else None,
        "peak_mb": memory.peak_mb,
        "growth": memory.growth,
    }


def _until_ended(backend: Backend, audit_id: str) -> Any:
    deadline = time.monotonic() + LONGEST_RUN_S
    while True:
        run = audits.get_audit(backend, audit_id)
        if run.ended or time.monotonic() > deadline:
            return run
        time.sleep(0.1)


def _engine_s(backend: Backend, audit_id: int) -> float:
    """Seconds inside the engine, as the workers measured them."""
    query = select(func.sum(verdicts.c.elapsed_s)).where(verdicts.c.audit_id == audit_id)
    with backend.database.read() as connection:
        return float(connection.scalar(query) or 0.0)


def _sizes(backend: Backend) -> Figures:
    """Bytes a loop and night in each of the tables that grow, indexes included."""
    with backend.database.read() as connection:
        nights = connection.scalar(select(func.count()).select_from(audit_items)) or 1
        stretches = connection.scalar(select(func.count()).select_from(tables.series)) or 1
        rows = {"series": stretches, "verdicts": nights, "verdict_details": nights, "audit_items": nights}
        return {
            table: (connection.exec_driver_sql(f"SELECT pg_total_relation_size('{table}')").scalar() or 0) / count
            for table, count in rows.items()
        }
