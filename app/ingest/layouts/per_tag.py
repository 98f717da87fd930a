"""PI, a file a tag: time and value without a row of names; the tag is the file's name."""

from app.ingest.columns.headings import begins_with_data
from app.ingest.columns.plans import TimedColumns, ValueColumn, WidePlan
from app.ingest.columns.time_columns import first_row_of_times
from app.ingest.columns.time_names import time_columns
from app.ingest.columns.widths import usual_width
from app.ingest.files.head import Head
from app.ingest.model import IngestOptions
from app.ingest.times.stamps import find_form


def sniff(head: Head, options: IngestOptions) -> WidePlan | None:
    if usual_width(head, 0) != 2:
        return None
    form = find_form(head.column(0, 0), "", options)
    if form is None or form.kind == "relative":
        return None
    if any(0 in time_columns(head.row(at)) for at in range(first_row_of_times(head, 0, options))):
        return None  # names of columns, of which the other one may be a number: Time,4711
    if not begins_with_data(head, first_row_of_times(head, 0, options), values=(1,)):
        return None
    return WidePlan("per_tag", 0, 2, (TimedColumns((0,), form, (ValueColumn(1, head.stem),)),))
