"""A Redis that has no memory left answers, and takes nothing: that is told, and whoever rings goes on."""

import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
import redis

from app.queue import Queue
from app.settings import Settings


@pytest.fixture
def server(tmp_path: Path) -> Iterator[redis.Redis]:
    program = shutil.which("redis-server")
    if program is None:
        pytest.skip("no redis-server to be started")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    settings = ["--bind", "127.0.0.1", "--save", "", "--maxmemory-policy", "noeviction", "--dir", str(tmp_path)]
    with subprocess.Popen([program, "--port", str(port), *settings], stdout=subprocess.DEVNULL) as process:
        client = redis.Redis(port=port)
        for _ in range(100):
            with suppress(redis.ConnectionError):
                client.ping()
                break
            time.sleep(0.05)
        yield client
        client.close()
        process.terminate()


def test_a_redis_without_memory_is_no_broker(server: redis.Redis, tmp_path: Path) -> None:
    port = server.get_connection_kwargs()["port"]
    queue = Queue(Settings(data_dir=tmp_path, broker_url=f"redis://127.0.0.1:{port}/0", database_url="postgresql:///n"))
    assert queue.reachable()
    assert queue.read_upload(1)
    server.config_set("maxmemory", 1)
    assert server.ping()
    assert not queue.reachable()
    assert not queue.read_upload(2)
    server.config_set("maxmemory", 0)
    assert queue.reachable()
    assert queue.read_upload(3)
    queue.close()
