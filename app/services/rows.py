"""Between an audit and the columns of a stored verdict, and back to the row that dashboards read."""

import json
from datetime import datetime, timedelta
from typing import Any

from app.engine.audit import Audit
from app.services.audit_line import ReliabilityRow, audit_line, detail, iso_utc, reliability_row
from app.storage.tables import verdicts
from app.storage.verdicts import NewVerdict, pack_detail

FIELDS = tuple(ReliabilityRow.model_fields)
TIMES = ("window_start", "window_end", "audited_at")
OF_LOOP = ("recording", "loop", "unit")
COLUMNS = frozenset(column.name for column in verdicts.columns)


def new_verdict(
    audit: Audit,
    *,
    loop_id: int,
    audit_id: int,
    origin: datetime,
    audited_at: datetime,
    elapsed_s: float,
    input_ns: tuple[int, int],
) -> NewVerdict:
    """`origin`: the instant of the recording's second 0; `input_ns`: first and last sample given to the engine."""
    line = audit_line(audit, elapsed_s)
    row = reliability_row(line)
    columns = {name: value for name, value in row.items() if name in COLUMNS and name != "audit_id"}
    extra = {name: value for name, value in row.items() if name not in COLUMNS and name not in OF_LOOP}
    columns |= {
        "audited_at": audited_at,
        "window_start": _instant(origin, line["window_start_s"]),
        "window_end": _instant(origin, line["window_end_s"]),
        "input_start_ns": input_ns[0],
        "input_end_ns": input_ns[1],
        "extra_json": json.dumps(extra),
    }
    return NewVerdict(loop_id, audit_id, columns, pack_detail({**detail(audit), "reasons": line["reasons"]}))


def as_row(stored: dict[str, Any]) -> dict[str, Any]:
    """A stored verdict as a row of the reliability table: each field of the contract, None where this row has none."""
    row = {name: stored.get(name) for name in FIELDS}
    row["recording"] = row["loop"] = stored["tag"]
    row["audit_id"] = str(stored["audit_id"])
    for name in TIMES:
        row[name] = iso_utc(stored[name])
    return row


def _instant(origin: datetime, seconds: float | None) -> datetime | None:
    return None if seconds is None else origin + timedelta(seconds=seconds)
