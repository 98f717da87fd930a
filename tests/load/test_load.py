"""Many at once: clients that upload, one that trickles, dashboards, a worker that reads what came and audits its loops
over and over; what was acknowledged is there and read, and every run has ended.

API, worker and schedule are processes of their own; the memory of the API is looked at. LOAD_CLIENTS and LOAD_ROUNDS
make it larger (`make load`).
"""

import hashlib
import os
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from functools import lru_cache
from math import sin
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.services.auditing.audits import get_audit
from app.services.backend import Backend
from app.services.intake.uploads import get_upload, path_of
from app.settings import Settings

CLIENTS = int(os.environ.get("LOAD_CLIENTS", "25"))
ROUNDS = int(os.environ.get("LOAD_ROUNDS", "1"))
UPLOAD_BYTES = 200_000
ROWS = 1440
READ = 5  # uploads that are read before the clients stop to send
FIRST = 4  # loops that are there before the load: the first audits have something to do
OSCILLATING = 8  # loops that the whole method is run on; the controllers of the others are in manual
PATIENCE_S = 900.0
MOST_GROWTH_MB = 150
BETWEEN_LOOKS_S = 0.5  # of a dashboard: without any pause two of them keep a core from what they look at
AT_ONCE = 8  # so that the clients meet back pressure
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def backend(open_plant) -> Backend:
    return open_plant(max_uploads=AT_ONCE, max_requests=100)


@pytest.fixture(scope="module")
def settings(backend) -> Settings:
    return backend.settings


@pytest.fixture(scope="module")
def environment(settings) -> dict[str, str]:
    given = {"LOOPAUDIT_DATA_DIR": str(settings.data_dir), "LOOPAUDIT_MAX_UPLOADS": str(AT_ONCE)}
    own = {name: value for name, value in os.environ.items() if not name.startswith("LOOPAUDIT_")}
    return {**own, **given, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}


@contextmanager
def running(command: list[str], environment: dict[str, str], **more: Any) -> Iterator[int]:
    """A process until the end of the block; its id."""
    process = subprocess.Popen([sys.executable, *command], cwd=ROOT, env=environment, **more)
    try:
        yield process.pid
    finally:
        process.terminate()
        process.wait(60)


@pytest.fixture(scope="module")
def api(environment) -> Iterator[tuple[str, int]]:
    """Address and process id of the API."""
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen(200)
        command = ["tests/load/api_process.py", str(listening.fileno())]
        with running(command, environment, pass_fds=[listening.fileno()]) as pid:
            yield f"http://127.0.0.1:{listening.getsockname()[1]}", pid


@pytest.fixture(scope="module")
def work(environment, warm_kernels, tmp_path_factory) -> Iterator[None]:
    """A worker and the schedule, as they are run by the command line."""
    with (tmp_path_factory.mktemp("logs") / "work.log").open("wb") as log, ExitStack() as stack:
        for name in ("worker", "beat"):
            stack.enter_context(running(["-m", "app", name], environment, stdout=log, stderr=log))
        yield


def memory_mb(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1024


@lru_cache(maxsize=100)  # it is sent again and again, and what the clients cost is not what is asked
def export(client: int, turn: int) -> bytes:
    head = f"time,L{client}.PV,L{client}.OP\n"
    swing = 5 if client < OSCILLATING else 0
    rows = "".join(
        f"2026-01-{turn + 1:02d} {k // 60:02d}:{k % 60:02d}:00,{k % 7 / 20 + swing * sin(k / 6 - 0.8):.2f},"
        f"{50 + swing * sin(k / 6):.2f}\n"
        for k in range(ROWS)
    )
    return (head + rows).encode().ljust(UPLOAD_BYTES)


def sent(url: str, client: int, told: Counter[int], turns: Iterable[int]) -> Iterator[str]:
    """Uploads of one client, again and again until they are taken; their ids."""
    with httpx.Client(base_url=url, timeout=120) as connection:
        for turn in turns:
            while True:
                answer = connection.post("/v1/uploads", content=export(client, turn), params={"filename": "l.csv"})
                told[answer.status_code] += 1
                if answer.status_code == 202:
                    yield answer.json()["id"]
                    break
                assert answer.status_code in (429, 503), answer.text
                time.sleep(min(int(answer.headers["retry-after"]), 2) / 4)


def sent_until(url: str, client: int, told: Counter[int], acknowledged: list[str], enough: threading.Event) -> None:
    """Every round of a client; then its last one again, which is the same upload, until the worker has kept up."""
    acknowledged.extend(sent(url, client, told, range(1, ROUNDS + 1)))
    while not enough.wait(1):
        assert next(sent(url, client, told, [ROUNDS])) in acknowledged


def trickle(url: str, stop: threading.Event) -> None:
    """A client that sends a byte now and then, and holds one of the places."""
    host, port = url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port))) as connection:
        connection.sendall(b"POST /v1/uploads HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100000\r\n\r\n")
        while not stop.wait(0.2):
            connection.sendall(b"x")


