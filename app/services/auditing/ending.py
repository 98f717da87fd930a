"""What ends a run: its verdicts are heard beside those of other loops."""

import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection

from app.engine.plant_wide.cascades import cascades
from app.engine.plant_wide.excerpts import Excerpts
from app.json_texts import stored_json
from app.services.audit_json.excerpts import by_tag
from app.services.audit_json.line import flat_health, flat_reasons
from app.services.audit_json.rows import as_row, fixed_part
from app.services.audit_json.swings import candidates
from app.services.auditing import hearing
from app.services.auditing.hearing import Heard, Said
from app.services.auditing.unanswered import of_plant, unknown_since
from app.services.backend import Backend
from app.services.database_errors import DATABASE_AWAY
from app.services.moments import PlantClock
from app.services.patience import patiently
from app.storage import audits, verdicts
from app.storage.details import details_of, pack_detail
from app.storage.unanswered import unanswered, unanswered_before
from app.storage.verdict_writing import Reworded, reword
from app.storage.verdicts import ExcerptsRow, SwingRow

AT_ONCE = 250  # verdicts whose details are read together, and are in memory unpacked

log = logging.getLogger("loopaudit.audit")


def end_if_complete(backend: Backend, audit_id: int) -> bool:
    """Whether the run has ended by this: nothing of it is left to do. May run twice at once."""
    with backend.database.read() as connection:
        if audit_id not in audits.complete(connection):
            return False
    return _end(backend, audit_id)


def cancel(backend: Backend, audit_id: int) -> None:
    """Calls off what is left of a run and ends it: what it has found by then stays, and is heard as at any other end.
    Broken off in between, it is ended by the next sweep."""

    def call_off() -> None:
        with backend.database.write() as connection:
            audits.cancel(connection, audit_id)

    patiently(call_off, backend.settings.lease_s)  # workers hold claims of it, and write them in another order
    end_if_complete(backend, audit_id)


def _end(backend: Backend, audit_id: int) -> bool:
    """A run ends whatever goes wrong with its words: one that never does would keep the nights after it from theirs."""
    heard = _hear_or_nothing(backend, audit_id)
    try:
        return _write(backend, audit_id, heard)
    except DATABASE_AWAY:
        raise
    except Exception:
        log.exception("what other loops tell is not written", extra={"run": audit_id})
        return _write(backend, audit_id, [])


def _write(backend: Backend, audit_id: int, heard: list[Reworded]) -> bool:
    with backend.database.write() as connection:
        ended = audits.end_if_complete(connection, audit_id)
        if ended:  # who comes second, or after a cancellation, would reword what readers keep as the run's last word
            reword(connection, heard)
    return ended


def _hear_or_nothing(backend: Backend, audit_id: int) -> list[Reworded]:
    """What other loops tell; nothing where it cannot be worked out, because a run ends whatever is kept of a loop."""
    try:
        return _hear_others(backend, audit_id)
    except DATABASE_AWAY:
        raise
    except Exception:
        log.exception("other loops not heard", extra={"run": audit_id})
        return []


def _hear_others(backend: Backend, audit_id: int) -> list[Reworded]:
    """The verdicts of the run of which other loops tell something."""
    with backend.database.read() as connection:
        newest = verdicts.said(connection)
        unmoved = unanswered(connection)
        stood_before = unanswered_before(connection, unknown_since(unmoved))
    said = {row.tag: Said(row.verdict, row.reliability, row.stiction_probability) for row in newest}
    ids = {row.tag: row.loop_id for row in newest if row.audit_id == audit_id}
    asked = None if len(ids) == len(newest) else ids.keys()
    stated = {row.tag: row.moves_valve for row in newest if row.moves_valve is not None}
    stand = of_plant(unmoved, stood_before)
    # Worked out between looks: who reads keeps writers waiting on SQLite. What is kept of OP and SP goes before the
    # swings come: of a plant each takes tens of megabytes.
    found = cascades(_moving(backend), asked)
    heard = hearing.hear(said, candidates(_swings(backend)), found, asked, stated, stand)
    wanted = sorted((ids[tag], tag) for tag in heard if tag in ids)
    parts = (dict(wanted[at : at + AT_ONCE]) for at in range(0, len(wanted), AT_ONCE))
    with backend.database.read() as connection:
        return [one for some in parts for one in _all_reworded(connection, audit_id, some, heard, backend.clock)]


def _swings(backend: Backend) -> list[SwingRow]:
    with backend.database.read() as connection:
        return verdicts.swings(connection)


def _moving(backend: Backend) -> dict[str, Excerpts]:
    """What is kept of OP and SP, read by the part: the texts of a plant take more than what they tell, and between two
    parts nobody who writes waits."""
    found: dict[str, Excerpts] = {}
    last = 0
    while rows := _excerpts(backend, last):
        found |= by_tag(rows)
        last = rows[-1].loop_id
    return found


def _excerpts(backend: Backend, after: int) -> list[ExcerptsRow]:
    with backend.database.read() as connection:
        return verdicts.excerpts(connection, after)


def _all_reworded(
    connection: Connection, audit_id: int, some: dict[int, str], heard: Mapping[str, Heard], clock: PlantClock
) -> Iterator[Reworded]:
    """Of these loops, tags by key, those whose newest verdict is of the run."""
    rows = verdicts.newest_of(connection, list(some))
    details, extras = details_of(connection, some, audit_id), verdicts.extras(connection, some, audit_id)
    for loop_id, tag in some.items():
        if tag in rows and rows[tag]["audit_id"] == audit_id:
            stored = Stored(rows[tag], details.get(loop_id, {}), extras.get(loop_id, {}))
            yield _reworded(stored, loop_id, heard[tag], clock)


@dataclass(frozen=True)
class Stored:
    """A verdict as it is stored: its row, its detail, and those of the row's fields that have no column of their own,
    with what is kept beside them."""

    row: Mapping[str, Any]
    detail: Mapping[str, Any]
    extra: Mapping[str, Any]


def _reworded(stored: Stored, loop_id: int, heard: Heard, clock: PlantClock) -> Reworded:
    row, detail = stored.row, stored.detail
    said = {"reasons": detail.get("reasons", []), "health_parts": detail.get("health", [])}
    told = hearing.reworded(heard, {**row, **said})
    reasons, parts = told.pop("reasons"), told.pop("health_parts")
    columns = {**told, "health_parts": flat_health(parts), **flat_reasons(reasons)}
    of_row = {**row, **columns}
    columns = {name: value for name, value in columns.items() if name not in heard.fields}
    columns["extra_json"] = stored_json({**stored.extra, **heard.fields}).decode()
    wiring = {"moves_set_point_of": heard.moves, "set_point_moved_by": heard.moved_by}
    packed = pack_detail({**detail, "reasons": reasons, "health": parts, **wiring})
    return Reworded(loop_id, row["audit_id"], columns, packed, fixed_part(as_row(of_row), clock))
