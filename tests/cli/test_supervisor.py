"""Child processes of `serve`: started, started again, stopped, and never left behind."""

import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable

import pytest

from app.cli.supervisor import Child, Supervisor


def wait_for(condition: Callable[[], bool], seconds: float = 15.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.02)


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True)
    return bool(state.stdout.strip()) and not state.stdout.startswith("Z")


class Sleeping(Supervisor):
    """Children that are a small script instead of a command of ours."""

    script = "import time; time.sleep(60)"

    def command(self, child: Child) -> list[str]:
        return [sys.executable, "-c", self.script]


class Stubborn(Sleeping):
    script = (
        "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('deaf', flush=True); time.sleep(60)"
    )


@pytest.fixture
def child() -> Child:
    return Child("sleeper", ())


def test_starts_a_child_again_when_it_dies(child, capsys):
    supervisor = Sleeping([child], grace_s=5.0)
    supervisor.start()
    try:
        wait_for(lambda: child.process is not None)
        first = child.process.pid
        child.process.kill()
        wait_for(lambda: child.process is not None and child.process.pid != first)
    finally:
        supervisor.stop()
    assert "sleeper ended with code -9" in capsys.readouterr().err
    assert child.process.returncode is not None


def test_waits_longer_each_time_before_the_next_start(child):
    class Short(Sleeping):
        script = "raise SystemExit(3)"

    supervisor = Short([child], grace_s=1.0)
    supervisor.start()
    wait_for(lambda: child.pause_s >= 4.0)
    supervisor.stop()


def test_a_start_that_fails_is_said_and_tried_again(child, capsys, monkeypatch):
    """Where there is no room for one more process for a while."""
    failing, starts, own = 2, [], subprocess.Popen

    def scarce(*arguments, **options):
        starts.append(time.monotonic())
        if len(starts) <= failing:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        return own(*arguments, **options)

    monkeypatch.setattr("app.cli.supervisor.subprocess.Popen", scarce)
    child.pause_s = 0.3
    supervisor = Sleeping([child], grace_s=5.0)
    supervisor.start()
    try:
        wait_for(lambda: child.process is not None, seconds=5.0)
    finally:
        supervisor.stop()
    assert child.process.returncode is not None
    assert capsys.readouterr().err.count("sleeper could not be started (Resource temporarily unavailable); ") == failing
    first, second, third = starts
    assert (second - first >= 0.3, third - second >= 0.6) == (True, True)


def test_kills_what_does_not_listen_to_sigterm(child):
    supervisor = Stubborn([child], grace_s=0.3)
    supervisor.start()
    wait_for(lambda: child.process is not None)
    time.sleep(0.3)
    pid = child.process.pid
    supervisor.stop()
    assert not alive(pid)
    assert child.process.returncode in (-signal.SIGKILL, -signal.SIGTERM)


def test_a_child_ends_when_its_parent_is_killed():
    nursery = (
        "import subprocess, sys, time\n"
        "script = 'from app.cli.supervisor import stop_with_parent; import time; stop_with_parent(); time.sleep(60)'\n"
        "child = subprocess.Popen([sys.executable, '-c', script], stdin=subprocess.PIPE)\n"
        "print(child.pid, flush=True)\n"
        "time.sleep(60)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", nursery], stdout=subprocess.PIPE, text=True)
    pid = int(parent.stdout.readline())
    parent.stdout.close()
    time.sleep(0.5)
    assert alive(pid)
    parent.kill()
    parent.wait()
    wait_for(lambda: not alive(pid))
