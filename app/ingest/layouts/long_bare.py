"""Long without a row of names: a column of times, one of tags, one of values and perhaps one of good and bad, in any
order."""

from collections import Counter

from app.ingest.columns.headings import begins_with_data
from app.ingest.columns.names import counts_rows, first_row_of_times, mostly_numbers, numbers_of
from app.ingest.columns.plans import LongPlan
from app.ingest.columns.widths import refuse_parted_decimals, usual_width
from app.ingest.files.head import Head, is_number
from app.ingest.model import IngestOptions
from app.ingest.tags.quality import holds_quality_words, tell_quality_for_sure
from app.ingest.times.stamps import find_form

_MOST_ALIKE = 0.5  # of the rows, that have the same value; more have the same code


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
    values = [index for index in rest if mostly_numbers(columns[index], head.decimal_mark)]
    form = forms[times[0]]
    if not values or form is None:
        return None
    value = _value(head, columns, values)
    quality = next((index for index in rest if index != value and _tell_quality(columns[index])), None)
    tags = [index for index in rest if index != quality and _are_tags(columns[index], head.decimal_mark)]
    if not tags:
        return None
    cut = _is_cut(head, columns)
    if not begins_with_data(head, first_row_of_times(head, times[0], options), [value], start=int(cut)):
        return None
    refuse_parted_decimals(head, value)
    return LongPlan("long_bare", 0, width, (times[0],), form, tags[0], value, quality)


def _value(head: Head, columns: list[list[str]], numbers: list[int]) -> int:
    """The first column of numbers that least count the rows or are codes: of qualities, or the same in most rows."""

    def doubts(index: int) -> tuple[int, bool]:
        fields = columns[index]
        is_code = max(Counter(fields).values()) > _MOST_ALIKE * len(fields)
        counts = counts_rows(numbers_of(head, index, 0))
        return sum((is_code, counts, _tell_quality(fields))), counts

    return min(numbers, key=doubts)


def _tell_quality(fields: list[str]) -> bool:
    return tell_quality_for_sure(fields) or holds_quality_words(fields)


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