def looked_at(url: str, stop: threading.Event, told: Counter[int]) -> None:
    paths = ("/v1/reliability", "/", "/v1/loops?limit=1000", "/v1/uploads", "/metrics", "/readyz", "/table")
    with httpx.Client(base_url=url, timeout=120) as connection:
        while not stop.is_set():
            for path in paths:
                told[connection.get(path).status_code] += 1
            stop.wait(BETWEEN_LOOKS_S)


def audited(url: str, stop: threading.Event, told: Counter[int]) -> list[str]:
    """Audits of the plant, one after the other; their ids."""
    runs: list[str] = []
    with httpx.Client(base_url=url, timeout=120) as connection:
        while not stop.is_set():
            answer = connection.post("/v1/audits", json={})
            told[answer.status_code] += 1
            if answer.status_code == 202:
                runs.append(answer.json()["id"])
                until(lambda: connection.get(f"/v1/audits/{runs[-1]}").json().get("ended_at"), "the run ends")
            else:
                stop.wait(1)
    return runs


def until(true: Callable[[], Any], what: str) -> None:
    ends_s = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < ends_s, f"not in time: {what}"
        time.sleep(0.2)


@pytest.mark.timeout(1800)
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory of a process is read from /proc")
def test_many_at_once_and_nothing_acknowledged_is_lost(api, work, settings, backend):
    url, pid = api
    httpx.get(f"{url}/readyz", timeout=60).raise_for_status()
    first = [one for client in range(FIRST) for one in sent(url, client, Counter(), [0])]
    until(lambda: len(read_of(backend, first)) == FIRST, "the first uploads are read")
    before_mb = memory_mb(pid)
    most_mb, ids, uploads, looks = before_mb, [], Counter(), Counter()
    stop, enough = threading.Event(), threading.Event()
    with ThreadPoolExecutor(CLIENTS + 4) as pool:
        beside = [pool.submit(trickle, url, stop), *(pool.submit(looked_at, url, stop, looks) for _ in range(2))]
        auditing = pool.submit(audited, url, stop, looks)
        sending = [pool.submit(sent_until, url, client, uploads, ids, enough) for client in range(CLIENTS)]
        ends_s = time.monotonic() + PATIENCE_S
        try:
            while not all(future.done() for future in sending):
                assert time.monotonic() < ends_s, "the uploads are not taken, or none is read"
                most_mb = max(most_mb, memory_mb(pid))
                if len(read_of(backend, ids[: 2 * READ])) >= READ:
                    enough.set()
                time.sleep(0.1)
            meanwhile = len(read_of(backend, ids))
        finally:
            enough.set()
            stop.set()
        for future in (*sending, *beside):
            future.result()
        runs = [get_audit(backend, run) for run in auditing.result()]
    until(lambda: len(read_of(backend, ids)) == len(ids), "all uploads are read")
    audits = f"{len(runs)} runs of {sum(run.total for run in runs)} loops"
    told = f"{len(ids)} uploads ({meanwhile} read meanwhile), answers {dict(uploads)}, looks {dict(looks)}, {audits}"
    print(f"{told}, {before_mb:.0f} -> {most_mb:.0f} MB")
    assert len(set(ids)) == CLIENTS * ROUNDS
    assert uploads[503] > 0
    assert set(looks) <= {200, 202, 429, 503}
    assert most_mb - before_mb < MOST_GROWTH_MB
    assert kept(backend, ids) == len(ids)
    assert runs
    assert all(run.total >= FIRST and (run.done, run.failed) == (run.total, 0) for run in runs)


def read_of(backend: Backend, ids: list[str]) -> list[str]:
    """Those that are read to their end, with every row."""
    views = [get_upload(backend, upload_id) for upload_id in ids]
    assert not [view for view in views if view.state == "failed"]
    done = [view for view in views if view.state == "done"]
    assert all(view.rows_kept == ROWS for view in done)
    return [view.id for view in done]


def kept(backend: Backend, ids: list[str]) -> int:
    """How many of the acknowledged uploads are there, byte for byte."""
    fingerprints = [get_upload(backend, upload_id).fingerprint for upload_id in ids]
    return sum(hashlib.sha256(path_of(backend, each).read_bytes()).hexdigest() == each for each in fingerprints)
