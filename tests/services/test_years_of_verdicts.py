"""What a page or the end of a night costs the database does not grow with the nights that are behind: the worst is a
plant of which nothing new was recorded, as after a night without an export."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import Connection, insert, select, update

from app.engine.codes import UNANSWERED
from app.services.backend import Backend
from app.services.digests.making import digest_of
from app.services.plant import reliability
from app.services.plant.arrivals import NOTHING_NEW, arrivals
from app.services.plant.judged import judged
from app.services.plant.nights import nights
from app.services.plant.overview import tiles
from app.services.plant.plant_sheet import plant_sheet
from app.services.reports.documents import plant_report
from app.services.upkeep.metrics import metrics
from app.storage import Database
from app.storage.asked_rows import RowFilter
from app.storage.tables import audits, verdicts
from app.storage.unanswered import unanswered_before
from tests.services.audited_plant import AddLoops, audited

SOME, MANY = 30, 300
TAGS = tuple(f"L{number:02}" for number in range(24))
STEPS_COUNTED = 20
MOST = 0.1  # rows of verdicts that a loop and a night more may cost
STEPS_A_ROW = 30  # of SQLite's machine, at least 6 of which it takes to pass a row of a key


def _still(backend: Backend, ids: list[int]) -> None:
    with backend.database.read() as connection:
        unanswered_before(connection, ids)


ASKED: dict[str, Callable[[Backend, list[int], int], object]] = {
    "the plant's page": lambda b, ids, run: plant_sheet(b, arrivals(b)),
    "tiles": lambda b, ids, run: tiles(b),
    "the plant's report": lambda b, ids, run: plant_report(b),
    "a page of the table": lambda b, ids, run: reliability.table(b, 100, None, "-priority", RowFilter()),
    "last nights": lambda b, ids, run: nights(b, TAGS),
    "last nights up to a run": lambda b, ids, run: nights(b, TAGS, run),
    "what was judged": lambda b, ids, run: judged(b, TAGS),
    "a digest": lambda b, ids, run: digest_of(b, str(run)),
    "metrics": lambda b, ids, run: metrics(b),
    "since when PVs are still": lambda b, ids, run: _still(b, ids),
}

AN_EARLIER_RUN = {
    **{"trigger": "request", "plant": "p", "state": "done", "config_json": "{}", "config_fingerprint": "", "total": 0},
    **{"window_h": 24.0, "window_samples": 1000, "created_at": datetime(2025, 1, 1, tzinfo=UTC)},
}
"""Leaves the numbers before its own to the nights that are behind."""
EARLIER = {"verdict": "no_stiction", "likely_cause": UNANSWERED}
WAVERS = {"verdict": "stiction", "reliability": "not_reliable"}
"""Of it is asked what the night before said, of other samples."""


def _add_nights(backend: Backend, first: int, last: int) -> None:
    """Runs with these numbers, in each of which every loop has a verdict as in the newest run, but that none sticks."""
    with backend.database.write() as connection:
        newest = connection.execute(select(audits).order_by(audits.c.id.desc()).limit(1)).mappings().one()
        day = datetime(2024, 1, 1, tzinfo=UTC)
        runs = [{**newest, "id": n, "created_at": day + timedelta(days=n)} for n in range(first, last + 1)]
        connection.execute(insert(audits), runs)
        said = connection.execute(select(verdicts).where(verdicts.c.audit_id == newest["id"])).mappings().all()
        earlier = [
            {**row, "audit_id": run["id"], "audited_at": run["created_at"], **EARLIER} for run in runs for row in said
        ]
        connection.execute(insert(verdicts), earlier)


@pytest.fixture
def years(backend: Backend, add_loops: AddLoops) -> tuple[list[int], int]:
    """Loops with SOME nights behind: their ids, and the newest run."""
    if not backend.database.is_sqlite:
        pytest.skip("PostgreSQL plans by size: tests/storage/test_plans.py looks at plans of a plant")
    ids = add_loops(*TAGS, n=600, unit="U1")
    with backend.database.write() as connection:
        connection.execute(insert(audits), {**AN_EARLIER_RUN, "id": MANY + 1})
    run = audited(backend)
    with backend.database.write() as connection:
        connection.execute(update(verdicts).values(**WAVERS))
    _add_nights(backend, 1, SOME)
    return list(ids.values()), run


class Counted:
    """What reads take of a database on SQLite, by the steps of its machine, in rows of verdicts."""

    def __init__(self, database: Database) -> None:
        self._database, self.total = database, 0.0

    @contextmanager
    def read(self) -> Iterator[Connection]:
        with self._database.write() as connection:
            driver = connection.connection.dbapi_connection
            driver.set_progress_handler(self._one_more, STEPS_COUNTED)
            yield connection
            driver.set_progress_handler(None, 0)

    def _one_more(self) -> int:
        self.total += STEPS_COUNTED / STEPS_A_ROW
        return 0


def test_nights_that_are_behind_cost_no_page_anything(
    years: tuple[list[int], int], backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    ids, run = years
    assert NOTHING_NEW in plant_sheet(backend, arrivals(backend))["arrivals"]
    before = _costs(backend, ids, run, monkeypatch)
    _add_nights(backend, SOME + 1, MANY)
    after = _costs(backend, ids, run, monkeypatch)
    assert all(before.values()), before
    more = {name: (after[name] - before[name]) / len(ids) / (MANY - SOME) for name in before}
    assert {name: rows for name, rows in more.items() if rows > MOST} == {}


def _costs(backend: Backend, ids: list[int], run: int, monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    found = {}
    for name, ask in ASKED.items():
        counted = Counted(backend.database)
        with monkeypatch.context() as patched:
            patched.setattr(backend.database, "read", counted.read)
            ask(backend, ids, run)
        found[name] = counted.total
    return found
