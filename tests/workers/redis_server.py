"""A Redis of a test's own, which may be ended and started again at its port."""

import shutil
import socket
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import pytest
import redis

ANSWERS_IN_S = 10.0


class RedisServer:
    """Keeps nothing: each end of it is the loss of its memory."""

    def __init__(self, folder: Path) -> None:
        program = shutil.which("redis-server")
        if program is None:
            pytest.skip("no redis-server to be started")
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        settings = ["--bind", "127.0.0.1", "--save", "", "--maxmemory-policy", "noeviction", "--dir", str(folder)]
        self.command = [program, "--port", str(self.port), *settings]
        self.start()

    @property
    def url(self) -> str:
        return f"redis://127.0.0.1:{self.port}/0"

    def start(self) -> None:
        self.process = subprocess.Popen(self.command, stdout=subprocess.DEVNULL)
        until = time.monotonic() + ANSWERS_IN_S
        while not self.answers():
            assert time.monotonic() < until, "redis-server does not answer"
            time.sleep(0.05)

    def answers(self) -> bool:
        with suppress(redis.ConnectionError), redis.Redis(port=self.port) as client:
            return bool(client.ping())
        return False

    def set_memory(self, most_bytes: int) -> None:
        """0: as much as there is."""
        with redis.Redis(port=self.port) as client:
            client.config_set("maxmemory", most_bytes)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()
