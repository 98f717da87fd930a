"""The processes that compile for a worker belong to it, also at its end, and take turns with those of others."""

import gc
import os
import runpy
import select
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import BinaryIO

import pytest
from numba import config

from app import kernel_cache
from app.settings import Settings
from tests import forked
from workers import process

PATIENCE_S = 120
SCRIPT = """
import os, sys, time
from types import SimpleNamespace
from typing import BinaryIO
from app.settings import Settings
from workers import process
def say(word):  # at once: of two writes to one pipe, the second may come after what the other process says
    os.write(1, f"{{word}}\\n".encode())
def part(name):
    def work():
        say(name)
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

@njit(cache=True)
def half(x):
    return 0.5 * x
"""


@dataclass
class Start:
    """A worker that has two kernels, and what its start did: the answers of one, and how often it compiled."""

    kernel: Path
    answers: list[float] = field(default_factory=list)
    compiled_aside: int = 0

    def load(self) -> None:
        kernels = runpy.run_path(str(self.kernel))
        self.answers.append(kernels["twice"](1.0))
        kernels["half"](1.0)

    def compile_aside(self) -> None:
        """In processes of their own, whose failing is theirs."""
        self.compiled_aside += 1
        with suppress(EOFError):
            self.load()

    def again(self) -> int:
        """How often the worker, started again, compiled aside."""
        self.answers, self.compiled_aside = [], 0
        process.warm_up(SimpleNamespace())
        return self.compiled_aside


@pytest.fixture
def start(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Start]:
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(kernel_cache, "_own_folder", lambda: tmp_path / "cache")
    settings = Settings(data_dir=tmp_path)
    monkeypatch.setattr(process, "current_app", SimpleNamespace(settings=settings))
    made = Start(tmp_path / "kernel.py")
    made.kernel.write_text(KERNEL)
    monkeypatch.setattr(process, "_load", made.load)
    monkeypatch.setattr(process, "_compile_aside", made.compile_aside)
    yield made
    gc.unfreeze()


def test_a_worker_compiles_aside_only_what_it_does_not_find(start: Start) -> None:
    assert start.again() == 1
    assert start.answers == [2.0, 2.0]  # aside, then here
    assert start.again() == 0
    assert start.answers == [2.0]
    start.kernel.write_text(KERNEL.replace("2", "3"))
    assert start.again() == 1
    assert start.answers == [3.0, 3.0]


@pytest.mark.parametrize("what", ["*.nbi", "*.nbc", "*half*.nbi"])
@pytest.mark.parametrize("gone", ["nothing", "*twice*"])
def test_a_cache_that_a_power_cut_emptied_is_made_anew(start: Start, what: str, gone: str) -> None:
    assert start.again() == 1
    cache = start.kernel.parent / "cache"
    spoiled = list(cache.rglob(what))
    assert spoiled
    for path in spoiled:
        path.write_bytes(b"")
    for path in list(cache.rglob(gone)):
        path.unlink()
    assert start.again() >= 1
    assert start.answers[-1] == 2.0
    assert start.again() == 0


def test_a_cache_that_others_may_use_too_is_not_emptied(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    start.again()
    kept = sorted((start.kernel.parent / "cache").rglob("*.nb[ic]"))
    monkeypatch.setattr(kernel_cache, "_own_folder", lambda: start.kernel.parent / "elsewhere")
    kernel_cache.empty()
    assert kept
    assert sorted((start.kernel.parent / "cache").rglob("*.nb[ic]")) == kept


def test_a_kernel_is_compiled_as_ever_once_only_loading_is_over(start: Start) -> None:
    with pytest.raises(kernel_cache.NotCompiled), kernel_cache.loading_only():
        start.load()
    start.load()
    assert start.answers == [2.0]


def test_it_is_told_once_and_only_where_something_is_compiled(start: Start) -> None:
    told: list[str] = []
    with kernel_cache.told_of_compiling(lambda: told.append("compiling")):
        start.load()
    with kernel_cache.told_of_compiling(lambda: told.append("again")):
        start.load()
    assert told == ["compiling"]


def test_all_that_a_task_needs_is_loaded_before_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded: list[str] = []
    monkeypatch.setattr(process.warming, "audits", lambda: loaded.append("audits"))
    monkeypatch.setattr(process.reading, "warm_up", lambda: loaded.append("reading"))
    monkeypatch.setattr(process, "compile_kernels", lambda: loaded.append("explanations"))
    process._load()
    assert loaded == ["audits", "reading", "explanations"]
    assert "scipy.optimize" in sys.modules


def started(cache: Path, then: str) -> tuple[forked.Forked, BinaryIO]:
    """A worker's process, and what it and its own write."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    reading, writing = os.pipe()
    with os.fdopen(writing, "wb") as told, Path(os.devnull).open("wb") as nothing:
        worker = forked.script(SCRIPT.format(then=then), env=environment, stdout=told, stderr=nothing)
    return worker, os.fdopen(reading, "rb")


def said(worker: forked.Forked, told: BinaryIO) -> list[str]:
    with told:
        words = told.read().decode().split()
    assert worker.wait(PATIENCE_S) == 0
    return words


def test_what_compiles_for_a_killed_worker_ends(tmp_path: Path) -> None:
    worker, told = started(tmp_path, "time.sleep(3600)")
    with told:
        assert {told.readline(), told.readline()} == {b"identifications\n", b"verdicts\n"}
        worker.kill()
        closed, _, _ = select.select([told], [], [], PATIENCE_S)  # the other end is the compiling processes' own
        assert closed
        assert told.read() == b""


def test_two_workers_of_one_cache_compile_one_after_the_other(tmp_path: Path) -> None:
    """And a half that fails keeps neither from going on."""
    fault = "assert name != 'verdicts'; say(time.monotonic()); time.sleep(1.0)"
    first, second = (said(*worker) for worker in [started(tmp_path, fault) for _ in range(2)])
    assert sorted(word for word in first if word.isalpha()) == ["explanations", "identifications", "verdicts"]
    assert sorted(word for word in second if word.isalpha()) == ["explanations", "identifications", "verdicts"]
    began = [float(next(word for word in words if not word.isalpha())) for words in (first, second)]
    assert abs(began[0] - began[1]) >= 1.0
