"""A broker that refuses the login, or is a read-only replica: told in lines with a code, and outlived."""

import logging
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import redis
from celery.beat import ScheduleEntry
from kombu import Connection
from kombu.exceptions import OperationalError

from app.queue import SWEEP, Queue, steady
from app.queue.application import celery_application
from app.queue.refusals import FULL, LOGIN, OTHER, READ_ONLY, BrokerRefusal, refusal_of
from app.queue.steady import Scheduler
from app.services.upkeep import doctor
from app.services.upkeep.readiness import readiness
from app.settings import Settings
from tests.workers.conftest import Plant, plant_behind
from tests.workers.redis_server import RedisServer

RIGHT, RIGHT_AT_RABBITMQ = "right", "guest"
WRONG_AT_RABBITMQ = "amqp://guest:wrong@127.0.0.1:5672//"


def ask_for_a_password(server: RedisServer) -> None:
    with redis.Redis(port=server.port) as client:
        client.config_set("requirepass", RIGHT)


def ask_for_none(server: RedisServer) -> None:
    with redis.Redis(port=server.port, password=RIGHT) as client:
        client.config_set("requirepass", "")


def follow_nobody(server: RedisServer) -> None:
    with redis.Redis(port=server.port) as client:
        client.replicaof("127.0.0.1", "1")


def follow_no_more(server: RedisServer) -> None:
    with redis.Redis(port=server.port) as client:
        client.replicaof("NO", "ONE")


REFUSING = [
    pytest.param(ask_for_a_password, ask_for_none, LOGIN, id="login"),
    pytest.param(follow_nobody, follow_no_more, READ_ONLY, id="read-only"),
]


@pytest.fixture
def server(tmp_path: Path) -> Iterator[RedisServer]:
    started = RedisServer(tmp_path)
    yield started
    started.kill()


@pytest.fixture
def plant(server: RedisServer, tmp_path: Path, warm_kernels: None) -> Iterator[Plant]:
    with plant_behind(server.url, tmp_path) as made:
        yield made


@pytest.fixture
def rabbitmq() -> None:
    with Connection("amqp://guest:guest@127.0.0.1:5672//", connect_timeout=2) as opened:
        try:
            opened.connect()
        except (OSError, *opened.connection_errors) as error:
            pytest.skip(f"no RabbitMQ at 127.0.0.1:5672: {error}")


@pytest.mark.parametrize(("begins", "ends", "refusal"), REFUSING)
def test_who_rings_doctor_and_readiness_say_what_is_wrong(
    plant: Plant,
    server: RedisServer,
    caplog: pytest.LogCaptureFixture,
    begins: Callable[[RedisServer], None],
    ends: Callable[[RedisServer], None],
    refusal: BrokerRefusal,
) -> None:
    begins(server)
    queue = Queue(plant.backend.settings)
    assert not queue.read_upload(1)
    (told,) = (record for record in caplog.records if record.name == "loopaudit.queue")
    assert vars(told)["code"] == refusal.code
    assert told.getMessage().startswith(f"the broker answers and {refusal.what}, loopaudit.read_upload(1,) waits")
    assert told.exc_info is None
    queue.close()
    check = doctor.broker(plant.backend)
    assert (check.state, check.advice) == ("problem", refusal.advice)
    assert check.found.startswith(f"answers and {refusal.what}: ")
    assert readiness(plant.backend).checks["broker"] == refusal.state
    ends(server)
    assert doctor.broker(plant.backend).state == "ok"
    assert readiness(plant.backend).checks["broker"] == "ok"


@pytest.mark.parametrize(("begins", "ends", "refusal"), REFUSING)
def test_a_worker_and_a_schedule_say_it_in_lines_and_go_on(
    plant: Plant,
    server: RedisServer,
    begins: Callable[[RedisServer], None],
    ends: Callable[[RedisServer], None],
    refusal: BrokerRefusal,
) -> None:
    begins(server)
    plant.start("worker")
    plant.wait("the worker says so twice", lambda: plant.log.read_text().count(f'"{refusal.code}"') >= 2)
    said = plant.log.read_text().count(f'"{refusal.code}"')
    plant.start("beat")
    plant.wait("so does the schedule", lambda: plant.log.read_text().count(f'"{refusal.code}"') >= said + 3)
    told = plant.log.read_text()
    assert "Traceback" not in told
    assert "Cannot connect" not in told
    assert f"the broker answers and {refusal.what}; trying again in " in told
    ends(server)
    plant.wait("they go on", lambda: "what was old is dropped" in plant.log.read_text())


def test_a_schedule_outlives_a_rabbitmq_that_refuses_its_login(
    rabbitmq: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """It ended in a traceback."""
    settings = Settings(data_dir=tmp_path, broker_url=WRONG_AT_RABBITMQ, database_url="postgresql:///none")
    schedule = Scheduler(celery_application(settings), lazy=True)
    pauses: list[float] = []

    def pause(seconds: float) -> None:
        pauses.append(seconds)
        if len(pauses) == 3:
            schedule.connection.password = RIGHT_AT_RABBITMQ

    monkeypatch.setattr(steady.time, "sleep", pause)
    assert schedule.producer is not None
    assert pauses == sorted(set(pauses))
    told = [record for record in caplog.records if record.name == "loopaudit.queue"]
    assert [vars(record)["code"] for record in told] == [LOGIN.code] * 3
    schedule.connection.release()


def test_who_rings_a_rabbitmq_that_refuses_its_login_says_so(
    rabbitmq: None, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    queue = Queue(Settings(data_dir=tmp_path, broker_url=WRONG_AT_RABBITMQ, database_url="postgresql:///none"))
    assert not queue.reachable()
    assert queue.refusal is LOGIN
    assert [vars(record)["code"] for record in caplog.records if record.name == "loopaudit.queue"] == [LOGIN.code]
    queue.close()


@pytest.mark.parametrize(("begins", "refusal"), [(follow_nobody, READ_ONLY), (ask_for_a_password, LOGIN)])
def test_a_ring_of_the_schedule_that_is_refused_says_why(
    server: RedisServer,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    begins: Callable[[RedisServer], None],
    refusal: BrokerRefusal,
) -> None:
    schedule = Scheduler(celery_application(Settings(data_dir=tmp_path, broker_url=server.url)), lazy=True)
    begins(server)
    schedule.apply_entry(ScheduleEntry(name="sweep", task=SWEEP, schedule=60.0, app=schedule.app))
    (told,) = (record for record in caplog.records if record.name == "loopaudit.queue")
    assert (vars(told)["code"], told.levelno) == (refusal.code, logging.ERROR)


def test_refusals_are_told_apart() -> None:
    full = redis.OutOfMemoryError("command not allowed when used memory > 'maxmemory'")
    assert refusal_of(full) is FULL
    assert refusal_of(redis.ResponseError("MISCONF Redis is configured to save RDB snapshots")) is FULL
    assert refusal_of(redis.exceptions.NoPermissionError("this user has no permissions")) is LOGIN
    assert refusal_of(redis.ResponseError("NOREPLICAS"), (redis.ResponseError,)) is OTHER
    wrapped = OperationalError("NOREPLICAS")  # as kombu tells it to who rings
    wrapped.__cause__ = redis.ResponseError("NOREPLICAS")
    assert refusal_of(wrapped, (redis.ResponseError,)) is OTHER
    assert refusal_of(redis.ConnectionError("refused")) is None
    wrapped = OperationalError("refused")
    wrapped.__cause__ = redis.AuthenticationError("Authentication required.")
    assert refusal_of(wrapped) is LOGIN
