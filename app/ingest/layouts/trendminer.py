"""TrendMiner: four header rows (tag, description, unit, type), then ISO times with an offset."""

from app.ingest.columns.headings import is_data
from app.ingest.columns.plans import WidePlan
from app.ingest.columns.plans_by_names import wide_from
from app.ingest.columns.time_columns import first_row_of_times
from app.ingest.files.head import Head
from app.ingest.model import IngestOptions

_HEADERS = 4


def sniff(head: Head, options: IngestOptions) -> WidePlan | None:
    if len(head.rows) <= _HEADERS or first_row_of_times(head, 0, options) != _HEADERS:
        return None
    widths = {len(row) for row in head.rows[:_HEADERS]}
    if len(widths) != 1 or widths == {1} or not all((*head.row(0)[1:], *map(any, head.rows[:_HEADERS]))):
        return None
    if any(is_data(head, at, range(1, len(head.row(0)))) for at in range(1, _HEADERS)):
        return None  # rows of data, whose times cannot be read
    return wide_from(head, "trendminer", head.row(0), (0,), _HEADERS, options, time=(0,))
