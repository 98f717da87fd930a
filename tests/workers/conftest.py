"""A plant with real worker processes, on the embedded default and on PostgreSQL with Redis."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.context import ForkServerProcess
from pathlib import Path

import numpy as np
import pytest

from app.services.backend import Backend
from app.services.intake import uploads
from app.services.outward import UploadOut
from app.services.upkeep.tables import migrate
from app.settings import Settings
from tests.forked import FORKED
from tests.workers.run_process import run

QUICK = {
    "LOOPAUDIT_SWEEP_S": "0.5",
    "LOOPAUDIT_STALLED_S": "1",
    "LOOPAUDIT_LEASE_S": "5",
    "LOOPAUDIT_LOOP_LIMIT_S": "1",
    "LOOPAUDIT_CHUNK_LOOPS": "4",
    "LOOPAUDIT_MAX_ATTEMPTS": "2",
}


@dataclass
class Plant:
    """A backend, and the processes that were started for it."""

    backend: Backend
    environment: dict[str, str]
    log: Path
    running: list[ForkServerProcess] = field(default_factory=list)

    def start(self, what: str, **spoiled: str) -> ForkServerProcess:
        """Starts a worker or a beat in a session of its own."""
        environment = {**os.environ, **self.environment, **{f"SPOILED_{k}": v for k, v in spoiled.items()}}
        self.log.touch()  # it is read at once
        process = FORKED.Process(target=run, name=what, args=(what, environment, self.log), daemon=True)
        process.start()
        while os.getsid(process.pid) != process.pid:
            time.sleep(0.001)
        self.running.append(process)
        return process

    def kill(self, process: ForkServerProcess) -> None:
        """As a power cut: the process with its children, at once."""
        os.killpg(process.pid, signal.SIGKILL)
        process.join()
        self.running.remove(process)

    def send(self, name: str, data: bytes) -> UploadOut:
        with uploads.receive(self.backend, filename=name) as receiving:
            receiving.write(data)
            return receiving.commit().upload

    def wait(self, what: str, true: Callable[[], bool], seconds: float = 120.0) -> None:
        until = time.monotonic() + seconds
        while not true():
            dead = [process for process in self.running if process.exitcode not in (None, 0)]
            if time.monotonic() > until or dead:
                pytest.fail(f"{what}: not within {seconds} s; ended: {dead}\n{self.log.read_text()[-4000:]}")
            time.sleep(0.05)


def ended_with(process: ForkServerProcess) -> int | None:
    """Its exit code; None: it has not ended within a minute."""
    process.join(60)
    return process.exitcode


@contextmanager
def plant_behind(broker_url: str, folder: Path) -> Iterator[Plant]:
    """A plant on SQLite whose processes hear a broker that may refuse: they are killed at the end."""
    settings = Settings(data_dir=folder / "data", broker_url=broker_url)
    environment = {"LOOPAUDIT_DATA_DIR": str(settings.data_dir), "LOOPAUDIT_BROKER_URL": broker_url}
    migrate(settings)
    made = Plant(Backend.open(settings), {**QUICK, **environment}, folder / "processes.log")
    yield made
    for process in list(made.running):
        made.kill(process)
    made.backend.close()


def export(loops: int, rows: int = 150) -> bytes:
    tags = [f"FIC{i}" for i in range(loops)]
    lines = ["time," + ",".join(f"{tag}.PV,{tag}.OP" for tag in tags)]
    for i in range(rows):
        pair = f"{20 + 2 * np.sin(i / 6 - 0.8) + 0.1 * np.cos(i * 1.9):.3f},{50 + 5 * np.sin(i / 6):.3f}"
        lines.append(f"{1_750_000_000 + 60 * i}," + ",".join([pair] * loops))
    return "\n".join(lines).encode()


@pytest.fixture(scope="session")
def small_export() -> bytes:
    """Ten loops, 150 minutes."""
    return export(10)


@pytest.fixture(params=["embedded", "servers"])
def plant(request: pytest.FixtureRequest, tmp_path: Path, warm_kernels: None) -> Iterator[Plant]:
    environment = {**QUICK, "LOOPAUDIT_DATA_DIR": str(tmp_path)}
    if request.param == "servers":
        environment["LOOPAUDIT_BROKER_URL"] = request.getfixturevalue("redis_url")
        environment["LOOPAUDIT_DATABASE_URL"] = request.getfixturevalue("emptied_postgres")
    names = {name.removeprefix("LOOPAUDIT_").lower(): value for name, value in environment.items()}
    settings = Settings(**names)
    migrate(settings)
    made = Plant(Backend.open(settings), environment, tmp_path / "processes.log")
    yield made
    for process in made.running:
        process.terminate()
    for process in made.running:
        process.join(10)
        if process.exitcode is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.join()
    made.backend.close()
