"""Long without a row of names: a column of times, one of tags, one of values and perhaps one of good and bad, in any
order."""

from app.ingest.columns.headings import begins_with_data
from app.ingest.columns.names import first_row_of_times, mostly_numbers
from app.ingest.columns.plans import LongPlan
from app.ingest.columns.widths import refuse_parted_decimals, usual_width
from app.ingest.files.head import Head, is_number
from app.ingest.model import IngestOptions
from app.ingest.times.stamps import find_form

_QUALITIES = frozenset(("good", "bad", "uncertain", "questionable"))


def sniff(head: Head, options: IngestOptions) -> LongPlan | None:
    width = usual_width(head, 0)
    if not 3 <= width <= 12:
        return None
    full = [row for row in head.rows if len(row) == width]
    columns = [[row[index] for row in full if row[index]] for index in range(width)]
    forms = [find_form(column, "", options) for column in columns]
    times = [index for index, form in enumerate(forms) if form is not None and form.kind != "relative"]
    if not times:
        return None
    rest = [index for index in range(width) if index != times[0]]
    quality = next(
        (index for index in rest if columns[index] and {text.lower() for text in columns[index]} <= _QUALITIES), None
    )
    values = [index for index in rest if mostly_numbers(columns[index], head.decimal_mark)]
    tags = [index for index in rest if index != quality and _are_tags(columns[index], head.decimal_mark)]
    form = forms[times[0]]
    if not values or not tags or form is None:
        return None
    cut = _is_cut(head, columns)
    if not begins_with_data(head, first_row_of_times(head, times[0], options), values[:1], start=int(cut)):
        return None
    refuse_parted_decimals(head, values[0])
    return LongPlan("long_bare", 0, width, (times[0],), form, tags[0], values[0], quality)


def _is_cut(head: Head, columns: list[list[str]]) -> bool:
    """Whether the first line lost its begin, as where a log was cut to a size: behind its first field stands what
    stands at the end of the others."""
    rest = head.row(0)[1:]
    return 0 < len(rest) < len(columns) - 1 and all(
        text in fields or (is_number(text, head.decimal_mark) and mostly_numbers(fields, head.decimal_mark))
        for text, fields in zip(rest, columns[-len(rest) :], strict=True)
    )


def _are_tags(fields: list[str], decimal_mark: str) -> bool:
    if not fields or any(is_number(field, decimal_mark) for field in fields):
        return False
    return any(character.isdigit() or character in "._-/:" for field in fields for character in field)
