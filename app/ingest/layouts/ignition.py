"""Ignition's dataset export: #NAMES, the names, #TYPES, the types, #ROWS with their number, then the rows."""

from dataclasses import replace

from app.ingest.columns.plans import Plan
from app.ingest.columns.plans_by_names import long_from, wide_from
from app.ingest.files.head import Head
from app.ingest.model import IngestOptions


def sniff(head: Head, options: IngestOptions) -> Plan | None:
    marks = {
        row[0].strip().upper(): index for index, row in enumerate(head.rows[:10]) if row and row[0].startswith("#")
    }
    if "#NAMES" not in marks or "#ROWS" not in marks:
        return None
    names_at, first_row = marks["#NAMES"] + 1, marks["#ROWS"] + 1
    names = head.row(names_at)
    plan = long_from(head, "ignition", names, first_row, options) or wide_from(
        head, "ignition", names, (names_at,), first_row, options
    )
    types = tuple(at for at in range(names_at + 1, first_row) if at not in marks.values() and any(head.row(at)))
    return plan and replace(plan, first_row=first_row, heading=types)
