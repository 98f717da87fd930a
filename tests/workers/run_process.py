"""Run as a script by the tests: workers and schedules, with an engine that may be slow or deadly for some loops.

SPOILED_SLOW_S: every audit and explanation takes this much longer. SPOILED_DEADLY: that of this loop kills its process.
"""

import mmap
import os
import signal
import time

from nursery import born

from app.queue.running import run_beat, run_worker
from app.settings import Settings, use_one_thread


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


def run(what: str) -> None:
    from workers import process

    use_one_thread()
    process.ENDING = mmap.mmap(-1, 1)  # of this worker's processes, not of all that are born here
    if what == "worker":
        spoil()
        run_worker(Settings(), log_level="INFO")
    else:
        run_beat(Settings(), log_level="INFO")


if __name__ == "__main__":
    use_one_thread()
    from workers.process import load_or_compile

    load_or_compile()
    if order := born():
        run(order.what)
