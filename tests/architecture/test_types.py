"""Types are checked, not only written."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_mypy_finds_nothing():
    checker = Path(sys.executable).with_name("mypy")
    rooms = ["app", "workers", "migrations"]
    done = subprocess.run([checker, *rooms], cwd=ROOT, capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stdout + done.stderr
