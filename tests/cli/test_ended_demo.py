"""A demo leaves nothing behind, however it ends."""

import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from os import environ
from typing import ClassVar

import pytest

from app.cli import demo as demos
from app.cli.demo import running_service
from app.cli.serve import listen
from app.errors import RequestError
from app.services.upkeep.presence import SERVING
from tests import forked

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
    log, folder = tmp_path / "log", tmp_path / "demo"
    folder.mkdir()
    with log.open("wb") as told:
        demo = forked.script(KEPT_UP, int(number), env=environ | {"TMPDIR": str(folder)}, stdout=told, stderr=told)
    assert demo.wait(60) == 128 + number, log.read_text()
    assert list(folder.iterdir()) == []


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


def test_a_demo_asks_its_own_service_alone(tmp_path):
    """Though another one has taken the port already, and begins to listen while the demo's own comes up."""
    with ThreadingHTTPServer(("127.0.0.1", 0), AnsweringAnybody, bind_and_activate=False) as other:
        AnsweringAnybody.asked.clear()
        other.server_bind()
        port, data = other.server_address[1], tmp_path / "data"

        def listens_meanwhile() -> None:
            until = time.monotonic() + 60
            while not (data / SERVING).exists() and time.monotonic() < until:
                time.sleep(0.01)
            with suppress(OSError):  # the port is taken
                other.server_activate()
                other.serve_forever()

        meanwhile = threading.Thread(target=listens_meanwhile, daemon=True)
        meanwhile.start()
        with running_service(data, listen("127.0.0.1", port, at_once=True)) as client:
            assert [loop.tag for loop in client.loops()] == []
            assert client.url == f"http://127.0.0.1:{port}"
    assert AnsweringAnybody.asked == []


def test_a_demo_whose_service_ends_says_why_at_once(tmp_path, monkeypatch):
    monkeypatch.setattr(demos, "embedded_environment", lambda _: {**environ, "LOOPAUDIT_TIME_ZONE": "Nowhere/At_All"})
    began, listening = time.monotonic(), listen("127.0.0.1", 0, at_once=True)
    with (
        pytest.raises(RequestError, match=r"did not come up:\n(?s:.*)Nowhere/At_All"),
        running_service(tmp_path / "data", listening),
    ):
        pass
    assert time.monotonic() - began < demos.START_WITHIN_S / 2
