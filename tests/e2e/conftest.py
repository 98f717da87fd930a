"""Services for end-to-end tests: processes that a test starts itself, on free ports, and ends by their ids."""

import contextlib
import json
import os
import secrets
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.cli.calling import run

ROOT = Path(__file__).resolve().parents[2]
REDIS_DATABASES = range(15, 8, -1)


def refuse(reason: str) -> None:
    """Skips, or fails where the servers are required."""
    if os.environ.get("LOOPAUDIT_TEST_REQUIRE_SERVERS") == "1":
        pytest.fail(f"required by LOOPAUDIT_TEST_REQUIRE_SERVERS: {reason}")
    pytest.skip(reason)


def postgres_server() -> Any:
    psycopg = pytest.importorskip("psycopg")
    address = os.environ.get("LOOPAUDIT_TEST_POSTGRES", "postgresql://postgres@127.0.0.1:5432/postgres")
    try:
        return psycopg.connect(address, autocommit=True, connect_timeout=3)
    except psycopg.OperationalError as error:
        refuse(f"no PostgreSQL server at {address}: {error}")


@pytest.fixture(scope="module")
def postgres_url() -> Iterator[str]:
    """A database of its own, dropped afterwards."""
    name = f"loopaudit_e2e_{secrets.token_hex(6)}"
    with postgres_server() as server:
        server.execute(f'CREATE DATABASE "{name}"')
        info = server.info
        yield f"postgresql+psycopg://{info.user}:{info.password}@{info.host}:{info.port}/{name}"
        server.execute(f'DROP DATABASE "{name}" WITH (FORCE)')


@pytest.fixture(scope="module")
def redis_url() -> Iterator[str]:
    """An empty database number of the local Redis, emptied afterwards."""
    redis = pytest.importorskip("redis")
    base = os.environ.get("LOOPAUDIT_TEST_REDIS", "redis://127.0.0.1:6379")
    for number in REDIS_DATABASES:
        with contextlib.closing(redis.Redis.from_url(f"{base}/{number}", socket_connect_timeout=3)) as connection:
            try:
                free = connection.set("loopaudit-e2e", "1", nx=True, ex=900) and connection.dbsize() == 1
            except redis.ConnectionError as error:
                refuse(f"no Redis server at {base}: {error}")
            if free:
                yield f"{base}/{number}"
                connection.flushdb()
                return
    refuse(f"no empty database number on {base}")


@dataclass
class Processes:
    """Commands started by a test; each has its log, all are ended by their ids."""

    folder: Path
    environment: Mapping[str, str]
    running: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def start(self, arguments: Sequence[str], **extra: str) -> subprocess.Popen[bytes]:
        log = (self.folder / f"{len(self.running)}-{arguments[0]}.log").open("wb")
        with log:
            process = subprocess.Popen(
                [sys.executable, "-m", "app", *arguments],
                cwd=ROOT,
                env={**self.environment, **extra},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
            )
        self.running.append(process)
        return process

    def run(self, *arguments: str, timeout: float = 400) -> subprocess.CompletedProcess[str]:
        """A command that ends, compiling on a busy machine included; its exit code is for the test to judge."""
        return subprocess.run(
            [sys.executable, "-m", "app", *arguments],
            cwd=ROOT,
            env=dict(self.environment),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=timeout,
        )

    def logs(self) -> str:
        return "\n".join(
            f"--- {log.name}\n{log.read_text(errors='replace')[-3000:]}" for log in self.folder.glob("*.log")
        )

    def stop(self, process: subprocess.Popen[bytes], seconds: float = 45) -> int:
        process.send_signal(signal.SIGTERM)
        try:
            return process.wait(seconds)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise

    def stop_all(self) -> None:
        for process in reversed(self.running):
            if process.poll() is None:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self.stop(process)


