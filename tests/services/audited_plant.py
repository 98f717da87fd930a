"""A small plant that was audited, and its verdicts as if they had been others."""

from collections.abc import Callable

from sqlalchemy import update

from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.backend import Backend
from app.storage.tables import newest_rows, verdicts

AddLoops = Callable[..., dict[str, int]]


def audited(backend: Backend) -> int:
    run = start_audit(backend)
    audit_chunk(backend, int(run.id), "test")
    return int(run.id)


def rewrite(backend: Backend, run: int, loop: int, **values: object) -> None:
    """A verdict as if it had been another one, in the row of the verdict after it too."""
    mine = (verdicts.c.audit_id == run, verdicts.c.loop_id == loop)
    after = (newest_rows.c.before_audit_id == run, newest_rows.c.loop_id == loop)
    with backend.database.write() as connection:
        connection.execute(update(verdicts).where(*mine).values(**values))
        if "verdict" in values:
            connection.execute(update(newest_rows).where(*after).values(verdict_before=values["verdict"]))


def rewrite_newest(backend: Backend, loop: int, **values: object) -> None:
    with backend.database.write() as connection:
        connection.execute(update(newest_rows).where(newest_rows.c.loop_id == loop).values(**values))
