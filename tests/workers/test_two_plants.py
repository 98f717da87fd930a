"""Two plants on one broker: nobody takes what is the other's."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.queue.application import celery_application
from app.queue.jobs import queue_names
from app.services.backend import Backend
from app.services.intake import uploads
from app.services.upkeep.sweep import sweep
from app.services.upkeep.tables import migrate
from app.settings import Settings
from tests.workers.conftest import QUICK, Plant, ended_with, export

PLANTS = ("north", "south")


@pytest.fixture
def plants(tmp_path: Path, redis_url: str) -> Iterator[list[Plant]]:
    """Each with a folder and a database of its own, on one number of one Redis."""
    made = []
    for name in PLANTS:
        environment = {**QUICK, "LOOPAUDIT_DATA_DIR": str(tmp_path / name), "LOOPAUDIT_BROKER_URL": redis_url}
        settings = Settings(**{key.removeprefix("LOOPAUDIT_").lower(): value for key, value in environment.items()})
        migrate(settings)
        made.append(Plant(Backend.open(settings), environment, tmp_path / f"{name}.log"))
    yield made
    for plant in made:
        for process in plant.running:
            os.killpg(process.pid, signal.SIGKILL)
            process.join()
        plant.backend.close()


def waiting(plant: Plant) -> int:
    application = celery_application(plant.backend.settings)
    with application.connection_for_read() as connection:
        channel = connection.default_channel
        found = sum(channel._size(queue) for queue in queue_names(plant.backend.settings).values())
    application.close()
    return found


def state(plant: Plant, upload_id: str) -> str:
    return uploads.get_upload(plant.backend, upload_id).state


@pytest.mark.redis
def test_a_worker_hears_its_own_plant_alone(plants: list[Plant], warm_kernels: None) -> None:
    """Without sweeps: whatever went to the wrong worker would never be read."""
    north, south = plants
    of_south = [south.send(f"{number}.csv", export(1, rows=100 + number)).id for number in range(3)]
    worker = north.start("worker")
    of_north = [north.send(f"{number}.csv", export(1, rows=200 + number)).id for number in range(3)]
    north.wait("the north's uploads", lambda: {state(north, one) for one in of_north} == {"done"})
    assert {state(south, one) for one in of_south} == {"received"}
    assert (waiting(north), waiting(south)) == (0, 3)
    worker.terminate()
    assert ended_with(worker) == 0
    north.running.remove(worker)
    south.start("worker")
    south.wait("the south's uploads", lambda: {state(south, one) for one in of_south} == {"done"})


@pytest.mark.redis
def test_what_waited_under_an_older_name_is_announced_again(plants: list[Plant]) -> None:
    """As at an upgrade: what older versions sent lies in queues that nobody listens to any more."""
    north = plants[0]
    upload = north.send("plant.csv", export(2))
    application = celery_application(north.backend.settings)
    with application.connection_for_write() as connection:
        for queue in queue_names(north.backend.settings).values():
            connection.default_channel.client.delete(queue)
    application.close()
    assert waiting(north) == 0
    north.wait("its turn", lambda: sweep(north.backend).announced == 1, seconds=10)
    assert waiting(north) == 1
    assert state(north, upload.id) == "received"


def test_names_of_queues_part_plants_and_data_bases_and_not_ways_of_writing_one(tmp_path: Path) -> None:
    def names(database_url: str = "", **settings: object) -> tuple[str, ...]:
        return tuple(queue_names(Settings(data_dir=tmp_path, database_url=database_url, **settings)).values())

    ways = (
        "postgresql+psycopg://api:secret@127.0.0.1:5432/north",
        "postgresql://worker:other@db.example/north",
        "postgresql://worker@/north?host=/run/postgresql",
    )
    assert len({names(way) for way in ways}) == 1
    different = [names(), names(ways[0]), names(ways[0].replace("north", "south")), names(ways[0], plant="south")]
    different.append(names(f"sqlite:///{tmp_path}/other.db"))
    assert len(set(different)) == len(different)
    assert names() == names(f"sqlite:///{tmp_path}/../{tmp_path.name}/loopaudit.db")
    assert not [name for name in names(ways[0]) if "secret" in name or "." in name]
