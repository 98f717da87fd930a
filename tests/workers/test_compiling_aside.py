"""The processes that compile for a worker belong to it, also at its end, and take turns with those of others."""

import os
import runpy
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from numba import config

from workers import process

PATIENCE_S = 120
SCRIPT = """
import sys, time
from types import SimpleNamespace
from workers import process
def part(name):
    def work():
        print(name, flush=True)
        {then}
    return work
process.warming = SimpleNamespace(identifications=part("identifications"), verdicts=part("verdicts"))
process.reading = SimpleNamespace(warm_up=part("reading"))
process.compile_kernels = part("explanations")
process._compile_aside()
"""


KERNEL = """
from numba import njit

@njit(cache=True)
def twice(x):
    return 2 * x
"""


def test_a_worker_compiles_aside_only_what_it_does_not_find(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "cache"))
    kernel = tmp_path / "kernel.py"
    kernel.write_text(KERNEL)
    monkeypatch.setattr(process, "_load", lambda: runpy.run_path(str(kernel))["twice"](1.0))
    assert not process._all_were_compiled()
    process._load()
    assert process._all_were_compiled()
    kernel.write_text(KERNEL.replace("2", "3"))
    assert not process._all_were_compiled()


def started(cache: Path, then: str) -> subprocess.Popen[bytes]:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    return subprocess.Popen([sys.executable, "-c", SCRIPT.format(then=then)], stdout=subprocess.PIPE, env=environment)


def said(worker: subprocess.Popen[bytes]) -> list[str]:
    return worker.communicate(timeout=PATIENCE_S)[0].decode().split()


def test_what_compiles_for_a_killed_worker_ends(tmp_path: Path) -> None:
    worker = started(tmp_path, "time.sleep(3600)")
    assert worker.stdout is not None
    assert {worker.stdout.readline(), worker.stdout.readline()} == {b"identifications\n", b"verdicts\n"}
    os.kill(worker.pid, signal.SIGKILL)
    worker.wait()
    closed, _, _ = select.select([worker.stdout], [], [], PATIENCE_S)  # the other end is the compiling processes' own
    assert closed
    assert worker.stdout.read() == b""
    worker.stdout.close()


def test_two_workers_of_one_cache_compile_one_after_the_other(tmp_path: Path) -> None:
    """And a half that fails keeps neither from going on."""
    fault = "assert name != 'verdicts'; print(time.monotonic(), flush=True); time.sleep(1.0)"
    first, second = (said(worker) for worker in [started(tmp_path, fault) for _ in range(2)])
    assert sorted(word for word in first if word.isalpha()) == ["identifications", "verdicts"]
    assert sorted(word for word in second if word.isalpha()) == ["identifications", "verdicts"]
    began = [float(next(word for word in words if not word.isalpha())) for words in (first, second)]
    assert abs(began[0] - began[1]) >= 1.0
