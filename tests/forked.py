"""Processes of ours, forked from one that has loaded the program and its kernels: that was most of what a start costs.
That commands start by themselves is asked in e2e, in chaos and, of the rest, in cli.
"""

import mmap
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context, parent_process, reduction
from pathlib import Path
from threading import Thread
from typing import IO, Any

FORKED = get_context("forkserver")
FORKED.set_forkserver_preload(["tests.workers.loaded"])
STREAMS = (("stdin", "r", "strict"), ("stdout", "w", "strict"), ("stderr", "w", "backslashreplace"))


class Given:
    """An open file that a forked process is given; there, its number."""

    def __init__(self, file: IO[Any]) -> None:
        self._file = file

    def __reduce__(self) -> tuple[Any, ...]:
        return _number, (reduction.DupFd(self._file.fileno()),)


def _number(given: Any) -> int:
    return int(given.detach())


@dataclass(frozen=True)
class Place:
    """Where a process runs."""

    environment: Mapping[str, str]
    folder: Path


class Forked:
    """A process in a session of its own; what `subprocess.Popen` is for one that is started."""

    def __init__(
        self,
        what: Callable[..., None],
        *told: object,
        env: Mapping[str, str] | None,
        cwd: Path | None = None,
        stdout: IO[Any],
        stderr: IO[Any],
    ) -> None:
        place = Place(dict(os.environ if env is None else env), cwd or Path.cwd())
        with Path(os.devnull).open("rb") as nothing:
            streams = tuple(map(Given, (nothing, stdout, stderr)))
            self._process = FORKED.Process(target=_apart, args=(what, told, place, streams), daemon=True)
            self._process.start()
        assert self._process.pid is not None
        self.pid = self._process.pid
        with suppress(ProcessLookupError):
            while os.getsid(self.pid) != self.pid:
                time.sleep(0.001)

    @property
    def returncode(self) -> int | None:
        return self._process.exitcode

    poll = returncode.fget

    def wait(self, timeout: float) -> int:
        self._process.join(timeout)
        code = self.returncode
        if code is None:
            raise subprocess.TimeoutExpired(self._process.name, timeout)
        return code

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def send_signal(self, number: signal.Signals) -> None:
        if self.returncode is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)
        self._process.join()


def command(
    *arguments: object,
    env: Mapping[str, str] | None = None,
    cwd: Path | None = None,
    stdout: IO[Any],
    stderr: IO[Any],
) -> Forked:
    """A `loopaudit` command."""
    return Forked(_command, *map(str, arguments), env=env, cwd=cwd, stdout=stdout, stderr=stderr)


def script(
    text: str, *arguments: object, env: Mapping[str, str] | None = None, stdout: IO[Any], stderr: IO[Any]
) -> Forked:
    """As `python -c` would run it."""
    return Forked(_script, text, *map(str, arguments), env=env, stdout=stdout, stderr=stderr)


def run(
    *arguments: object,
    env: Mapping[str, str] | None = None,
    cwd: Path | None = None,
    stdout: IO[Any] | None = None,
    stderr: IO[Any] | None = None,
    timeout: float = 120,
) -> subprocess.CompletedProcess[str]:
    """A command until its end: its exit code, and what it wrote."""
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        running = command(*arguments, env=env, cwd=cwd, stdout=stdout or out, stderr=stderr or err)
        try:
            code = running.wait(timeout)
        finally:
            running.kill()
        out.seek(0)
        err.seek(0)
        return subprocess.CompletedProcess(arguments, code, out.read(), err.read())


def _command(*arguments: str) -> None:
    sys.argv = ["loopaudit", *arguments]
    from app.__main__ import main

    main()


def _script(text: str, *arguments: str) -> None:
    sys.argv = ["-c", *arguments]
    exec(compile(text, "<script>", "exec"), {"__name__": "__main__"})  # noqa: S102 - a script of a test


def _apart(what: Callable[..., None], told: tuple[str, ...], place: Place, streams: tuple[int, int, int]) -> None:
    """As a program of its own: with a session, streams and an environment of its own."""
    be_apart()
    for number, (given, (name, mode, errors)) in enumerate(zip(streams, STREAMS, strict=True)):
        os.dup2(given, number)
        os.close(given)
        setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", errors=errors, closefd=False))
    sys.stderr.reconfigure(line_buffering=True)
    os.environ.clear()
    os.environ.update(place.environment)
    os.chdir(place.folder)
    tempfile.tempdir = None  # which those settings may name
    # Tests that were started in the background may pass over interrupts, and their processes would do so too.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    what(*told)


def be_apart() -> None:
    """A session of its own, which ends with the tests, and no memory that it shares with others of one server."""
    os.setsid()
    Thread(target=_end_with_the_tests, daemon=True).start()
    from workers import process

    process.ENDING = mmap.mmap(-1, 1)


def _end_with_the_tests() -> None:
    """Kills this session of processes once that of the tests was killed: nobody else would end it."""
    tests = parent_process()
    assert tests is not None
    tests.join()
    os.killpg(0, signal.SIGKILL)
