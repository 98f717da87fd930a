"""A Redis that has no memory left answers, and takes nothing: that is told, and whoever rings goes on."""

import errno
import logging
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from celery.beat import BeatLazyFunc, ScheduleEntry

from app.queue import Queue, folder
from app.queue.application import celery_application
from app.queue.jobs import SWEEP
from app.queue.refusals import FULL
from app.queue.steady import Scheduler
from app.services.intake.uploads import get_upload
from app.settings import Settings
from tests.workers.conftest import Plant, ended_with, plant_behind
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


@pytest.fixture
def plant(server: RedisServer, tmp_path: Path, warm_kernels: None) -> Iterator[Plant]:
    with plant_behind(server.url, tmp_path) as made:
        yield made


def at_its_start(plant: Plant, server: RedisServer) -> None:
    server.set_memory(1)
    plant.start("worker")


def with_a_message_on_its_way(plant: Plant, server: RedisServer) -> None:
    worker = plant.start("worker")
    plant.wait("it works", lambda: '"ready"' in plant.log.read_text())
    assert plant.backend.queue.sweep()
    plant.wait("it has taken a message", lambda: "what was old is dropped" in plant.log.read_text())
    os.kill(worker.pid, signal.SIGSTOP)
    assert plant.backend.queue.sweep()
    server.set_memory(1)
    os.kill(worker.pid, signal.SIGCONT)


@pytest.mark.parametrize("begins", [at_its_start, with_a_message_on_its_way])
def test_a_worker_outlives_a_redis_without_memory_and_says_what_is_wrong(
    plant: Plant, server: RedisServer, small_export: bytes, begins: Callable[[Plant, RedisServer], None]
) -> None:
    begins(plant, server)
    plant.wait("it says so twice", lambda: plant.log.read_text().count('"broker_refused"') >= 2)
    told = plant.log.read_text()
    assert "make room in it; trying again in 1 s: " in told
    assert "Frequent restarts" not in told
    server.set_memory(0)
    assert plant.backend.queue.reachable()
    upload = plant.send("plant.csv", small_export)
    plant.wait("it reads an upload", lambda: get_upload(plant.backend, upload.id).state == "done")


def test_a_schedule_says_it_in_a_line(plant: Plant, server: RedisServer) -> None:
    server.set_memory(1)
    plant.start("beat")
    plant.wait("it says so twice", lambda: plant.log.read_text().count('"broker_refused"') >= 2)
    assert "Traceback" not in plant.log.read_text()
    server.set_memory(0)
    plant.start("worker")
    plant.wait("it is heard", lambda: "what was old is dropped" in plant.log.read_text())


@pytest.mark.parametrize("name", ["worker", "beat"])
def test_what_is_told_to_stop_meanwhile_stops(plant: Plant, server: RedisServer, name: str) -> None:
    server.set_memory(1)
    process = plant.start(name)
    plant.wait("it says so twice", lambda: plant.log.read_text().count('"broker_refused"') >= 2)
    process.terminate()
    assert ended_with(process) == 0
    plant.running.remove(process)
    assert "Traceback" not in plant.log.read_text()


@pytest.fixture
def schedule(server: RedisServer, tmp_path: Path) -> Scheduler:
    return Scheduler(celery_application(Settings(data_dir=tmp_path, broker_url=server.url)), lazy=True)


def ring(schedule: Scheduler, caplog: pytest.LogCaptureFixture, *values: object) -> logging.LogRecord:
    caplog.clear()
    schedule.apply_entry(ScheduleEntry(name="sweep", task=SWEEP, schedule=60.0, app=schedule.app, args=values))
    (told,) = (record for record in caplog.records if record.name == "loopaudit.queue")
    return told


def test_a_schedule_tells_a_broker_that_refuses_from_one_that_is_away(
    schedule: Scheduler, server: RedisServer, caplog: pytest.LogCaptureFixture
) -> None:
    server.set_memory(1)
    assert vars(ring(schedule, caplog))["code"] == FULL.code
    server.kill()
    away = ring(schedule, caplog)
    assert "code" not in vars(away)
    assert "the broker is away" in away.getMessage()
    assert away.exc_info is None


def test_a_schedule_whose_folder_has_no_room_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """On the embedded default: no broker is away then."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(folder, "_write_whole", full)
    told = ring(Scheduler(celery_application(Settings(data_dir=tmp_path)), lazy=True), caplog)
    assert told.getMessage().startswith("no room on the disk for the broker's messages, make room")
    assert told.exc_info is None


def test_a_schedule_tells_a_fault_of_ours_with_where_it_is(
    schedule: Scheduler, caplog: pytest.LogCaptureFixture
) -> None:
    told = ring(schedule, caplog, BeatLazyFunc(len, 1))
    assert "code" not in vars(told)
    assert told.exc_info is not None
