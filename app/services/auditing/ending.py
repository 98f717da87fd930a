"""What ends a run: its verdicts are heard beside their neighbours'."""

import logging
from collections.abc import Callable, Mapping
from typing import Any

from sqlalchemy import Connection
from sqlalchemy.exc import SQLAlchemyError

from app.engine.plant_wide import groups
from app.services.auditing import hearing
from app.services.auditing.audit_line import flat_health, flat_reasons
from app.services.auditing.hearing import Doubt
from app.services.auditing.rows import as_row, fixed_part
from app.services.auditing.swings import candidates
from app.services.backend import Backend
from app.storage import audits, verdicts
from app.storage.verdicts import Reworded, pack_detail

log = logging.getLogger("loopaudit.audit")


def end_if_complete(backend: Backend, audit_id: int) -> bool:
    """Whether the run has ended by this: nothing of it is left to do. May run twice at once."""
    with backend.database.read() as connection:
        if audit_id not in audits.complete(connection):
            return False
    return _end(backend, audit_id, audits.end_if_complete)


def cancel(backend: Backend, audit_id: int) -> bool:
    """Whether the run was still to be cancelled: what it has found by then stays, and is heard as at any other end."""
    return _end(backend, audit_id, audits.cancel)


def _end(backend: Backend, audit_id: int, by: Callable[[Connection, int], bool]) -> bool:
    with backend.database.read() as connection:
        doubts = _heard(connection, audit_id)
    with backend.database.write() as connection:
        ended = by(connection, audit_id)
        if ended:  # who comes second, or after a cancellation, would reword what readers keep as the run's last word
            verdicts.reword(connection, doubts)
    return ended


def _heard(connection: Connection, audit_id: int) -> list[Reworded]:
    """The doubts; none where they cannot be worked out, because a run ends whatever is kept of a loop."""
    try:
        return _doubts(connection, audit_id)
    except SQLAlchemyError:
        raise
    except Exception:  # the sweep of all runs comes through here: one that never ends would stop the nights
        log.exception("neighbours not heard", extra={"run": audit_id})
        return []


def _doubts(connection: Connection, audit_id: int) -> list[Reworded]:
    """The verdicts of the run that are relied on, and that a neighbour's sticking valve explains as well."""
    relied_on = verdicts.relied_on(connection, audit_id)
    if not relied_on:
        return []
    found = hearing.doubts(groups(candidates(verdicts.swings(connection))), relied_on)
    rows = verdicts.newest_of(connection, [relied_on[tag] for tag in found])
    return [
        _reworded(row, verdicts.detail(connection, relied_on[tag], audit_id) or {}, relied_on[tag], found[tag])
        for tag, row in sorted(rows.items(), key=lambda one: relied_on[one[0]])
        if row["audit_id"] == audit_id
    ]


def _reworded(row: Mapping[str, Any], detail: Mapping[str, Any], loop_id: int, doubt: Doubt) -> Reworded:
    told = hearing.reworded(doubt, row["stiction_probability"], detail.get("reasons", []), detail.get("health", []))
    reasons, parts = told["reasons"], told["health_parts"]
    columns = {
        "reliability": told["reliability"],
        "health": told["health"],
        "health_parts": flat_health(parts),
        **flat_reasons(reasons),
    }
    packed = pack_detail({**detail, "reasons": reasons, "health": parts})
    return Reworded(loop_id, row["audit_id"], columns, packed, fixed_part(as_row({**row, **columns})))
