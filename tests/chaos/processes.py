"""Processes as a supervisor keeps them: restarted when they end, stopped by their ids, none left behind."""

import contextlib
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

POLL_S = 0.05
USUAL_PAUSE_S = 1.0


def children_of(pid: int) -> list[int]:
    """The processes that this one started and that are still there."""
    try:
        text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    except OSError:
        return []
    return [int(word) for word in text.split()]


def send(pid: int, number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, number)


def session_of(pid: int) -> int | None:
    with contextlib.suppress(OSError):
        return os.getsid(pid)
    return None


@dataclass
class Managed:
    """One process that must always run, in a session of its own."""

    name: str
    command: Sequence[str | Path]
    environment: Mapping[str, str]
    log: Path
    user: str | None = None
    before: Callable[[], None] | None = None
    share: int | None = None
    process: subprocess.Popen[bytes] | None = None
    pause_s: float = USUAL_PAUSE_S
    due_at: float = 0.0
    expected: bool = False
    kept: bool = True
    sessions: list[int] = field(default_factory=list)

    def start(self) -> None:
        if self.before is not None:
            self.before()
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(
                list(self.command),
                env=dict(self.environment),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
                user=self.user,
                group=self.user,
                extra_groups=None if self.user is None else [],
                cwd=Path(__file__).resolve().parents[2],
            )
        self.sessions.append(self.process.pid)
        if self.share is not None:
            # The kernel shares the processor out by session, whatever the niceness within.
            with contextlib.suppress(OSError):
                Path(f"/proc/{self.pid}/autogroup").write_text(str(-self.share))
        self.expected = False

    @property
    def pid(self) -> int:
        assert self.process is not None
        return self.process.pid

    def alive(self) -> bool:
        return self.process is not None and self.process.poll() is None

    def everyone(self) -> list[int]:
        """The process and all below it."""
        found, ahead = [], [self.pid] if self.alive() else []
        while ahead:
            pid = ahead.pop()
            found.append(pid)
            ahead += children_of(pid)
        return found


class Supervisor:
    """Starts what ends again after its pause, as a container's restart policy does; nothing else is done by hand."""

    def __init__(self, share: int | None = None) -> None:
        self.share = share
        self.managed: dict[str, Managed] = {}
        self.surprises: list[str] = []
        self._lock = threading.RLock()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="supervisor", daemon=True)

    def __getitem__(self, name: str) -> Managed:
        return self.managed[name]

    def add(self, one: Managed) -> Managed:
        with self._lock:
            self.managed[one.name] = one
            one.share = self.share
            one.start()
        if not self._thread.is_alive():
            self._thread.start()
        return one

    def kill(self, name: str, number: signal.Signals, away_s: float, *, everyone: bool = False) -> None:
        """The process (with `everyone`, all below it too) gets the signal; it comes again `away_s` after its end.

        Raises ProcessLookupError where it is away already: nothing would be done to it."""
        with self._lock:
            one = self.managed[name]
            if not one.alive():
                raise ProcessLookupError(f"{name} is away already")
            one.pause_s, one.expected = away_s, True
            for pid in reversed(one.everyone() if everyone else [one.pid]):
                send(pid, number)

    def retire(self, name: str) -> None:
        """Ends a process for good."""
        with self._lock:
            one = self.managed.pop(name)
            one.kept = False
        end([one])

    def _watch(self) -> None:
        while not self._stopping.wait(POLL_S):
            with self._lock:
                for one in self.managed.values():
                    self._look_after(one)

    def _look_after(self, one: Managed) -> None:
        if one.alive() or not one.kept:
            return
        now = time.monotonic()
        if one.process is not None:
            if not one.expected:
                self.surprises.append(f"{one.name} ended by itself with {one.process.returncode}")
            one.due_at, one.process = now + one.pause_s, None
            one.pause_s = USUAL_PAUSE_S
        elif now >= one.due_at:
            one.start()

    def stop(self) -> list[int]:
        """Ends everything, the servers last; returns the ids of processes that had to be killed though told to end."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        servers = [one for one in self.managed.values() if one.name in ("postgres", "redis")]
        end([one for one in self.managed.values() if one not in servers])
        end(servers)
        return left_of(self.managed.values())


def end(those: Sequence[Managed], seconds: float = 40.0) -> None:
    for one in those:
        if one.alive():
            for pid in one.everyone():
                send(pid, signal.SIGCONT)
            send(one.pid, signal.SIGINT if one.name == "postgres" else signal.SIGTERM)
    deadline = time.monotonic() + seconds
    for one in those:
        if one.process is None:
            continue
        try:
            one.process.wait(max(0.1, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            for pid in reversed(one.everyone()):
                send(pid, signal.SIGKILL)
            one.process.wait()


def left_of(those: Iterable[Managed]) -> list[int]:
    """Processes of the sessions that were started which still run; they are killed now."""
    sessions = {session for one in those for session in one.sessions}
    pids = [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()]
    left = [pid for pid in pids if session_of(pid) in sessions]
    for pid in left:
        send(pid, signal.SIGKILL)
    return left
