"""Uploads are read before a backlog of audits and explanations, which take equal turns."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from celery import Celery
from kombu import Message

from app.queue import AUDIT_CHUNK, DELIVER, EXPLAIN, READ_UPLOAD, SWEEP
from app.queue.application import celery_application
from app.queue.jobs import queue_names
from app.queue.turns import MOST_IN_A_ROW
from app.settings import Settings
from tests.workers.redis_server import RedisServer


@pytest.fixture(params=["folder", pytest.param("redis", marks=pytest.mark.redis)])
def application(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Celery]:
    if request.param == "folder":
        yield celery_application(Settings(data_dir=tmp_path))
        return
    server = RedisServer(tmp_path)
    made = celery_application(
        Settings(data_dir=tmp_path, broker_url=server.url, database_url="postgresql:///none"),
    )
    yield made
    made.close()
    server.kill()


def order_of_work(application: Celery, *waiting: str) -> list[str]:
    """The jobs in the order in which a worker with room for one takes them."""
    queues = queue_names(application.settings)
    taken: list[str] = []

    def take(_: object, message: Message) -> None:
        taken.append(message.headers["task"])
        message.ack()

    with application.connection() as connection:
        producer = connection.Producer()
        for job in waiting:
            queue = application.amqp.queues[queues[job]]
            producer.publish(
                {}, routing_key=queue.routing_key, exchange=queue.exchange, declare=[queue], headers={"task": job}
            )
        every = [application.amqp.queues[name] for name in queues.values()]
        with connection.Consumer(every, callbacks=[take], prefetch_count=1):
            while len(taken) < len(waiting):
                connection.drain_events(timeout=5)
    return taken


@pytest.mark.timeout(60)
def test_uploads_go_before_what_waited_and_the_rest_takes_equal_turns(application: Celery) -> None:
    backlog = [EXPLAIN] * 4 + [AUDIT_CHUNK] * 3 + [DELIVER] * 2 + [SWEEP] * 20
    taken = order_of_work(application, *backlog, READ_UPLOAD, READ_UPLOAD)
    assert taken[:2] == [READ_UPLOAD] * 2
    assert {*taken[2:6]} == {*taken[6:10]} == {AUDIT_CHUNK, EXPLAIN, DELIVER, SWEEP}


@pytest.mark.timeout(60)
def test_however_many_uploads_wait_the_rest_has_its_turn(application: Celery) -> None:
    """As where the files of many are away."""
    taken = order_of_work(application, *[READ_UPLOAD] * (3 * MOST_IN_A_ROW), AUDIT_CHUNK, EXPLAIN)
    places = [at for at, job in enumerate(taken) if job != READ_UPLOAD]
    assert places == [MOST_IN_A_ROW, 2 * MOST_IN_A_ROW + 1]
