"""Uploads are read before a backlog of audits and explanations, which take equal turns."""

from pathlib import Path

import pytest
from celery import Celery
from kombu import Message

from app.queue import AUDIT_CHUNK, EXPLAIN, READ_UPLOAD, SWEEP
from app.queue.application import celery_application
from app.queue.jobs import queue_names
from app.settings import Settings
from tests.workers.redis_server import RedisServer

BACKLOG = [EXPLAIN, EXPLAIN, EXPLAIN, AUDIT_CHUNK, AUDIT_CHUNK]


def order_of_work(application: Celery) -> list[str]:
    """The jobs in the order in which a worker with room for one takes them; uploads came behind the backlog."""
    queues = queue_names(application.settings)
    taken: list[str] = []

    def take(_: object, message: Message) -> None:
        taken.append(message.headers["task"])
        message.ack()

    waiting = [*BACKLOG, READ_UPLOAD, READ_UPLOAD, SWEEP]
    with application.connection() as connection:
        producer = connection.Producer()
        for job in waiting:
            queue = application.amqp.queues[queues[job]]
            producer.publish(
                {}, routing_key=queue.routing_key, exchange=queue.exchange, declare=[queue], headers={"task": job}
            )
        with connection.Consumer(
            [application.amqp.queues[name] for name in queues.values()], callbacks=[take], prefetch_count=1
        ):
            while len(taken) < len(waiting):
                connection.drain_events(timeout=5)
    return taken


def is_fair_behind_the_uploads(taken: list[str]) -> bool:
    """While both wait, audits and explanations alternate."""
    first = taken[3:7]
    return sorted(first[:2]) == sorted(first[2:]) == sorted([AUDIT_CHUNK, EXPLAIN])


def test_in_the_folder(tmp_path: Path) -> None:
    taken = order_of_work(celery_application(Settings(data_dir=tmp_path)))
    assert sorted(taken[:3]) == sorted([SWEEP, READ_UPLOAD, READ_UPLOAD])
    assert is_fair_behind_the_uploads(taken)


@pytest.mark.redis
@pytest.mark.timeout(60)
def test_in_redis(tmp_path: Path) -> None:
    server = RedisServer(tmp_path)
    settings = Settings(data_dir=tmp_path, broker_url=server.url, database_url="postgresql:///none")
    application = celery_application(settings)
    try:
        taken = order_of_work(application)
    finally:
        application.close()
        server.kill()
    assert sorted(taken[:3]) == sorted([SWEEP, READ_UPLOAD, READ_UPLOAD])
    assert is_fair_behind_the_uploads(taken)
