"""Run by the tests in processes of their own: a worker or the schedule, with an engine that may be slow or deadly for
some loops.

SPOILED_SLOW_S: every audit and explanation takes this much longer. SPOILED_DEADLY: that of this loop kills its process.
"""

import os
import signal
import time
from collections.abc import Mapping
from pathlib import Path

from app.queue.running import run_beat, run_worker
from app.settings import Settings
from tests.forked import be_apart


def spoil() -> None:
    from app.services.auditing import chunks
    from app.services.explaining import working as explaining

    audit, slow_s, deadly = chunks.audit, float(os.environ.get("SPOILED_SLOW_S", "0")), os.environ.get("SPOILED_DEADLY")

    def spoiled(recording, config=None):
        if recording.name == deadly:
            os.kill(os.getpid(), signal.SIGKILL)
        if recording.name != "warm-up":
            time.sleep(slow_s)
        return audit(recording, config)

    explain = explaining.explain

    def spoiled_explain(comparison):
        if comparison.name == deadly:
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(slow_s)
        return explain(comparison)

    chunks.audit = spoiled
    explaining.explain = spoiled_explain


def run(what: str, environment: Mapping[str, str], log: Path) -> None:
    """As a program of its own would: with a session, streams and an environment of its own."""
    be_apart()
    file = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
    os.dup2(file, 1)
    os.dup2(file, 2)
    os.environ.clear()
    os.environ.update(environment)
    if what == "worker":
        spoil()
        run_worker(Settings(), log_level="INFO")
    else:
        run_beat(Settings(), log_level="INFO")
