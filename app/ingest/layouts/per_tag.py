"""PI, a file a tag: time and value without a row of names; the tag is the file's name."""

import re

from app.ingest.columns.headings import begins_with_data
from app.ingest.columns.plans import TimedColumns, ValueColumn, WidePlan
from app.ingest.columns.time_columns import first_row_of_times
from app.ingest.columns.time_names import time_columns
from app.ingest.columns.widths import usual_width
from app.ingest.files.head import Head
from app.ingest.model import IngestOptions
from app.ingest.times.stamps import find_form

COLUMNS = 2
_DAY = re.compile(r"(19|20)\d\d[01]\d[0-3]\d")


def sniff(head: Head, options: IngestOptions) -> WidePlan | None:
    if usual_width(head, 0) != COLUMNS:
        return None
    form = find_form(head.column(0, 0), "", options)
    if form is None or form.kind == "relative":
        return None
    first_row = first_row_of_times(head, 0, options)
    if _names_a_number(head, first_row) or not begins_with_data(head, first_row, values=(1,)):
        return None
    return WidePlan("per_tag", 0, 2, (TimedColumns((0,), form, (ValueColumn(1, head.stem),)),))


def _names_a_number(head: Head, first_row: int) -> bool:
    """Whether one row above the data names both columns, of which the other one may be a number: Time,4711. What is
    told of the export, as in Date,20260701 above Time,120000, names none."""
    named = [head.row(at) for at in range(first_row) if 0 in time_columns(head.row(at))]
    return len(named) == 1 and len(named[0]) == COLUMNS and _DAY.fullmatch(named[0][1]) is None
