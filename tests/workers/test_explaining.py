"""Explanations by real worker processes: what happens when messages and processes are lost."""

from typing import Any

import numpy as np
import pytest
from sqlalchemy import select

from app.queue import Queue
from app.services.backend import Backend
from app.services.explaining import explanations
from app.services.intake import uploads
from app.storage.tables import explanations as explained
from app.storage.tables import loops

TAGS = ("FIC1", "FIC2", "FIC3")


class SilentQueue(Queue):
    """A broker that loses every message."""

    def _send(self, job: str, *arguments: int) -> bool:
        return True


@pytest.fixture(scope="session")
def wandering_export() -> bytes:
    """Three loops whose OP moves by steps, 200 samples."""
    rng = np.random.default_rng(3)
    op = 50.0 + np.repeat(rng.normal(0.0, 4.0, 10), 20) + rng.normal(0.0, 0.3, 200)
    pv = 20.0 + np.convolve(op, np.full(5, 0.2))[:200] + rng.normal(0.0, 0.2, 200)
    rows = [f"{1_750_000_000 + 10 * k}," + ",".join([f"{pv[k]:.4f},{op[k]:.4f}"] * 3) for k in range(200)]
    return "\n".join(["time," + ",".join(f"{tag}.PV,{tag}.OP" for tag in TAGS), *rows]).encode()


def state(plant: Any, tag: str) -> str:
    return explanations.list_explanations(plant.backend, tag).rows[0]["state"]


def attempts(plant: Any, tag: str) -> int:
    with plant.backend.database.read() as connection:
        query = select(explained.c.attempts).join(loops, loops.c.id == explained.c.loop_id).where(loops.c.tag == tag)
        return connection.scalar(query)


@pytest.mark.timeout(600)
def test_lost_messages_lost_workers_and_a_deadly_loop(plant: Any, wandering_export: bytes) -> None:
    slow = plant.start("worker", SLOW_S="60")
    upload = plant.send("plant.csv", wandering_export)
    plant.wait("reading", lambda: uploads.get_upload(plant.backend, upload.id).state == "done")
    explanations.ask(plant.backend, "FIC1")
    plant.wait("a claim", lambda: attempts(plant, "FIC1") == 1)
    plant.wait("a first answer", lambda: explanations.newest(plant.backend, "FIC1")["located"] is not None)
    plant.kill(slow)

    deaf = Backend(plant.backend.settings, plant.backend.database, SilentQueue(plant.backend.settings))
    explanations.ask(deaf, "FIC2")
    explanations.ask(deaf, "FIC3")
    plant.start("beat")
    plant.start("worker", DEADLY="FIC2")
    plant.wait("every end", lambda: {state(plant, tag) for tag in TAGS} <= {"done", "failed"}, 400.0)

    found = {tag: explanations.newest(plant.backend, tag) for tag in TAGS}
    assert {tag: told["state"] for tag, told in found.items()} == {"FIC1": "done", "FIC2": "failed", "FIC3": "done"}
    assert found["FIC2"]["error_code"] == "worker_lost"
    assert (attempts(plant, "FIC1"), attempts(plant, "FIC2"), attempts(plant, "FIC3")) == (2, 2, 1)
    assert found["FIC1"]["verdict"] == found["FIC3"]["verdict"]
