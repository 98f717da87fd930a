"""Compiled kernels must not outlive the source that they were compiled from."""

import os
import subprocess
import sys
from pathlib import Path

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


def test_the_folder_changes_with_any_line_of_the_engine(tmp_path, monkeypatch):
    (tmp_path / "armax").mkdir()
    (tmp_path / "armax" / "kernel.py").write_text("x = 1\n")
    monkeypatch.setattr(kernel_cache, "ENGINE", tmp_path)
    before = kernel_cache._source_digest()
    (tmp_path / "armax" / "kernel.py").write_text("x = 2\n")
    assert kernel_cache._source_digest() != before


def test_a_folder_in_the_users_cache_is_chosen_unless_one_was_named(tmp_path):
    assert chosen(tmp_path).startswith(str(tmp_path / "loopaudit" / "kernels"))
    assert chosen(tmp_path, NUMBA_CACHE_DIR="/elsewhere") == "/elsewhere"


def test_a_closed_home_leaves_the_choice_to_numba(tmp_path):
    (tmp_path / "file").write_text("")
    assert chosen(tmp_path / "file") == ""
