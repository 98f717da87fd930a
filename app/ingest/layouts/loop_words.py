"""A row a value of a tag that stands in two columns, loop and signal: Loop,Signal,Time,Value, or InfluxDB's
_time,_value,_field,_measurement."""

from app.ingest.columns.names import VALUE_NAMES, plain, quality_named, times_of_rows
from app.ingest.columns.plans import LongPlan, ValueColumn
from app.ingest.columns.widths import named_width
from app.ingest.files.head import PREAMBLE_ROWS, Head, is_number
from app.ingest.layouts.loop_rows import LOOPS_OR_TAGS
from app.ingest.model import IngestOptions
from app.ingest.tags.grouping import place

_LAYOUT = "loop_words"


def sniff(head: Head, options: IngestOptions) -> LongPlan | None:
    for at, names in enumerate(head.rows[:PREAMBLE_ROWS]):
        known = [plain(name) for name in names]
        value = next((known.index(name) for name in VALUE_NAMES if name in known), None)
        if value is not None and len(names) > 3:
            plan = _plan(head, names, at + 1, value, options)
            if plan is not None:
                return plan
    return None


def _plan(head: Head, names: tuple[str, ...], first_row: int, value: int, options: IngestOptions) -> LongPlan | None:
    known = [plain(name) for name in names]
    columns = {index: head.column(index, first_row) for index in range(len(names)) if index != value}
    word = next((index for index, fields in columns.items() if _are_signals(fields)), None)
    loops = [index for index, fields in columns.items() if index != word and _name_loops(head, known[index], fields)]
    if "measurement" in known and "field" in known:
        return _of_influx(head, names, first_row, value, [*loops, known.index("measurement")], options)
    return None if word is None or not loops else _joined(head, names, first_row, value, loops[0], word, options)


def _of_influx(
    head: Head, names: tuple[str, ...], first_row: int, value: int, loops: list[int], options: IngestOptions
) -> LongPlan | None:
    """A field of one value is called so, and the measurement is the tag then; a field may be a whole tag."""
    field = [plain(name) for name in names].index("field")
    fields = set(head.column(field, first_row))
    if not fields:
        return None
    if all(plain(text) in VALUE_NAMES for text in fields):
        return _joined(head, names, first_row, value, loops[0], None, options)
    whole = all(place(text, "").loop and place(text, "").signal != "OTHER" for text in fields)
    tag, word = (field, None) if whole else (loops[0], field)
    return _joined(head, names, first_row, value, tag, word, options)


def _joined(
    head: Head,
    names: tuple[str, ...],
    first_row: int,
    value: int,
    tag: int,
    word: int | None,
    options: IngestOptions,
) -> LongPlan | None:
    found = times_of_rows(head, names, first_row, options)
    if found is None:
        return None
    time, form = found
    quality = quality_named([plain(name) for name in names])
    width = named_width(head, names, first_row, time)
    signals = () if word is None else (ValueColumn(value, ""),)
    return LongPlan(_LAYOUT, first_row, width, time, form, tag, value, quality, signals=signals, word=word)


def _are_signals(fields: list[str]) -> bool:
    """Whether all fields are names of signals without a loop."""
    places = [place(text, "") for text in set(fields)]
    return bool(places) and all(at.loop == "" and at.signal != "OTHER" for at in places)


def _name_loops(head: Head, known: str, fields: list[str]) -> bool:
    return known in LOOPS_OR_TAGS and bool(fields) and not all(is_number(text, head.decimal_mark) for text in fields)
