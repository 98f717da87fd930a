"""Many at once: clients that upload, one that trickles, dashboards and an audit; what was acknowledged is there.

The API is a process of its own, whose memory is looked at. LOAD_CLIENTS and LOAD_ROUNDS make it larger (`make load`).
"""

import hashlib
import os
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest

from app.services.backend import Backend
from app.services.intake.reading import read_upload
from app.services.intake.uploads import get_upload, path_of
from app.services.upkeep.operations import migrate
from app.settings import Settings

CLIENTS = int(os.environ.get("LOAD_CLIENTS", "50"))
ROUNDS = int(os.environ.get("LOAD_ROUNDS", "1"))
UPLOAD_BYTES = 200_000
ROWS = 1440
READ = 4  # uploads that are read to their end
MOST_GROWTH_MB = 150
AT_ONCE = 8  # so that 50 clients meet back pressure
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def settings(tmp_path_factory) -> Settings:
    made = Settings(data_dir=tmp_path_factory.mktemp("load"), max_uploads=AT_ONCE, max_requests=100)
    migrate(made)
    return made


@pytest.fixture(scope="module")
def api(settings) -> Iterator[tuple[str, int]]:
    """Address and process id of the API."""
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen(200)
        given = {"LOOPAUDIT_DATA_DIR": str(settings.data_dir), "LOOPAUDIT_MAX_UPLOADS": str(AT_ONCE)}
        command = [sys.executable, str(ROOT / "tests" / "load" / "api_process.py"), str(listening.fileno())]
        process = subprocess.Popen(
            command, cwd=ROOT, env={**os.environ, **given, "PYTHONPATH": str(ROOT)}, pass_fds=[listening.fileno()]
        )
        try:
            yield f"http://127.0.0.1:{listening.getsockname()[1]}", process.pid
        finally:
            process.terminate()
            process.wait(30)


def memory_mb(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1024


def export(client: int, turn: int) -> bytes:
    head = f"time,L{client}.PV,L{client}.OP\n"
    rows = "".join(f"2026-01-{turn + 1:02d} {k // 60:02d}:{k % 60:02d}:00,{k % 7},{client}\n" for k in range(ROWS))
    return (head + rows).encode().ljust(UPLOAD_BYTES)


def sent(url: str, client: int, told: Counter[int]) -> list[str]:
    """Uploads of one client, again and again until they are taken; their ids."""
    ids = []
    with httpx.Client(base_url=url, timeout=120) as connection:
        for turn in range(ROUNDS):
            while True:
                answer = connection.post("/v1/uploads", content=export(client, turn), params={"filename": "l.csv"})
                told[answer.status_code] += 1
                if answer.status_code == 202:
                    ids.append(answer.json()["id"])
                    break
                assert answer.status_code in (429, 503), answer.text
                time.sleep(min(int(answer.headers["retry-after"]), 2) / 4)
    return ids


def trickle(url: str, stop: threading.Event) -> None:
    """A client that sends a byte now and then, and holds one of the places."""
    host, port = url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port))) as connection:
        connection.sendall(b"POST /v1/uploads HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100000\r\n\r\n")
        while not stop.wait(0.2):
            connection.sendall(b"x")


def looked_at(url: str, stop: threading.Event, told: Counter[int]) -> None:
    paths = ("/v1/reliability", "/", "/v1/loops?limit=1000", "/metrics", "/readyz", "/table")
    with httpx.Client(base_url=url, timeout=120) as connection:
        while not stop.is_set():
            for path in paths:
                told[connection.get(path).status_code] += 1
            told[connection.post("/v1/audits", json={}).status_code] += 1


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory of a process is read from /proc")
def test_many_at_once_and_nothing_acknowledged_is_lost(api, settings):
    url, pid = api
    httpx.get(f"{url}/readyz", timeout=60).raise_for_status()
    before_mb = memory_mb(pid)
    uploads, looks, stop, most_mb = Counter(), Counter(), threading.Event(), before_mb
    with ThreadPoolExecutor(CLIENTS + 3) as pool:
        beside = [pool.submit(trickle, url, stop), *(pool.submit(looked_at, url, stop, looks) for _ in range(2))]
        sending = [pool.submit(sent, url, client, uploads) for client in range(CLIENTS)]
        while not all(future.done() for future in sending):
            most_mb = max(most_mb, memory_mb(pid))
            time.sleep(0.1)
        stop.set()
        ids = [found for future in sending for found in future.result()]
        for future in beside:
            future.result()
    print(f"{len(ids)} uploads, answers {dict(uploads)}, looks {dict(looks)}, {before_mb:.0f} -> {most_mb:.0f} MB")
    assert len(set(ids)) == CLIENTS * ROUNDS
    assert uploads[503] > 0
    assert set(looks) <= {200, 202, 429, 503}
    assert most_mb - before_mb < MOST_GROWTH_MB
    assert kept(settings, ids) == len(ids)


def kept(settings: Settings, ids: list[str]) -> int:
    """How many of the acknowledged uploads are there, byte for byte; some of them are read as a worker does."""
    backend = Backend.open(settings)
    try:
        for upload_id in ids[:READ]:
            read_upload(backend, int(upload_id), "load")
            assert get_upload(backend, upload_id).rows_kept == ROWS
        fingerprints = [get_upload(backend, upload_id).fingerprint for upload_id in ids]
        return sum(hashlib.sha256(path_of(backend, each).read_bytes()).hexdigest() == each for each in fingerprints)
    finally:
        backend.close()
