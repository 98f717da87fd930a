"""A worker's first loops must not pay, out of their time limit, for what could be compiled before."""

import json
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from app import kernel_cache
from app.engine import compiling
from app.services.auditing import warming


def test_the_warm_up_goes_the_longest_way_through_the_engine(
    monkeypatch: pytest.MonkeyPatch, warm_kernels: None
) -> None:
    """Both searches of the reference, its widening and the size of stiction: each has kernels of its own."""
    audit, found = compiling.audit, []
    monkeypatch.setattr(compiling, "audit", lambda recording: found.append(audit(recording)))
    warming.warm_up()
    assert any(one.reference is not None and one.reference.last.two is not None for one in found)
    assert any(one.stiction_size is not None for one in found)
    assert {one.judgement.verdict for one in found} == {"stiction", "inconclusive"}  # sums of sines: PV owes OP nothing


WARMED = """
import json, os, sys
import numpy as np
from app.engine.audit import audit
from app.engine.recording import Recording
from app.lab.bench.loops import records
from numba.core.dispatcher import Dispatcher
from app.services.auditing import warming

def kernels():
    own = [module for name, module in sys.modules.items() if name.startswith("app.")]
    found = [one for module in own for one in vars(module).values() if isinstance(one, Dispatcher) and one.signatures]
    return {f"{one.py_func.__module__}.{one.py_func.__qualname__}": str(one.signatures) for one in found}

def warm(part):
    getattr(warming, part)()
    return kernels()

def compiled_later():
    loops, known = list(records(24, 900)), warm("audits")
    for loop in loops:
        audit(Recording(loop.tag, 60.0 * np.arange(900.0), loop.pv, loop.op, loop.sp))
    return {name: types for name, types in kernels().items() if known.get(name) != types}

assert kernels() == {}
for part in sys.argv[1:]:  # each in a process of its own, which has loaded nothing yet
    if not os.fork():
        print(json.dumps(compiled_later() if part == "later" else warm(part)), flush=True)
        os._exit(0)
    assert os.wait()[1] == 0
"""


def loaded(*parts: str) -> Iterator[dict[str, str]]:
    """The kernels of the project that are there after a part of the warm-up, or that ordinary loops ask for `later`,
    and the types that they are for."""
    run = subprocess.run([sys.executable, "-c", WARMED, *parts], capture_output=True, text=True, check=True)
    return map(json.loads, run.stdout.splitlines())


def test_the_halves_that_are_compiled_side_by_side_are_the_whole(warm_kernels: None) -> None:
    """What both compile they compile for the same types: numba keeps what two processes save at once under one name."""
    first, second, whole = loaded("identifications", "verdicts", "audits")
    assert min(len(first), len(second)) > 5
    assert first | second == second | first == whole
    assert len(first.keys() & second.keys()) < 10  # small ones, of what prepares a record


def test_ordinary_loops_find_every_kernel_compiled(warm_kernels: None) -> None:
    """Of loops with noise: the search for stems has kernels of its own, which what is made of sines never reaches."""
    assert list(loaded("later")) == [{}]


def test_a_warm_up_waits_for_who_compiles_for_the_same_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    warmed = threading.Event()
    monkeypatch.setattr(warming, "audits", warmed.set)
    with kernel_cache.one_at_a_time():
        threading.Thread(target=warming.warm_up, daemon=True).start()
        assert not warmed.wait(0.3)
    assert warmed.wait(10)
