"""The database's clock is put back by an hour: what was leased or announced by the old one must not wait for it."""

import pytest
from sqlalchemy import Table, update

from app.services.backend import Backend
from app.services.intake.uploads import receive
from app.storage import Database, audits, explanations, items, loops, uploads
from app.storage.audits import LoopFilter, Progress
from app.storage.leases import Reopened
from app.storage.tables import audit_items
from app.storage.tables import audits as runs
from app.storage.tables import explanations as explained
from app.storage.tables import loops as loops_table
from app.storage.tables import uploads as uploads_table
from app.storage.types import clock_s

LEASE_S = 40.0
HOUR_S = 3600.0
RUN = {"trigger": "request", "plant": "plant", "config_json": "{}", "config_fingerprint": "", "window_h": 24.0}


@pytest.fixture
def run(database: Database) -> int:
    with database.write() as connection:
        loops.ensure(connection, ["FIC1"])
        connection.execute(update(loops_table).values(newest_ns=1))
        planned = audits.plan(connection, {**RUN, "window_samples": 1000}, LoopFilter())
    assert planned is not None
    return planned


def put_back(database: Database, table: Table, column: str) -> None:
    """As seen from a clock that now shows an hour less: the moment lies an hour further ahead."""
    with database.write() as connection:
        connection.execute(update(table).values({column: table.c[column] + HOUR_S}))


def test_a_claim_is_given_to_another(database: Database, run: int) -> None:
    with database.write() as connection:
        held = items.claim(connection, run, "lost", 10, LEASE_S)
        assert items.reopen_expired(connection, 3, LEASE_S) == Reopened(0, 0)
    put_back(database, audit_items, "lease_until_s")
    with database.write() as connection:
        assert items.reopen_expired(connection, 3, LEASE_S) == Reopened(1, 0, {run: 1})
        assert items.finish(connection, held) == set()
        assert audits.progress(connection, [run])[run] == Progress(open=1)


def test_a_run_is_announced_again(database: Database, run: int) -> None:
    with database.write() as connection:
        audits.note_announced(connection, run)
        assert audits.to_announce(connection, 20.0) == []
    put_back(database, runs, "announced_s")
    with database.write() as connection:
        assert audits.to_announce(connection, 20.0) == [run]
        assert audits.to_announce(connection, 20.0) == []


def test_an_upload_is_read_by_another(backend: Backend) -> None:
    with receive(backend, filename="a.csv") as receiving:
        receiving.write(b"time,FIC1.PV,FIC1.OP\n1,2,3\n")
        number = int(receiving.commit().upload.id)
    with backend.database.write() as connection:
        assert uploads.claim(connection, number, "lost", LEASE_S, 10) is not None
        assert uploads.claim(connection, number, "other", LEASE_S, 10) is None
    put_back(backend.database, uploads_table, "lease_until_s")
    with backend.database.write() as connection:
        assert uploads.to_announce(connection, 20.0, LEASE_S) == [number]
        assert uploads.claim(connection, number, "other", LEASE_S, 10) is not None


def test_an_explanation_is_given_to_another(database: Database, run: int) -> None:
    with database.write() as connection:
        (loop,) = loops.ids_of(connection, ["FIC1"]).values()
        explanations.ask(connection, {"loop_id": loop})
        connection.execute(update(audit_items).values(state="failed", code="x"))
        assert explanations.claim_next(connection, "lost", LEASE_S) is not None
    put_back(database, explained, "lease_until_s")
    with database.write() as connection:
        assert explanations.reopen_expired(connection, 3, LEASE_S) == Reopened(1, 0)


def test_an_upload_tried_in_vain_waits_longer_each_time(backend: Backend) -> None:
    with receive(backend, filename="a.csv") as receiving:
        receiving.write(b"time,FIC1.PV,FIC1.OP\n1,2,3\n")
        receiving.commit()

    def announced(attempts: int, ago_s: float) -> bool:
        with backend.database.write() as connection:
            connection.execute(update(uploads_table).values(attempts=attempts, announced_s=clock_s() - ago_s))
            return bool(uploads.to_announce(connection, 20.0, LEASE_S))

    assert [announced(tries, 30.0) for tries in (0, 1, 2, 3)] == [True, True, True, False]
    assert announced(3, 50.0)
    assert not announced(6, 300.0)
    assert announced(6, 330.0)
