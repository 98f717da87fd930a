"""What the verdicts of a loop say: the newest one, those before it, and what they rest on."""

from typing import Any

from app.errors import NotFoundError
from app.services.audit_json.rows import FORM, KEY_FIGURES, as_row, compact, sent
from app.services.backend import Backend
from app.services.cursors import decode, identifier, page_of
from app.services.loops import OneLoop, find, unknown
from app.services.plant.written import marks_of, written_of
from app.services.results import Page
from app.services.stating.shelving import Shelf
from app.storage import continuing, items, verdicts
from app.storage.details import detail_of


def loop_health(backend: Backend, tag: str, shelved: Shelf | None = None) -> dict[str, Any]:
    """The newest verdict and the key figures, flat; shelved: None: as of now. Raises NotFoundError where the loop was
    never audited."""
    with backend.database.read() as connection:
        found = verdicts.newest(connection, tag)
    if found is None:
        raise unknown(tag)
    loop_id, newest = found
    if newest is None:
        raise NotFoundError("not_audited", f"loop {tag!r} has not been audited yet")
    figures = newest.get(KEY_FIGURES)
    if figures is None:  # a verdict that an older version wrote
        with backend.database.read() as connection:
            figures = (detail_of(connection, loop_id, newest["audit_id"]) or {}).get(KEY_FIGURES, {})
    row = as_row(newest)
    return written_of(backend, [row], shelved).beside(row) | figures


def loop_health_json(backend: Backend, tag: str) -> str:
    """`loop_health` as JSON, in most cases as it was written with the verdict."""
    with backend.database.read() as connection:
        written = verdicts.sent_health(connection, tag, FORM)
    if written is None or marks_of(backend, [tag]).tags:
        return compact(loop_health(backend, tag))
    row, figures, unit = written
    return sent(row, unit, figures)


def verdict_history(
    backend: Backend, loop: OneLoop, limit: int = 100, cursor: str | None = None
) -> Page[dict[str, Any]]:
    """A loop's verdicts, the newest first."""
    row = find(backend, loop)
    before = decode(cursor, (int,))
    with backend.database.read() as connection:
        found = verdicts.history(connection, row.id, limit + 1, before[0] if before else None)
    return page_of(found, limit, as_row, lambda verdict: (verdict["audit_id"],))


def chained_history(backend: Backend, loop: OneLoop, limit: int) -> list[dict[str, Any]]:
    """The same with the verdicts of the loops that it continues behind its own, `loop` of each the tag that it had."""
    row = find(backend, loop)
    with backend.database.read() as connection:
        before = continuing.earlier_of(connection, [row.tag]).get(row.tag, [])
    told: list[dict[str, Any]] = []
    chain: tuple[OneLoop, ...] = (row, *before)
    for one in chain:
        told += verdict_history(backend, one, limit - len(told)).rows if len(told) < limit else []
    return told


def newest_failure(backend: Backend, loop: OneLoop) -> tuple[int, str] | None:
    """Run and reason where the audit of a loop has failed since its newest verdict."""
    row = find(backend, loop)
    with backend.database.read() as connection:
        return items.newest_failure(connection, row.id, row.newest_audit_id or 0)


def verdict_detail(backend: Backend, loop: OneLoop, audit_id: str | None = None) -> dict[str, Any]:
    """What a verdict rests on: findings, rungs with their curves, spectra. Without `audit_id`: the newest verdict."""
    row = find(backend, loop)
    run = row.newest_audit_id if audit_id is None else identifier(audit_id)
    with backend.database.read() as connection:
        found = detail_of(connection, row.id, run or 0)
    if found is None:
        raise NotFoundError("not_audited", f"loop {row.tag!r} has no verdict from this run")
    return found
