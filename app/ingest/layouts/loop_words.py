"""A row a value of a tag that stands in two columns, loop and signal: Loop,Signal,Time,Value, or InfluxDB's
_time,_value,_field,_measurement."""

from app.ingest.columns.names import TAG_NAMES, VALUE_NAMES, quality_of
from app.ingest.columns.of_loops import Rows, columns_of_loops
from app.ingest.columns.plain_names import first_of_each, plain, words_in
from app.ingest.columns.plans import LongPlan, ValueColumn
from app.ingest.columns.time_columns import times_of_rows
from app.ingest.columns.widths import named_width
from app.ingest.files.head import PREAMBLE_ROWS, Head
from app.ingest.model import IngestOptions
from app.ingest.tags.grouping import AUDITED, place
from app.ingest.times.stamps import TimeForm

_LAYOUT = "loop_words"
_PROPERTIES = frozenset(("property", "propertyname", "attribute", "attributename", "parameter", "parametername"))


def sniff(head: Head, options: IngestOptions) -> LongPlan | None:
    for at, names in enumerate(head.rows[:PREAMBLE_ROWS]):
        known = first_of_each(words_in(names))
        value = next((known[name] for name in VALUE_NAMES if name in known), None)
        if value is not None and len(names) > 3:
            plan = _plan(head, names, at + 1, value, options)
            if plan is not None:
                return plan
    return None


def _plan(head: Head, names: tuple[str, ...], first_row: int, value: int, options: IngestOptions) -> LongPlan | None:
    known = [plain(name) for name in names]
    columns = {index: head.column(index, first_row) for index in range(len(names)) if index != value}
    word = next((index for index, fields in columns.items() if _are_words_of_signals(known[index], fields)), None)
    others = [
        index
        for index in columns
        if index != word and not (word is not None and _have_word(head, first_row, index, word))
    ]
    loops = columns_of_loops(head, names, first_row, others, in_words=word is not None)
    is_influx = "measurement" in known and "field" in known
    if not is_influx and (word is None or not loops):
        return None
    found = times_of_rows(head, names, first_row, options)
    if found is None:
        return None
    alone = not is_influx and word is not None and known[word] not in TAG_NAMES  # else the file names its loop
    loops = Rows(head, names, first_row, found, options, word).loops(loops, one_place=alone)
    if is_influx:
        tag, word = _of_influx(head, first_row, known.index("field"), [*loops, known.index("measurement")][0])
    else:
        tag = next(iter(loops), None)
    return None if tag is None else _joined(head, names, first_row, value, tag, word, found)


def _of_influx(head: Head, first_row: int, field: int, loop: int) -> tuple[int | None, int | None]:
    """The columns of tag and word. A field of one value is called so, and the measurement is the tag then; a field may
    be a whole tag."""
    fields = set(head.column(field, first_row))
    if not fields:
        return None, None
    if all(plain(text) in VALUE_NAMES for text in fields):
        return loop, None
    whole = all(place(text, "").loop and place(text, "").signal != "OTHER" for text in fields)
    return (field, None) if whole else (loop, field)


def _joined(
    head: Head,
    names: tuple[str, ...],
    first_row: int,
    value: int,
    tag: int,
    word: int | None,
    times: tuple[tuple[int, ...], TimeForm],
) -> LongPlan:
    time, form = times
    quality = quality_of(head, [plain(name) for name in names], first_row, {*time, tag, value, word})
    width = named_width(head, names, first_row, time)
    signals = () if word is None else (ValueColumn(value, ""),)
    return LongPlan(_LAYOUT, first_row, width, time, form, tag, value, quality, signals=signals, word=word)


def _have_word(head: Head, first_row: int, column: int, word: int) -> bool:
    """Whether most cells of a column end with the words beside them: whole tags, as Plant.FIC1.PV beside PV."""
    rows = [row for row in head.rows[first_row:] if len(row) > max(column, word) and row[word]]
    whole = sum(row[column].endswith((f".{row[word]}", f"/{row[word]}")) for row in rows)
    return 2 * whole > len(rows)


def _are_words_of_signals(name: str, fields: list[str]) -> bool:
    """Whether all fields are names of signals without a loop; under the name of properties, PV and OP among others."""
    places = [place(text, "") for text in set(fields)]
    signals = [at.signal for at in places if at.loop == "" and at.signal != "OTHER"]
    among_others = name in _PROPERTIES and AUDITED.issubset(signals)
    return among_others or 0 < len(signals) == len(places)
