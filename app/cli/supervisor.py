"""Keeps child processes running beside the API on the embedded default: restarted when they die, stopped with it."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from app.cli.messages import say

POLL_S = 0.2
FIRST_PAUSE_S = 1.0
LONGEST_PAUSE_S = 30.0
STABLE_AFTER_S = 60.0


@dataclass
class Child:
    """One `loopaudit` command that must always run."""

    name: str
    arguments: tuple[str, ...]
    process: subprocess.Popen[bytes] | None = None
    started_at: float = 0.0
    due_at: float = 0.0
    pause_s: float = field(default=FIRST_PAUSE_S)


class Supervisor:
    """Starts the children, starts them again with a growing pause when they end, and ends them all on `stop`.

    A child has a pipe to this process as its stdin: should this process be killed, the pipe closes and the child stops
    by itself (see `stop_with_parent`).
    """

    def __init__(self, children: list[Child], grace_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._children = children
        self._grace_s = grace_s
        self._clock = clock
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="supervisor", daemon=True)

    def command(self, child: Child) -> list[str]:
        """How the child is started: as a command of this very installation."""
        return [sys.executable, "-m", "app", *child.arguments]

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """SIGTERM to all, SIGKILL to the process group of what is still there after the grace period."""
        self._stopping.set()
        self._thread.join()
        running = [child.process for child in self._children if child.process and child.process.poll() is None]
        for process in running:
            process.terminate()
        deadline = self._clock() + self._grace_s
        for process in running:
            try:
                process.wait(max(0.1, deadline - self._clock()))
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
            close_pipe(process)

    def _watch(self) -> None:
        while not self._stopping.is_set():
            for child in self._children:
                self._look_after(child)
            self._stopping.wait(POLL_S)

    def _look_after(self, child: Child) -> None:
        now = self._clock()
        if child.process is None:
            if now >= child.due_at:
                self._launch(child, now)
        elif (code := child.process.poll()) is not None:
            child.pause_s = FIRST_PAUSE_S if now - child.started_at > STABLE_AFTER_S else child.pause_s
            close_pipe(child.process)
            child.process = None
            put_off(child, now, f"ended with code {code}")

    def _launch(self, child: Child, now: float) -> None:
        try:
            child.process = subprocess.Popen(self.command(child), stdin=subprocess.PIPE, start_new_session=True)  # noqa: S603 - our own command
        except OSError as error:  # no room for one more process, which may pass: this thread must outlive it
            put_off(child, now, f"could not be started ({error.strerror})")
        else:
            child.started_at = now


def put_off(child: Child, now: float, why: str) -> None:
    """The next start waits, and the one after that twice as long."""
    say(f"loopaudit: {child.name} {why}; starting it again in {child.pause_s:.0f} s", "warning")
    child.due_at = now + child.pause_s
    child.pause_s = min(2 * child.pause_s, LONGEST_PAUSE_S)


def close_pipe(process: "subprocess.Popen[bytes]") -> None:
    if process.stdin is not None:
        process.stdin.close()


def stop_with_parent() -> None:
    """For a child: SIGTERM to itself as soon as stdin, a pipe that the parent holds open, is closed."""

    def wait() -> None:
        while os.read(0, 1024):
            pass
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=wait, name="parent", daemon=True).start()
