"""Compiled kernels must not outlive the source that they were compiled from."""

import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from app import kernel_cache


def chosen(folder: Path, **environment: str) -> str:
    clean = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    code = "import app, os; print(os.environ.get('NUMBA_CACHE_DIR', ''))"
    run = subprocess.run(
        [sys.executable, "-c", code],
        env=clean | {"XDG_CACHE_HOME": str(folder)} | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return run.stdout.strip()


def engine(folder: Path, monkeypatch, **sources: str):
    """A stand-in for the engine: one file a keyword, its folders written with __ between."""
    for name, text in sources.items():
        path = folder.joinpath(*name.split("__")).with_suffix(".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.setattr(kernel_cache, "ENGINE", folder)
    return kernel_cache._source_digest()


def test_the_folder_changes_with_a_kernel_and_with_all_that_it_imports(tmp_path, monkeypatch):
    kernel = "from numba import njit\nfrom app.engine.valve import (\n    he,\n    kano,\n)\n"
    before = engine(
        tmp_path, monkeypatch, armax__kernel=kernel, valve__kano="from app.engine import sampled\n", sampled=""
    )
    assert engine(tmp_path, monkeypatch, sampled="x = 2\n") != before
    assert engine(tmp_path, monkeypatch, sampled="") == before
    assert engine(tmp_path, monkeypatch, armax__kernel=kernel + "x = 1\n") != before


def test_the_folder_outlives_a_change_that_no_kernel_sees(tmp_path, monkeypatch):
    before = engine(tmp_path, monkeypatch, kernel="import numba\n", verdict="from app.engine import kernel\n")
    assert engine(tmp_path, monkeypatch, verdict="threshold = 0.5\n") == before


def test_a_folder_in_the_users_cache_is_chosen_unless_one_was_named(tmp_path):
    assert chosen(tmp_path).startswith(str(tmp_path / "loopaudit" / "kernels"))
    assert chosen(tmp_path, NUMBA_CACHE_DIR="/elsewhere") == "/elsewhere"


def test_a_closed_home_leaves_the_choice_to_numba(tmp_path):
    (tmp_path / "file").write_text("")
    assert chosen(tmp_path / "file") == ""


def test_folders_of_sources_that_nobody_starts_any_more_are_dropped(tmp_path):
    kernels = tmp_path / "loopaudit" / "kernels"
    for name, days in (("left", 31), ("used", 29)):
        (kernels / name).mkdir(parents=True)
        (kernels / name / "kernel.nbc").write_text("x")
        then = time.time() - days * 86400
        os.utime(kernels / name, (then, then))
    own = Path(chosen(tmp_path))
    assert sorted(path.name for path in kernels.iterdir()) == sorted((own.name, "used"))


def test_a_start_counts_as_use(tmp_path):
    own = Path(chosen(tmp_path))
    os.utime(own, (0, 0))
    assert Path(chosen(tmp_path)) == own
    assert time.time() - own.stat().st_mtime < 3600


def test_kernels_outside_of_the_engine_count_too(tmp_path, monkeypatch):
    app = Path(kernel_cache.__file__).parent
    sources = {path: path.read_text("utf-8") for path in app.rglob("*.py") if kernel_cache.ENGINE not in path.parents}
    compiled = {path: source for path, source in sources.items() if "import njit" in source}
    imported = re.findall(r"from app\.ingest\.(\w+)\.(\w+) import", "".join(compiled.values()))
    assert compiled.keys() | {app / "ingest" / room / f"{name}.py" for room, name in imported} == set(
        kernel_cache.READERS
    )
    before = kernel_cache._source_digest()
    changed = tmp_path / "scan_kernel.py"
    changed.write_text(kernel_cache.READERS[0].read_text("utf-8") + "x = 1\n")
    monkeypatch.setattr(kernel_cache, "READERS", (changed,))
    assert kernel_cache._source_digest() != before


@pytest.mark.parametrize("folder", ["made/here", "."])
def test_one_process_compiles_at_a_time(tmp_path, monkeypatch, folder):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / folder))
    entered = threading.Event()

    def second():
        with kernel_cache.one_at_a_time():
            entered.set()

    waiting = threading.Thread(target=second, daemon=True)
    with kernel_cache.one_at_a_time():
        waiting.start()
        assert not entered.wait(0.3)
    assert entered.wait(10)


def test_who_waits_says_so_and_not_for_longer_than_it_may(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    said = []
    assert not kernel_cache.compiling()
    with kernel_cache.one_at_a_time(waits=lambda: said.append("waits")):
        assert (said, kernel_cache.compiling()) == ([], False)
        wanted = kernel_cache.one_at_a_time(time.monotonic() + 0.3, lambda: said.append("waits"))
        with pytest.raises(kernel_cache.StillCompiling), wanted:
            pass
    assert (said, kernel_cache.compiling()) == (["waits"], False)


def test_who_compiles_is_told_from_who_loads(tmp_path, monkeypatch):
    from numba.core import event

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    for _ in range(2):
        with kernel_cache.one_at_a_time():
            assert not kernel_cache.compiling()
            with event.trigger_event("numba:compile"):
                assert kernel_cache.compiling()
            with pytest.raises(kernel_cache.StillCompiling), kernel_cache.one_at_a_time(time.monotonic()):
                pass
            assert kernel_cache.compiling()
        assert not kernel_cache.compiling()


@pytest.mark.parametrize("folder", [None, "", "/proc/1/nowhere"])
def test_without_a_cache_that_can_be_written_everybody_compiles(monkeypatch, tmp_path, folder):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    if folder is not None:
        monkeypatch.setenv("NUMBA_CACHE_DIR", folder)
    with kernel_cache.one_at_a_time(), kernel_cache.one_at_a_time():
        assert list(tmp_path.iterdir()) == []
