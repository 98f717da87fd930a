"""Where the tests' workers and schedules are born: of one process that has loaded engine and kernels once, which is
what three of four seconds of a start were. That a worker starts by itself is asked in e2e, chaos and cli.
"""

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from signal import SIGTERM

SCRIPT = Path(__file__).with_name("run_process.py")
LOOK_S = 0.02


class Nursery:
    """Orders go to its process as lines of JSON; it says which processes were born of them, and how they ended."""

    def __init__(self) -> None:
        self.ended: dict[int, int] = {}
        self._born: list[int] = []
        self._rest = b""
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, what: str, environment: Mapping[str, str], log: Path) -> "Born":
        """A worker or a beat in a session of its own, as it would be of a program of its own."""
        if self._process is None:
            command = [sys.executable, str(SCRIPT)]
            self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        log.touch()
        order = {"what": what, "environment": dict(environment), "log": str(log)}
        os.write(self._process.stdin.fileno(), json.dumps(order).encode() + b"\n")
        while not self._born:
            self.hear(60.0)
        return Born(self._born.pop(), (what,), self)

    def hear(self, seconds: float) -> None:
        """What the process has said by then; less is waited where it says something."""
        out = self._process.stdout.fileno()
        if not select.select([out], [], [], seconds)[0]:
            return
        said = os.read(out, 65536)
        assert said, "the nursery ended"
        *lines, self._rest = (self._rest + said).split(b"\n")
        for told in map(json.loads, lines):
            if "code" in told:
                self.ended[told["pid"]] = told["code"]
            else:
                self._born.append(told["pid"])

    def close(self) -> None:
        if self._process is not None:
            with self._process as process:
                process.stdin.close()
                process.wait(60)


@dataclass
class Born:
    """A process of the nursery, as subprocess has its own."""

    pid: int
    args: tuple[str, ...]
    nursery: Nursery = field(repr=False)

    def poll(self) -> int | None:
        self.nursery.hear(0.0)
        return self.nursery.ended.get(self.pid)

    def wait(self, seconds: float = 60.0) -> int:
        until = time.monotonic() + seconds
        while (code := self.poll()) is None:
            if time.monotonic() > until:
                raise subprocess.TimeoutExpired(self.args, seconds)
            self.nursery.hear(LOOK_S)
        return code

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(SIGTERM)


@dataclass(frozen=True)
class Order:
    what: str
    environment: dict[str, str]
    log: str


def born() -> Order | None:
    """In the nursery: waits for orders, and returns with each in a process of its own; None: there are no more."""
    alive, rest = set[int](), b""
    while True:
        for pid in [*alive]:
            done, status = os.waitpid(pid, os.WNOHANG)
            if done:
                alive.remove(pid)
                _say(pid=pid, code=os.waitstatus_to_exitcode(status))
        if not select.select([0], [], [], LOOK_S if alive else None)[0]:
            continue
        asked = os.read(0, 65536)
        if not asked:
            return None
        *lines, rest = (rest + asked).split(b"\n")
        for order in (Order(**json.loads(line)) for line in lines):
            pid = os.fork()
            if not pid:
                _begin(order)
                return order
            alive.add(pid)
            _say(pid=pid)


def _say(**told: int) -> None:
    os.write(1, json.dumps(told).encode() + b"\n")


def _begin(order: Order) -> None:
    """A session, streams and an environment of its own."""
    os.setsid()
    log = os.open(order.log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
    nothing = os.open(os.devnull, os.O_RDONLY)
    for stream, instead in ((0, nothing), (1, log), (2, log)):
        os.dup2(instead, stream)
    os.environ.clear()
    os.environ.update(order.environment)
