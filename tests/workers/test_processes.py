"""Real worker processes: from an upload to its verdicts, and what happens when processes and messages are lost."""

import re
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import func, select, update

from app.queue import Queue
from app.services.auditing import audits
from app.services.backend import Backend
from app.services.intake import uploads
from app.services.plant import loop_verdicts
from app.storage.tables import audit_items, verdicts
from app.storage.tables import loops as loops_table
from tests.table_rows import table_page
from tests.workers.conftest import ended_with

LOOPS = 10


class SilentQueue(Queue):
    """A broker that loses every message."""

    def _send(self, job: str, *arguments: int) -> bool:
        return True


def read_in(plant: Any, data: bytes) -> None:
    upload = plant.send("plant.csv", data)
    plant.wait("reading", lambda: uploads.get_upload(plant.backend, upload.id).state == "done")


def ended(plant: Any, audit_id: str) -> bool:
    return audits.get_audit(plant.backend, audit_id).ended


def verdicts_of(plant: Any, audit_id: str) -> int:
    with plant.backend.database.read() as connection:
        query = select(func.count()).select_from(verdicts).where(verdicts.c.audit_id == int(audit_id))
        return connection.scalar(query)


def test_from_upload_to_verdicts_with_lost_and_doubled_messages(plant: Any, small_export: bytes) -> None:
    worker = plant.start("worker")
    beats = [plant.start("beat"), plant.start("beat")]
    read_in(plant, small_export)

    run = audits.start_audit(plant.backend)
    plant.backend.queue.audit_chunks(int(run.id), 10)
    plant.wait("a run with doubled messages", lambda: ended(plant, run.id))
    assert audits.get_audit(plant.backend, run.id).done == verdicts_of(plant, run.id) == LOOPS
    assert len(table_page(plant.backend).rows) == LOOPS

    deaf = Backend(plant.backend.settings, plant.backend.database, SilentQueue(plant.backend.settings))
    lost = audits.start_audit(deaf)
    plant.wait("a run whose messages were lost", lambda: ended(plant, lost.id))
    assert verdicts_of(plant, lost.id) == LOOPS

    with plant.backend.database.write() as connection:
        connection.execute(update(loops_table).values(created_at=datetime.now(UTC) - timedelta(days=3)))
    nights = lambda: [run for run in audits.list_audits(plant.backend).rows if run.trigger == "nightly"]  # noqa: E731
    plant.wait("the nightly run, caught up", lambda: any(run.ended for run in nights()))
    assert [run.done for run in nights()] == [LOOPS]
    log = plant.log.read_text()
    assert log.count("next nightly audit at ") == 1
    assert re.search(r"nightly audit of \d{4}-\d\d-\d\d started, run \d+", log)
    for process in (worker, *beats):
        process.terminate()
    assert [ended_with(process) for process in (worker, *beats)] == [0, 0, 0]


def test_a_killed_worker_and_a_deadly_loop_leave_a_run_that_ends(plant: Any, small_export: bytes) -> None:
    plant.start("beat")
    worker = plant.start("worker", SLOW_S="0.15", DEADLY="FIC7")
    read_in(plant, small_export)
    run = audits.start_audit(plant.backend)
    plant.wait("claims", lambda: _claimed(plant, run.id) > 0)
    plant.kill(worker)
    plant.start("worker", DEADLY="FIC7")
    plant.wait("the end of the run", lambda: ended(plant, run.id))
    found = audits.get_audit(plant.backend, run.id)
    assert [(failure.loop, failure.code) for failure in found.failures] == [("FIC7", "worker_lost")]
    assert (found.state, found.done, found.failed) == ("partial", LOOPS - 1, 1)
    assert verdicts_of(plant, run.id) == LOOPS - 1
    assert loop_verdicts.loop_health(plant.backend, "FIC6")["audit_id"] == run.id


def test_a_worker_that_is_told_to_stop_finishes_what_it_holds(plant: Any, small_export: bytes) -> None:
    worker = plant.start("worker", SLOW_S="0.3")
    read_in(plant, small_export)
    run = audits.start_audit(plant.backend)
    plant.wait("claims", lambda: _claimed(plant, run.id) > 0)
    worker.terminate()
    assert ended_with(worker) == 0
    plant.running.remove(worker)
    assert _claimed(plant, run.id) == 0
    plant.backend.queue.audit_chunks(int(run.id), 1)
    plant.start("worker")
    plant.wait("the rest", lambda: ended(plant, run.id))
    found = audits.get_audit(plant.backend, run.id)
    assert found.done + found.failed == LOOPS


def _claimed(plant: Any, audit_id: str) -> int:
    with plant.backend.database.read() as connection:
        mine = (audit_items.c.audit_id == int(audit_id), audit_items.c.state == "claimed")
        return connection.scalar(select(func.count()).select_from(audit_items).where(*mine))
