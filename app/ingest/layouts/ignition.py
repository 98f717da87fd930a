"""Ignition's dataset export: #NAMES, the names, #TYPES, the types, #ROWS with their number, then the rows."""

from app.ingest.columns.names import long_from, wide_from
from app.ingest.columns.plans import Plan
from app.ingest.files.head import Head
from app.ingest.model import IngestOptions


def sniff(head: Head, options: IngestOptions) -> Plan | None:
    marks = {
        row[0].strip().upper(): index for index, row in enumerate(head.rows[:10]) if row and row[0].startswith("#")
    }
    if "#NAMES" not in marks or "#ROWS" not in marks:
        return None
    names, first_row = head.row(marks["#NAMES"] + 1), marks["#ROWS"] + 1
    return long_from(head, "ignition", names, first_row, options) or wide_from(
        head, "ignition", names, first_row, options
    )
