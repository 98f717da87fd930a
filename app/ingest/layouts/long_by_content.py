"""Long under names that are not known: a column of stamps, one of words that repeat and are tags of signals, one of
numbers."""

from app.ingest.columns.names import VALUE_NAMES, mostly_numbers, names_no_measurement, quality_of
from app.ingest.columns.of_words import column_that_parts_tags, refuse_to_mix
from app.ingest.columns.plain_names import plain
from app.ingest.columns.plans import LongPlan
from app.ingest.columns.time_columns import times_of_rows
from app.ingest.columns.widths import named_width
from app.ingest.files.head import PREAMBLE_ROWS, Head, is_number
from app.ingest.model import IngestOptions
from app.ingest.tags.grouping import place
from app.ingest.times.stamps import find_form

_MOST_COLUMNS = 24


def sniff(head: Head, options: IngestOptions) -> LongPlan | None:
    for at, names in enumerate(head.rows[:PREAMBLE_ROWS]):
        named = [name for name in names if name]
        if not 3 <= len(named) <= len(names) <= _MOST_COLUMNS:
            continue
        if any(is_number(name, head.decimal_mark) for name in named):
            continue
        plan = _plan(head, names, at + 1, options)
        if plan is not None:
            refuse_to_mix(names, column_that_parts_tags(plan, head))
            return plan
    return None


def _plan(head: Head, names: tuple[str, ...], first_row: int, options: IngestOptions) -> LongPlan | None:
    columns = {index: head.column(index, first_row) for index in range(len(names))}
    tags = [index for index, fields in columns.items() if _are_tags(fields, head.decimal_mark)]
    if not tags:
        return None
    found = times_of_rows(head, names, first_row, options)
    if found is None:
        return None
    time, form = found
    if find_form([names[time[0]]], "", options) is not None:
        return None  # a row of data
    value = _value(head, names, {index: columns[index] for index in columns if index not in time})
    if value is None:
        return None
    quality = quality_of(head, [plain(name) for name in names], first_row, {*time, tags[0], value})
    width = named_width(head, names, first_row, time)
    return LongPlan("long", first_row, width, time, form, tags[0], value, quality)


def _value(head: Head, names: tuple[str, ...], columns: dict[int, list[str]]) -> int | None:
    """The one column of numbers; of several one that is called value. None where some are signals by their names."""
    numbers = [
        index
        for index, fields in columns.items()
        if mostly_numbers(fields, head.decimal_mark) and not names_no_measurement(names[index])
    ]
    called = [index for index in numbers if plain(names[index]) in VALUE_NAMES]
    if any(place(names[index], "").signal != "OTHER" for index in numbers if index not in called):
        return None
    return called[0] if called else numbers[0] if len(numbers) == 1 else None


def _are_tags(fields: list[str], decimal_mark: str) -> bool:
    """Whether words repeat and most of them tell a loop and its signal."""
    words = set(fields)
    if not words or 2 * len(words) > len(fields) or any(is_number(word, decimal_mark) for word in words):
        return False
    places = [place(word, "") for word in words]
    return 2 * sum(at.loop != "" and at.signal != "OTHER" for at in places) > len(places)
