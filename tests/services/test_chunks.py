"""How long a worker goes on with a run, and how many of them are called: a task ends in time, and calls do not pile
up."""

import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from sqlalchemy import Connection, select, update
from sqlalchemy.exc import OperationalError

from app.engine.audit import Audit
from app.engine.audit_config import AuditConfig
from app.services.auditing import audits, chunks
from app.services.backend import Backend
from app.services.upkeep.sweep import sweep, take_back_loops
from app.storage import Database, items
from app.storage.database import CommitLostError
from app.storage.tables import audit_items, verdicts
from app.storage.tables import audits as audits_table
from tests.services.audited_plant import AddLoops
from tests.services.upkeep_plant import with_settings

LOOPS = tuple(f"FIC{number}" for number in range(8))
LOOP_S = 0.05


@pytest.fixture
def rung(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> deque[int]:
    """The messages that wait for a worker, the oldest first."""
    waiting: deque[int] = deque()

    def ring(audit_id: int, messages: int) -> bool:
        waiting.extend([audit_id] * messages)
        return True

    monkeypatch.setattr(backend.queue, "audit_chunks", ring)
    return waiting


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each audit takes a while."""
    once = chunks.audit

    def slowly(*given: Any) -> Audit:
        time.sleep(LOOP_S)
        return once(*given)

    monkeypatch.setattr(chunks, "audit", slowly)


def answer(backend: Backend, waiting: deque[int]) -> int:
    """A worker takes the oldest message; how many loops it audited."""
    return chunks.audit_chunk(backend, waiting.popleft(), "w")


def items_of(backend: Backend) -> list[tuple[str, int, str | None]]:
    columns = (audit_items.c.state, audit_items.c.attempts, audit_items.c.owner)
    with backend.database.read() as connection:
        return [tuple(row) for row in connection.execute(select(*columns))]


def time_passes(backend: Backend, seconds: float) -> None:
    """As if the run had been announced by so much earlier."""
    with backend.database.write() as connection:
        connection.execute(update(audits_table).values(announced_s=audits_table.c.announced_s - seconds))


@pytest.mark.usefixtures("slow")
def test_a_task_that_is_over_its_time_hands_back_what_it_has_not_begun(
    backend: Backend, add_loops: AddLoops, rung: deque[int]
) -> None:
    """A claim of slow loops would outlast the task's hard limit, at which its process is killed."""
    add_loops(*LOOPS)
    impatient = with_settings(backend, chunk_budget_s=1.5 * LOOP_S)
    run = audits.start_audit(impatient)
    assert 1 <= answer(impatient, rung) <= 3
    left = [item for item in items_of(backend) if item[0] != "done"]
    assert left
    assert set(left) == {("open", 0, None)}
    while rung:
        assert answer(impatient, rung) <= 3
    ended = audits.get_audit(backend, run.id)
    assert (ended.state, ended.done) == ("done", len(LOOPS))


def test_a_run_that_is_worked_on_is_not_announced_again(
    backend: Backend, add_loops: AddLoops, rung: deque[int]
) -> None:
    """Its messages would pile up, each with its own successors, and the audit of one loop waits behind all of them."""
    add_loops(*LOOPS)
    by_two = with_settings(backend, chunk_loops=1, chunk_budget_s=1e-6, fan_out=2)
    run = audits.start_audit(by_two)
    assert len(rung) == 2
    while audits.get_audit(backend, run.id).open > 1:
        time_passes(backend, 2 * backend.settings.stalled_s)
        assert answer(by_two, rung) == 1
        time_passes(backend, backend.settings.stalled_s / 2)
        assert sweep(by_two).announced == 0
        assert len(rung) <= 2
    assert answer(by_two, rung) == 1
    assert audits.get_audit(backend, run.id).state == "done"


def test_a_run_of_which_a_worker_could_call_no_successor_is_announced_again(
    backend: Backend, add_loops: AddLoops, rung: deque[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where others could, a moment later: as many as before are to work on it."""
    add_loops(*LOOPS)
    by_two = with_settings(backend, chunk_loops=1, chunk_budget_s=1e-6, fan_out=2)
    audits.start_audit(by_two)
    with monkeypatch.context() as away:
        away.setattr(backend.queue, "audit_chunks", lambda *_: False)
        assert answer(by_two, rung) == 1
    assert answer(by_two, rung) == 1
    assert len(rung) == 1
    assert sweep(by_two).announced == 1
    assert len(rung) == 3
    assert sweep(by_two).announced == 0


def loses(backend: Backend, audit_id: str, workers: int = 1) -> None:
    """As if so many workers had died with a loop of the run in their hands."""
    with backend.database.write() as connection:
        for number in range(workers):
            assert items.claim(connection, int(audit_id), f"lost{number}", 1, -1.0)


def test_for_a_worker_that_was_lost_another_is_called(backend: Backend, add_loops: AddLoops, rung: deque[int]) -> None:
    add_loops(*LOOPS)
    by_two = with_settings(backend, chunk_loops=1, chunk_budget_s=1e-6, fan_out=2)
    loses(backend, audits.start_audit(by_two).id)
    rung.popleft()
    assert answer(by_two, rung) == 1
    assert len(rung) == 2


def test_for_workers_that_were_lost_a_sweep_calls_as_many(
    backend: Backend, add_loops: AddLoops, rung: deque[int]
) -> None:
    """Those that are left go on, and while they do nobody announces the run."""
    add_loops(*LOOPS)
    by_three = with_settings(backend, chunk_loops=1, chunk_budget_s=1e-6, fan_out=3)
    loses(backend, audits.start_audit(by_three).id, 2)
    rung.popleft()
    rung.popleft()
    assert sweep(by_three).reopened == 2
    assert len(rung) == 3
    assert sweep(by_three).reopened == 0
    assert answer(by_three, rung) == 1
    assert len(rung) == 3


def test_a_worker_is_called_to_the_run_that_lost_one(backend: Backend, add_loops: AddLoops, rung: deque[int]) -> None:
    add_loops(*LOOPS)
    one_each = with_settings(backend, chunk_loops=1, chunk_budget_s=1e-6, fan_out=1)
    first, second = (audits.start_audit(one_each).id for _ in range(2))
    loses(backend, first)
    rung.popleft()
    assert answer(one_each, rung) == 1
    assert sorted(rung) == [int(first), int(second)]


def test_who_was_taken_for_lost_calls_no_successor_beside_the_one_that_was_called(
    backend: Backend, add_loops: AddLoops, rung: deque[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a time in which the database was away that would be one more for each worker, and so each time."""
    add_loops(*LOOPS)
    one_each = with_settings(backend, chunk_loops=1, chunk_budget_s=1e-6, fan_out=1)
    audits.start_audit(one_each)
    once = chunks.audit

    def outlasts_its_lease(*given: Any) -> Audit:
        with backend.database.write() as connection:
            connection.execute(update(audit_items).values(lease_until_s=0.0))
        take_back_loops(one_each)
        return once(*given)

    with monkeypatch.context() as late:
        late.setattr(chunks, "audit", outlasts_its_lease)
        assert answer(one_each, rung) == 1
    assert len(rung) == 1
    assert answer(one_each, rung) == 1
    assert len(rung) == 1


def test_who_does_not_know_whether_its_verdict_was_written_calls_a_successor(
    backend: Backend, add_loops: AddLoops, rung: deque[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It holds none of its claims any more, and was not taken for lost."""
    add_loops(*LOOPS)
    one_each = with_settings(backend, chunk_loops=1, chunk_budget_s=1e-6, fan_out=1)
    run = audits.start_audit(one_each)
    write, written = type(backend.database).write, []

    @contextmanager
    def answer_is_lost(database: Database) -> Iterator[Connection]:
        with write(database) as connection:
            yield connection
        if items_of(backend).count(("done", 1, None)) and not written:
            written.append(database)
            raise CommitLostError("COMMIT", None, OSError())

    with monkeypatch.context() as breaking:
        breaking.setattr(type(backend.database), "write", answer_is_lost)
        assert answer(one_each, rung) == 1
    assert written
    assert audits.get_audit(backend, run.id).done == 1
    assert len(rung) == 1


def test_where_nobody_could_be_called_for_a_lost_worker_the_run_is_announced_again(
    backend: Backend, add_loops: AddLoops, rung: deque[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    add_loops(*LOOPS)
    by_two = with_settings(backend, chunk_loops=1, chunk_budget_s=1e-6, fan_out=2)
    loses(backend, audits.start_audit(by_two).id)
    rung.clear()
    with monkeypatch.context() as away:
        away.setattr(backend.queue, "audit_chunks", lambda *_: False)
        take_back_loops(by_two)
    assert sweep(by_two).announced == 1
    assert len(rung) == 2


def test_who_goes_on_by_itself_calls_nobody(backend: Backend, add_loops: AddLoops, rung: deque[int]) -> None:
    add_loops(*LOOPS)
    one_each = with_settings(backend, chunk_loops=1, chunk_budget_s=1e-6, fan_out=1)
    run = audits.start_audit(one_each)
    rung.clear()
    assert chunks.audit_chunk(one_each, int(run.id), "cron", calls_successor=False) == 1
    assert not rung


def test_who_goes_on_by_itself_leaves_lost_workers_of_other_runs_to_a_sweep(
    backend: Backend, add_loops: AddLoops, rung: deque[int]
) -> None:
    """It calls nobody, and theirs would have no successor."""
    add_loops(*LOOPS)
    one_each = with_settings(backend, chunk_loops=1, chunk_budget_s=1e-6, fan_out=1)
    own, other = (audits.start_audit(one_each).id for _ in range(2))
    loses(backend, own)
    loses(backend, other)
    rung.clear()
    assert chunks.audit_chunk(one_each, int(own), "cron", calls_successor=False) == 1
    assert not rung
    assert sweep(one_each).reopened == 1
    assert list(rung) == [int(other)]


def test_a_full_disk_counts_no_attempt(
    backend: Backend, add_loops: AddLoops, rung: deque[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    add_loops("FIC1", "FIC2")
    run = audits.start_audit(backend)
    tried: list[int] = []

    def without_room(*_: Any) -> None:
        tried.append(1)
        raise OperationalError("INSERT INTO verdicts", {}, Exception("database or disk is full"))

    with monkeypatch.context() as patched:
        patched.setattr(chunks.verdict_writing, "add", without_room)
        with pytest.raises(OperationalError):
            answer(backend, rung)
    assert len(tried) == 1
    assert not rung
    assert items_of(backend) == [("open", 0, None)] * 2
    chunks.audit_chunk(backend, int(run.id), "w")
    assert [item[0] for item in items_of(backend)] == ["done"] * 2


def test_a_run_that_an_older_version_planned_ends_though_it_names_a_setting_that_is_none_any_more(
    backend: Backend, add_loops: AddLoops, rung: deque[int]
) -> None:
    add_loops(*LOOPS[:2])
    run = audits.start_audit(backend)
    planned = '{"judgement":{"of_another_version":0.5},"max_samples":700}'
    with backend.database.write() as connection:
        connection.execute(update(audits_table).values(config_json=planned))
    chunks.audit_chunk(backend, int(run.id), "w")
    assert audits.get_audit(backend, run.id).state == "done"
    with backend.database.read() as connection:
        made_with = connection.scalars(select(verdicts.c.config_fingerprint)).all()
    assert made_with == [AuditConfig().fingerprint()] * 2
