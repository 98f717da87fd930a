"""A demo leaves nothing behind, however it ends."""

import signal
import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from os import environ
from typing import ClassVar

import pytest

from app.cli.demo import running_service
from app.errors import RequestError

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


class AnsweringAnybody(BaseHTTPRequestHandler):
    """As the service of a plant that is ready, and takes whatever is sent."""

    asked: ClassVar[list[str]] = []

    def _answer(self) -> None:
        self.asked.append(self.path)
        self.send_response(200)
        self.end_headers()

    do_GET = do_POST = do_PATCH = _answer


@pytest.fixture
def plant_at_the_port():
    AnsweringAnybody.asked.clear()
    with ThreadingHTTPServer(("127.0.0.1", 0), AnsweringAnybody) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_address[1]
        server.shutdown()


def test_a_demo_sends_nothing_to_a_service_that_has_its_port_already(plant_at_the_port):
    command = [sys.executable, "-m", "app", "demo", "--no-serve", "--port", str(plant_at_the_port)]
    done = subprocess.run(command, capture_output=True, timeout=60)
    assert done.returncode == 2
    assert b"[cannot_listen]" in done.stderr
    assert AnsweringAnybody.asked == []


def test_a_demo_asks_its_own_service_alone(plant_at_the_port, tmp_path):
    """Though the port was taken between the look at it and the start of the service."""
    with (
        pytest.raises(RequestError, match="Address already in use"),
        running_service(tmp_path / "data", plant_at_the_port),
    ):
        pass
    assert AnsweringAnybody.asked == []
