"""A worker whose acknowledgement Redis never heard takes the next message all the same."""

from collections.abc import Callable
from pathlib import Path

import pytest
from kombu import Consumer, Message
from kombu import Queue as KombuQueue

from app.queue import READ_UPLOAD, Queue
from app.queue.application import celery_application
from app.queue.jobs import queue_names
from app.settings import Settings
from tests.workers.redis_server import RedisServer


@pytest.mark.timeout(60)
@pytest.mark.parametrize("told", [Message.ack, Message.reject, Message.requeue], ids=["ack", "reject", "requeue"])
def test_what_redis_was_not_told_is_finished(told: Callable[[Message], None], tmp_path: Path) -> None:
    server = RedisServer(tmp_path)
    settings = Settings(data_dir=tmp_path, broker_url=server.url, database_url="postgresql:///none")
    queue, taken = Queue(settings), []
    try:
        assert queue.read_upload(1)
        name = queue_names(settings)[READ_UPLOAD]
        with celery_application(settings).connection_for_read() as connection, connection.channel() as channel:
            channel.basic_qos(0, 1, False)
            with Consumer(channel, [KombuQueue(name, routing_key=name)]) as consumer:
                consumer.register_callback(lambda body, message: taken.append(message))
                connection.drain_events(timeout=10)
                assert not channel.qos.can_consume()
                server.kill()
                with pytest.raises(connection.connection_errors):
                    told(taken[0])
                assert channel.qos.can_consume()
                server.start()
    finally:
        server.kill()
        queue.close()
