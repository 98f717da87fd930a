"""Whether workers get on: told by what they leave in the database, and not by how old a run is."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import update

from app.cli.worker import refuse_standstill
from app.errors import RequestError
from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.run_figures import run_figures
from app.services.auditing.standing_still import standstill_s
from app.services.backend import Backend
from app.services.explaining.explanations import ask
from app.services.intake.uploads import receive
from app.services.plant.newest_run import newest_run
from app.services.upkeep import doctor
from app.services.upkeep.sweep import sweep
from app.storage import deliveries, explanations, items, uploads
from app.storage.audits import to_announce
from app.storage.tables import audit_items, audits
from app.storage.types import clock_s
from tests.services.audited_plant import AddLoops
from tests.services.upkeep_plant import with_settings

AGE_S = 1200.0


@pytest.fixture
def old_run(backend: Backend, add_loops: AddLoops) -> int:
    """A run of twenty minutes ago, of which nobody has heard since."""
    add_loops("A", "B")
    run = int(start_audit(backend).id)
    ago = {"created_at": datetime.now(UTC) - timedelta(seconds=AGE_S), "announced_s": clock_s() - AGE_S}
    with backend.database.write() as connection:
        connection.execute(update(audits).values(ago))
    return run


def holds_a_loop(backend: Backend, run: int) -> None:
    with backend.database.write() as connection:
        assert items.claim(connection, run, "w", 1, backend.settings.lease_s)


def reads_an_upload(backend: Backend, _: int) -> None:
    with receive(backend, filename="a.csv") as receiving:
        receiving.write(b"time,A.PV,A.OP\n")
        upload = int(receiving.commit().upload.id)
    with backend.database.write() as connection:
        assert uploads.claim(connection, upload, "w", backend.settings.lease_s, 3)


def explains(backend: Backend, _: int) -> None:
    ask(backend, "A")
    with backend.database.write() as connection:
        assert explanations.claim_next(connection, "w", backend.settings.lease_s)


def sends_a_digest(backend: Backend, run: int) -> None:
    with backend.database.write() as connection:
        deliveries.plan(connection, run, ["mailto:a@example.org"])
        assert deliveries.claim_next(connection, "w", backend.settings.lease_s)


def sweeps(backend: Backend, _: int) -> None:
    sweep(backend)


def test_no_worker_that_gives_a_sign_is_a_standstill(backend: Backend, old_run: int) -> None:
    assert standstill_s(backend) == pytest.approx(AGE_S, abs=60.0)
    assert doctor.workers(backend).state == "problem"


def test_a_worker_that_died_with_loops_in_its_hands_gives_no_sign(backend: Backend, old_run: int) -> None:
    holds_a_loop(backend, old_run)
    with backend.database.write() as connection:
        connection.execute(update(audit_items).values(lease_until_s=audit_items.c.lease_until_s - AGE_S))
    assert standstill_s(backend) > AGE_S / 2


@pytest.mark.parametrize("work", [holds_a_loop, reads_an_upload, explains, sends_a_digest, sweeps])
def test_a_worker_that_is_at_work_is_none_however_old_the_run(
    backend: Backend, old_run: int, work: Callable[[Backend, int], None]
) -> None:
    work(backend, old_run)
    assert standstill_s(backend) < 60.0
    assert doctor.workers(backend).state == "ok"


def test_a_new_run_hides_no_older_one_that_nobody_takes(backend: Backend, old_run: int) -> None:
    start_audit(backend)
    assert standstill_s(backend) > AGE_S / 2


def test_a_worker_that_could_call_nobody_has_given_a_sign(
    backend: Backend, old_run: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its run is to be announced again, which says nothing of when it was heard."""
    one_each = with_settings(backend, chunk_loops=1, chunk_budget_s=1e-6)
    monkeypatch.setattr(backend.queue, "audit_chunks", lambda *_: False)
    assert audit_chunk(one_each, old_run, "w") == 1
    assert standstill_s(backend) < 60.0
    with backend.database.write() as connection:
        assert to_announce(connection, backend.settings.stalled_s) == [old_run]


def test_who_waits_for_a_run_that_nobody_works_on_is_told_so(backend: Backend, old_run: int) -> None:
    told = "Nobody works on it: for 20 minutes no worker has given a sign of life."
    assert run_figures(backend, str(old_run)).nobody_works.startswith(told)
    assert f" is still running, 0 of 2 loops audited. {told}" in newest_run(backend).words
    holds_a_loop(backend, old_run)
    assert run_figures(backend, str(old_run)).nobody_works == ""
    assert newest_run(backend).words.endswith("0 of 2 loops audited")


def test_a_standstill_is_told_to_health_checks(backend: Backend, old_run: int) -> None:
    with pytest.raises(RequestError, match="no worker has given a sign of life for"):
        refuse_standstill(backend.settings)
    sweep(backend)
    refuse_standstill(backend.settings)
