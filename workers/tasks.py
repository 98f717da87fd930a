"""One task a job. Every task may run twice, and finds in the data base whether there is something to do."""

import uuid

from celery import shared_task

from app.queue import AUDIT_CHUNK, DELIVER, EXPLAIN, READ_UPLOAD, SWEEP
from app.services.auditing import chunks
from app.services.digests import deliveries
from app.services.explaining import working as explaining
from app.services.intake import reading
from app.services.upkeep import sweep as sweeping
from workers.process import backend


@shared_task(name=READ_UPLOAD)
def read_upload(upload_id: int) -> None:
    reading.read_upload(backend(), upload_id, owner=uuid.uuid4().hex)


@shared_task(name=AUDIT_CHUNK)
def audit_chunk(audit_id: int) -> None:
    chunks.audit_chunk(backend(), audit_id, owner=uuid.uuid4().hex, watchdog=True)


@shared_task(name=EXPLAIN)
def explain() -> None:
    explaining.explain_next(backend(), owner=uuid.uuid4().hex, watchdog=True)


@shared_task(name=DELIVER)
def deliver() -> None:
    deliveries.deliver_next(backend(), owner=uuid.uuid4().hex)


@shared_task(name=SWEEP)
def sweep() -> None:
    sweeping.sweep(backend())
