"""What waits for hours is announced again and again: the queues of Redis end somewhere, as those of the folder do."""

from pathlib import Path

import pytest
import redis

from app.queue import READ_UPLOAD, Queue, acknowledging
from app.queue.jobs import queue_names
from app.settings import Settings
from tests.workers.redis_server import RedisServer


@pytest.mark.timeout(60)
def test_without_a_worker_redis_does_not_fill_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(acknowledging, "MOST_WAITING", 3)
    server = RedisServer(tmp_path)
    settings = Settings(data_dir=tmp_path, broker_url=server.url, database_url="postgresql:///none")
    queue, name = Queue(settings), queue_names(settings)[READ_UPLOAD]
    try:
        assert all(queue.read_upload(number) for number in range(5))
        with redis.Redis(port=server.port) as client:
            assert client.llen(name) == 3
            client.rpop(name)
            assert queue.read_upload(5)
            assert client.llen(name) == 3
    finally:
        queue.close()
        server.kill()
