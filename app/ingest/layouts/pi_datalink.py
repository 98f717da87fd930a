"""PI DataLink: pairs of columns (time, value), a pair a tag; the times differ from tag to tag."""

from app.ingest.columns import NO_ROWS, first_row_of_times, plain
from app.ingest.head import Head
from app.ingest.model import IngestOptions
from app.ingest.plans import TimedColumns, ValueColumn, WidePlan
from app.ingest.stamps import TimeForm, find_form
from app.ingest.widths import usual_width

_GENERIC = frozenset(("", "time", "timestamp", "value", "datetime", "date"))


def sniff(head: Head, options: IngestOptions) -> WidePlan | None:
    first_row = first_row_of_times(head, 0, options)
    width = usual_width(head, max(first_row, 0))
    if first_row == NO_ROWS or width < 4 or width % 2:
        return None
    forms = [_dated(head.column(index, first_row), options) for index in range(width)]
    if any((form is None) == (index % 2 == 0) for index, form in enumerate(forms)):
        return None
    groups = tuple(
        TimedColumns((index,), form, (ValueColumn(index + 1, _tag(head, index, first_row)),))
        for index, form in enumerate(forms)
        if form is not None
    )
    return WidePlan("pi_datalink", first_row, width, groups)


def _dated(fields: list[str], options: IngestOptions) -> TimeForm | None:
    form = find_form(fields, "date", options)
    return form if form is not None and form.kind != "relative" else None


def _tag(head: Head, index: int, first_row: int) -> str:
    """The first name that stands above the pair."""
    for row in head.rows[:first_row]:
        for name in row[index : index + 2]:
            if plain(name) not in _GENERIC:
                return name
    return f"{head.stem}.{index // 2 + 1}"