@pytest.fixture(scope="module")
def make_processes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Processes]]:
    """A maker of process groups with their own data directory and nothing of this shell's LOOPAUDIT_ settings."""
    made = []

    def make(**settings: str) -> Processes:
        folder = tmp_path_factory.mktemp("service")
        (folder / "data").mkdir()
        environment = {name: value for name, value in os.environ.items() if not name.startswith("LOOPAUDIT_")}
        environment |= {"LOOPAUDIT_DATA_DIR": str(folder / "data"), "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
        made.append(Processes(folder, environment | settings))
        return made[-1]

    yield make
    for processes in made:
        processes.stop_all()


def simulated(file: Path, *options: str) -> Path:
    """A recording as `loopaudit simulate` writes it, without a process of its own: that is asked in the guides."""
    done = run("simulate", *options, "--out", file)
    assert done.exit_code == 0, done.output
    return file


def wait_ready(client: httpx.Client, processes: Processes, seconds: float = 60) -> None:
    deadline = time.monotonic() + seconds
    while True:
        with contextlib.suppress(httpx.TransportError):
            if client.get("/readyz").status_code == 200:
                return
        assert all(process.poll() is None for process in processes.running), processes.logs()
        assert time.monotonic() < deadline, "not ready in time\n" + processes.logs()
        time.sleep(0.1)


def wait_until(
    ask: Callable[[], dict[str, Any]], ended: Callable[[dict[str, Any]], bool], seconds: float
) -> dict[str, Any]:
    """Asks until it has ended; an assertion with the last answer otherwise."""
    deadline = time.monotonic() + seconds
    while not ended(answer := ask()):
        assert time.monotonic() < deadline, f"not ended in time: {answer}"
        time.sleep(0.2)
    return answer


@dataclass(frozen=True)
class Service:
    """What the tests of a running service need."""

    client: httpx.Client
    processes: Processes

    def upload(self, *paths: Path, seconds: float = 180) -> list[dict[str, Any]]:
        """Sends all, then waits until all are read."""
        return [self._read(location, seconds) for location in [self._sent(path) for path in paths]]

    def _sent(self, path: Path) -> str:
        answer = self.client.post("/v1/uploads", params={"filename": path.name}, content=path.read_bytes())
        assert answer.status_code == 202, answer.text
        return answer.headers["location"]

    def _read(self, location: str, seconds: float) -> dict[str, Any]:
        return wait_until(
            lambda: self.client.get(location).json(), lambda upload: upload["state"] in ("done", "failed"), seconds
        )

    def audit(self, seconds: float = 240) -> dict[str, Any]:
        answer = self.client.post("/v1/audits", json={})
        assert answer.status_code == 202, answer.text
        location = answer.headers["location"]
        return wait_until(
            lambda: self.client.get(location).json(), lambda a: a["state"] not in ("planned", "running"), seconds
        )

    def explained_as_on_the_command_line(self, path: Path, seconds: float = 240) -> None:
        """The recording, sent over HTTP and explained there, gets what `loopaudit explain` says of the file."""
        (loop,) = self.upload(path)[0]["loops"]
        answer = self.client.post(f"/v1/loops/{loop}/explanations", json={"column": "PV_sim"})
        assert answer.status_code == 202, answer.text
        location = answer.headers["location"]
        served = wait_until(
            lambda: self.client.get(location).json(), lambda told: told["state"] in ("done", "failed"), seconds
        )
        assert served["state"] == "done", (served, self.processes.logs())
        alone = run("explain", path, "--sim", "PV_sim", "--format", "json")
        expected = {name: told for name, told in json.loads(alone.stdout).items() if name != "elapsed_s"}
        assert {name: served[name] for name in expected} == expected
        assert self.client.get(f"{location}/trace").text.startswith("time,PV,PV_given")


@pytest.fixture(scope="module")
def ready_service() -> Callable[[Processes, int], contextlib.AbstractContextManager[Service]]:
    """Waits until the service of these processes is ready and talks to it."""

    @contextlib.contextmanager
    def connect(processes: Processes, port: int) -> Iterator[Service]:
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=60) as client:
            wait_ready(client, processes)
            yield Service(client, processes)

    return connect


@pytest.fixture(scope="module")
def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
