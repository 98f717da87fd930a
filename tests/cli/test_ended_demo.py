"""A demo leaves nothing behind, however it ends."""

import signal
import subprocess
import sys
from os import environ

import pytest

KEPT_UP = """
import os, signal, sys, time
from contextlib import contextmanager
from app.cli import demo
from app.services import demo as plants

signal.signal(int(sys.argv[1]), signal.SIG_DFL)  # as at a terminal, whoever runs the tests

@contextmanager
def ended_meanwhile(*_):
    os.kill(os.getpid(), int(sys.argv[1]))
    time.sleep(10)
    yield

plants.plant, plants.write_exports, demo.running_service = list, lambda folder, _: folder.mkdir(), ended_meanwhile
demo.demo(serve=True, port=0)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_demo_whose_terminal_is_closed_takes_its_folder_away(tmp_path, number):
    command = [sys.executable, "-c", KEPT_UP, str(int(number))]
    done = subprocess.run(command, env=environ | {"TMPDIR": str(tmp_path)}, capture_output=True, timeout=60)
    assert done.returncode == 128 + number, done.stderr
    assert list(tmp_path.iterdir()) == []
