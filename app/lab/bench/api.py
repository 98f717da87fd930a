"""The API over a plant with a year of nightly verdicts, asked by a second process, idle and while an audit runs."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from urllib.parse import quote

import numpy as np
from sqlalchemy import select

from app.errors import RequestError
from app.lab.bench.bench import Bench, Figures, SkippedError
from app.lab.bench.browser import pages_open
from app.lab.bench.loops import records
from app.lab.bench.measure import Memory, Stopwatch, median_s, processor_s
from app.lab.bench.plant import load
from app.lab.bench.servers import plant_backend, service, workers
from app.lab.bench.year import fill
from app.services.addresses import tag_in_url
from app.services.auditing import audits
from app.services.backend import Backend
from app.services.plant import reliability
from app.services.plant.overview import overview
from app.storage.tables import loops as loops_table

BUSY_LOOPS = 2_500
PROBED_TAGS = 400


def run(bench: Bench) -> Figures:
    sizes = bench.sizes
    busy = min(BUSY_LOOPS, sizes.loops)
    with plant_backend(bench) as backend:
        bench.tell(f"api: {sizes.loops} loops x {sizes.nights} nights of verdicts")
        with Stopwatch() as filling:
            load(backend, records(busy))
            rows = fill(backend, sizes.loops, sizes.nights)
        found: Figures = {"loops": sizes.loops, "nights": sizes.nights, "verdict_rows": rows}
        found["filled_s"] = filling.seconds
        bench.tell("api: under load")
        with service(backend) as (url, pid), Memory(lambda: [pid]) as memory:
            paths = _paths(backend)
            found["idle"] = {name: _measured(url, pid, bench.sizes.load_s / 2, some) for name, some in paths.items()}
            found["browser"] = pages_open(url)
            with workers(backend, 2), _auditing(backend) as audited:
                found["busy"] = {name: _measured(url, pid, bench.sizes.load_s, some) for name, some in paths.items()}
            found["audits_meanwhile"] = audited
        found["peak_mb"] = memory.peak_mb
        found["summary_ms"] = 1e3 * _wall(lambda: overview(backend))
        found["cpu_ms"] = {
            "summary": 1e3 * median_s(lambda: overview(backend), 3),
            "whole_table": 1e3 * median_s(lambda: reliability.in_parts(backend, 20_000).as_json(), 3),
        }
    return found


def _paths(backend: Backend) -> dict[str, list[str]]:
    with backend.database.read() as connection:
        tags = list(connection.scalars(select(loops_table.c.tag).order_by(loops_table.c.tag)))
    chosen = np.random.default_rng(1).choice(tags, PROBED_TAGS)
    cursor = reliability.in_parts(backend, 100).next_cursor
    later = f"&cursor={quote(cursor)}" if cursor else ""
    return {
        "loop health": [f"/v1/loops/{tag_in_url(str(tag))}/health" for tag in chosen],
        "loop history, 30 nights": [f"/v1/loops/{tag_in_url(str(tag))}/verdicts?limit=30" for tag in chosen],
        "table, a page of 100": ["/v1/reliability?limit=100", f"/v1/reliability?limit=100{later}"],
        "table, worst 100": ["/v1/reliability?limit=100&sort=-stiction_probability"],
        "plant page": ["/"],
        "table page": ["/table", "/table?verdict=stiction&sort=-stiction_probability"],
        "table, whole": ["/v1/reliability?limit=20000"],
        "table, whole, worst first": ["/v1/reliability?limit=20000&sort=-stiction_probability"],
    }


def _measured(url: str, pid: int, seconds: float, paths: list[str]) -> Figures:
    command = [sys.executable, "-m", "app.lab.bench.load", url.removeprefix("http://"), str(seconds), ""]
    before = processor_s(pid)
    told = subprocess.run(command, input="\n".join(paths), capture_output=True, text=True, check=False)  # noqa: S603
    if told.returncode:
        raise SkippedError(f"the client failed: {told.stderr[-500:]}")
    answer = json.loads(told.stdout)
    used = processor_s(pid) - before
    times = 1e3 * np.array(answer["times_s"])
    p50, p90, p99 = np.percentile(times, (50, 90, 99))
    return {
        "requests": len(times),
        "wrong": answer["wrong"],
        "first_ms": float(times[0]),
        "p50_ms": float(p50),
        "p90_ms": float(p90),
        "p99_ms": float(p99),
        "max_ms": float(times.max()),
        "requests_a_s": len(times) / (times.sum() / 1e3),
        "service_cpu_ms": 1e3 * used / len(times),
        "kb": answer["bytes"] / 1e3,
    }


@contextmanager
def _auditing(backend: Backend) -> Iterator[dict[str, int]]:
    """Audits of the loops that have samples, one after the other, as long as the block lasts."""
    stop = threading.Event()
    audited = {"runs": 0, "loops": 0}

    def keep_going() -> None:
        while not stop.is_set():
            run = audits.start_audit(backend)
            while not stop.is_set() and not (seen := audits.get_audit(backend, run.id)).ended:
                time.sleep(0.5)
            audited["runs"] += 1
            audited["loops"] += seen.done
        with suppress(RequestError):  # it may have ended by itself
            audits.cancel_audit(backend, run.id)

    thread = threading.Thread(target=keep_going, daemon=True)
    thread.start()
    time.sleep(2.0)
    try:
        yield audited
    finally:
        stop.set()
        thread.join()


def _wall(work: object) -> float:
    times = []
    for _ in range(5):
        with Stopwatch() as watch:
            work()  # type: ignore[operator]
        times.append(watch.seconds)
    return float(np.median(times))
