"""A small plant whose loops have samples."""

import numpy as np
import pytest
from sqlalchemy import update

from app.services.backend import Backend
from app.storage import loops, series
from app.storage.samples import Samples
from app.storage.series import Stretch
from app.storage.tables import loops as loops_table
from tests.services.audited_plant import AddLoops, audited
from tests.services.kept_rows import made_once

MINUTE = 60_000_000_000
START_NS = 1_750_000_000_000_000_000


@pytest.fixture
def add_loops(backend: Backend, warm_kernels: None) -> AddLoops:
    """Adds loops with an oscillating record each: `add_loops("FIC1", "FIC2", n=300, unit="U1")` gives their ids."""

    def add(*tags: str, n: int = 300, **attributes: object) -> dict[str, int]:
        steps = np.arange(n)
        times = START_NS + steps.astype(np.int64) * MINUTE
        with backend.database.write() as connection:
            ids = loops.ensure(connection, tags)
            stretches = []
            for number, tag in enumerate(tags):
                rng = np.random.default_rng(number)
                op = 50 + 5 * np.sin(steps / 6) + 0.2 * rng.normal(size=n)
                pv = 20 + 2 * np.sin(steps / 6 - 0.8) + 0.05 * rng.normal(size=n)
                stretches.append(Stretch(ids[tag], Samples(times, {"pv": pv, "op": op})))
            series.add(connection, stretches, None)
            if attributes:
                of_these = loops_table.c.id.in_(ids.values())
                connection.execute(update(loops_table).where(of_these).values(**attributes))
        return ids

    return add


@pytest.fixture
def two_runs(backend: Backend, add_loops: AddLoops) -> tuple[dict[str, int], int]:
    """Four loops audited twice, with the ids of the loops and of the first run."""

    def make() -> tuple[dict[str, int], int]:
        ids = add_loops("A", "B", "C", "D", n=600, unit="U1")
        first = audited(backend)
        audited(backend)
        return ids, first

    return made_once(backend, "two runs", make)
