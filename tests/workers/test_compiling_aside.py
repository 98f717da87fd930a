"""The process that compiles for a worker belongs to it, also at its end."""

import os
import select
import signal
import subprocess
import sys
from pathlib import Path

PATIENCE_S = 60
SCRIPT = """
import sys, time
from types import SimpleNamespace
from pathlib import Path
from workers import process
process.current_app = SimpleNamespace(settings=SimpleNamespace(data_dir=Path(sys.argv[1])))
process.chunks = SimpleNamespace(warm_up=lambda: (print("compiling", flush=True), time.sleep(3600)))
process._compile_aside()
"""


def test_what_compiles_for_a_killed_worker_ends(tmp_path: Path) -> None:
    worker = subprocess.Popen([sys.executable, "-c", SCRIPT, str(tmp_path)], stdout=subprocess.PIPE)
    assert worker.stdout is not None
    assert worker.stdout.readline() == b"compiling\n"
    os.kill(worker.pid, signal.SIGKILL)
    worker.wait()
    closed, _, _ = select.select([worker.stdout], [], [], PATIENCE_S)  # the other end is the compiling process' own
    assert closed
    assert worker.stdout.read() == b""
    worker.stdout.close()
