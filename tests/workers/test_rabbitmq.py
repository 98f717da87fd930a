"""RabbitMQ as the broker: what nobody hears is dropped, and a refusal ends no worker."""

import logging
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from amqp.exceptions import PreconditionFailed, RecoverableConnectionError
from celery.worker import request
from kombu import Connection, Message

from app.queue import READ_UPLOAD, SWEEP, Queue, consuming, publishing
from app.queue.application import celery_application
from app.queue.jobs import FORGOTTEN_AFTER_S, queue_names
from app.settings import Settings

ADDRESS = "amqp://guest:guest@127.0.0.1:5672//"


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(data_dir=tmp_path, broker_url=ADDRESS, database_url=f"postgresql:///{tmp_path.name}")


@pytest.fixture
def connection(settings: Settings) -> Iterator[Connection]:
    """To a RabbitMQ on this machine, if there is one, without queues of this test afterwards."""
    with Connection(ADDRESS, connect_timeout=2) as opened:
        try:
            opened.connect()
        except (OSError, *opened.connection_errors) as error:
            pytest.skip(f"no RabbitMQ at 127.0.0.1:5672: {error}")
        yield opened
        for name in queue_names(settings).values():
            opened.channel().queue_delete(name)


def is_announced(connection: Connection, queue: str) -> bool:
    """Whether a message is there for who asks; it stays."""
    with connection.channel() as channel:
        return channel.basic_get(queue) is not None


def test_what_nobody_hears_is_dropped(
    connection: Connection, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    queue = Queue(settings)
    assert queue.sweep()
    monkeypatch.setattr(publishing, "FORGOTTEN_AFTER_S", 0.0)
    assert queue.read_upload(1)
    queue.close()
    names = queue_names(settings)
    assert is_announced(connection, names[SWEEP])
    assert not is_announced(connection, names[READ_UPLOAD])


def test_so_are_sweeps_that_nobody_hears(settings: Settings) -> None:
    options = celery_application(settings).conf.beat_schedule["sweep"]["options"]
    assert options["expiration"] == FORGOTTEN_AFTER_S


@pytest.mark.parametrize("connected", [False, True])
def test_a_refusal_is_waited_out(
    settings: Settings, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, connected: bool
) -> None:
    """As of an acknowledgement after more than half an hour, while a large export was read."""
    assert celery_application(settings).conf.broker_channel_error_retry
    worker = consuming.Consumer.__new__(consuming.Consumer)
    transport = Connection(ADDRESS).transport
    worker.connection_errors, worker.channel_errors = transport.connection_errors, transport.channel_errors
    let_go: list[Exception] = []
    monkeypatch.setattr(
        consuming.CeleryConsumer, "on_connection_error_after_connected", lambda _, error: let_go.append(error)
    )
    now_s = [1000.0]
    clock = SimpleNamespace(monotonic=lambda: now_s[0], sleep=lambda seconds: now_s.append(now_s.pop() + seconds))
    monkeypatch.setattr(consuming, "time", clock)
    refusal = PreconditionFailed("delivery acknowledgement timed out")
    if connected:
        worker.on_connection_error_after_connected(refusal)
    else:
        worker.on_connection_error_before_connected(refusal)
    assert let_go == [refusal] * connected
    assert now_s[0] == pytest.approx(1001.0, abs=0.3)
    (told,) = (record for record in caplog.records if record.levelno == logging.ERROR)
    assert told.getMessage().startswith("the broker answers and refuses; trying again in 1 s: ")
    assert told.__dict__["code"] == "broker_refused"


def test_a_lost_connection_is_told_without_a_traceback_or_a_deprecation(
    settings: Settings, caplog: pytest.LogCaptureFixture
) -> None:
    """What is done and not acknowledged is handed out again and found done: it was logged as critical."""
    parts = {
        "pool": SimpleNamespace(num_processes=1, is_green=False),
        "controller": SimpleNamespace(use_eventloop=False),
    }
    worker = consuming.Consumer(lambda message: None, app=celery_application(settings), **parts)
    lost = RecoverableConnectionError("connection already closed")
    worker.connection = None
    worker.on_connection_error_after_connected(lost)  # of warnings each is an error here

    class Channel:
        no_ack_consumers = None

        def basic_ack(self, tag: int, multiple: bool) -> None:
            raise lost

    Message(delivery_tag=10, channel=Channel()).ack_log_error(request.logger, (RecoverableConnectionError,))
    told = caplog.records[-1]
    assert (told.levelname, told.exc_info) == ("WARNING", None)
    assert told.getMessage().startswith("a task is done and could not be acknowledged")
