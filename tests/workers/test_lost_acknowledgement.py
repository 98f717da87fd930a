"""A worker whose acknowledgement Redis never heard takes the next message all the same."""

import shutil
import socket
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
import redis
from kombu import Consumer, Message
from kombu import Queue as KombuQueue

from app.queue import READ_UPLOAD, Queue
from app.queue.application import celery_application
from app.queue.jobs import queue_names
from app.settings import Settings


def answers(port: int) -> bool:
    with suppress(redis.ConnectionError), redis.Redis(port=port) as client:
        return bool(client.ping())
    return False


def started(program: str, port: int, folder: Path) -> subprocess.Popen[bytes]:
    command = [program, "--port", str(port), "--bind", "127.0.0.1", "--save", "", "--dir", str(folder)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    while not answers(port):
        time.sleep(0.05)
    return process


@pytest.mark.timeout(60)
@pytest.mark.parametrize("told", [Message.ack, Message.reject, Message.requeue], ids=["ack", "reject", "requeue"])
def test_what_redis_was_not_told_is_finished(told: Callable[[Message], None], tmp_path: Path) -> None:
    program = shutil.which("redis-server")
    if program is None:
        pytest.skip("no redis-server to be started")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    settings = Settings(data_dir=tmp_path, broker_url=f"redis://127.0.0.1:{port}/0", database_url="postgresql:///none")
    server, queue, taken = started(program, port, tmp_path), Queue(settings), []
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
                server.wait()
                with pytest.raises(connection.connection_errors):
                    told(taken[0])
                assert channel.qos.can_consume()
                server = started(program, port, tmp_path)
    finally:
        server.kill()
        server.wait()
        queue.close()
