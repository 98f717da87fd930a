"""A Redis that has no memory left answers, and takes nothing: that is told, and whoever rings goes on."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.queue import Queue
from app.settings import Settings
from tests.workers.redis_server import RedisServer


@pytest.fixture
def server(tmp_path: Path) -> Iterator[RedisServer]:
    started = RedisServer(tmp_path)
    yield started
    started.kill()


def test_a_redis_without_memory_is_no_broker(server: RedisServer, tmp_path: Path) -> None:
    queue = Queue(Settings(data_dir=tmp_path, broker_url=server.url, database_url="postgresql:///none"))
    assert queue.reachable()
    assert queue.read_upload(1)
    server.set_memory(1)
    assert server.answers()
    assert not queue.reachable()
    assert not queue.read_upload(2)
    server.set_memory(0)
    assert queue.reachable()
    assert queue.read_upload(3)
    queue.close()
