"""One task a job. Every task may run twice, and finds in the database whether there is something to do."""

import logging
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import ParamSpec

from celery import shared_task

from app.errors import RequestError
from app.queue import AUDIT_CHUNK, DELIVER, EXPLAIN, READ_UPLOAD, SWEEP
from app.services.auditing import chunks
from app.services.data_folder import folder_away
from app.services.database_errors import DATABASE_AWAY, no_room, takes_no_writes
from app.services.digests import deliveries
from app.services.explaining import working as explaining
from app.services.intake import reading
from app.services.telling.naming import one_line
from app.services.upkeep import sweep as sweeping
from workers.process import backend, is_outdated

P = ParamSpec("P")

log = logging.getLogger("loopaudit.worker")


@contextmanager
def a_line_if_away() -> Iterator[None]:
    """A disk that is full, or takes nothing, and a database that is away are no fault of the task: what it was for
    waits, and is tried again. That is so every few seconds, and needs no traceback each time."""
    try:
        yield
    except RequestError as error:
        log.error("%s; what waits is tried again", one_line(error.message), extra={"code": error.code})
    except (*DATABASE_AWAY, OSError) as error:
        wanting = what_is_wanting(error)
        if not wanting:
            raise
        reason = getattr(error, "orig", None) or error
        log.error("%s; what waits is tried again: %s", wanting, one_line(str(reason)))


def what_is_wanting(error: Exception) -> str:
    """Empty for a fault of ours."""
    if no_room(error):
        return "no room on the disk, make room"
    if folder_away(backend().settings, error):
        return "the data folder is gone or read-only"
    if isinstance(error, DATABASE_AWAY):
        if takes_no_writes(error):
            return "the database takes no writes"
        if not sweeping.answers(backend()):
            return "the database does not answer"
    return ""


def unless_outdated(task: Callable[P, None]) -> Callable[P, None]:
    @wraps(task)
    def checked(*arguments: P.args, **named: P.kwargs) -> None:
        if not is_outdated():
            task(*arguments, **named)

    return checked


@shared_task(name=READ_UPLOAD)
@a_line_if_away()
@unless_outdated
def read_upload(upload_id: int) -> None:
    reading.read_upload(backend(), upload_id, owner=uuid.uuid4().hex)


@shared_task(name=AUDIT_CHUNK)
@a_line_if_away()
@unless_outdated
def audit_chunk(audit_id: int) -> None:
    chunks.audit_chunk(backend(), audit_id, owner=uuid.uuid4().hex, watchdog=True)


@shared_task(name=EXPLAIN)
@a_line_if_away()
@unless_outdated
def explain() -> None:
    explaining.explain_next(backend(), owner=uuid.uuid4().hex, watchdog=True)


@shared_task(name=DELIVER)
@a_line_if_away()
@unless_outdated
def deliver() -> None:
    deliveries.deliver_next(backend(), owner=uuid.uuid4().hex)


@shared_task(name=SWEEP)
@a_line_if_away()
@unless_outdated
def sweep() -> None:
    sweeping.sweep(backend())
