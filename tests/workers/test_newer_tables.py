"""A worker of an older version that was left running through an upgrade ends, and leaves the work to newer ones."""

from typing import Any

from sqlalchemy import text

from app.services.intake import uploads
from tests.workers.conftest import ended_with

SMALL = b"time,FIC1.PV,FIC1.OP\n" + b"".join(b"%d,%d,%d\n" % (1_750_000_000 + 60 * i, i % 7, i % 5) for i in range(150))


def set_version(plant: Any, version: str) -> None:
    with plant.backend.database.write() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = :version"), {"version": version})


def version_of(plant: Any) -> str:
    with plant.backend.database.read() as connection:
        return str(connection.scalar(text("SELECT version_num FROM alembic_version")))


def test_a_worker_ends_once_the_tables_are_those_of_a_newer_version(plant: Any) -> None:
    own = version_of(plant)
    worker = plant.start("worker")
    first = plant.send("a.csv", SMALL)
    plant.wait("the first upload", lambda: uploads.get_upload(plant.backend, first.id).state == "done")
    set_version(plant, "9999")
    second = plant.send("b.csv", SMALL.replace(b"FIC1", b"FIC2"))
    assert ended_with(worker) == 0
    plant.running.remove(worker)
    assert uploads.get_upload(plant.backend, second.id).state == "received"
    assert plant.log.read_text().count("newer_tables") == 1
    set_version(plant, own)
    plant.start("worker")
    plant.start("beat")
    plant.wait("the second upload", lambda: uploads.get_upload(plant.backend, second.id).state == "done")
