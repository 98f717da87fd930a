"""A row a loop and an instant, as a data base's table of loops is queried: Loop,Time,PV,OP,SP. Its signals have the
name of the row's loop before their own."""

from app.ingest.columns.clocks import date_and_clock
from app.ingest.columns.names import QUALITY_NAMES, TAG_NAMES, form_of, plain, stamps_in, time_columns_in
from app.ingest.columns.plans import LongPlan, ValueColumn
from app.ingest.columns.widths import named_width
from app.ingest.files.head import PREAMBLE_ROWS, Head, is_number
from app.ingest.model import IngestOptions
from app.ingest.tags.grouping import AUDITED, place

_LOOP_NAMES = frozenset(("loop", "loopname", "loopid", "looptag"))
LOOPS_OR_TAGS = _LOOP_NAMES | TAG_NAMES | {"controller", "controllername", "block", "blockname"}


def sniff(head: Head, options: IngestOptions) -> LongPlan | None:
    for at, names in enumerate(head.rows[:PREAMBLE_ROWS]):
        signals = _signals(names)
        if AUDITED.issubset(place(signal.tag, "").signal for signal in signals):
            plan = _plan(head, names, at + 1, signals, options)
            if plan is not None:
                return plan
    return None


def _plan(
    head: Head, names: tuple[str, ...], first_row: int, signals: tuple[ValueColumn, ...], options: IngestOptions
) -> LongPlan | None:
    loops = [index for index, name in enumerate(names) if _names_loops(head, name, head.column(index, first_row))]
    loops.sort(key=lambda index: plain(names[index]) not in _LOOP_NAMES)
    if not loops:
        return None
    time = time_columns_in(head, names, first_row, options) or stamps_in(head, names, first_row, options)
    if not time:
        return None
    time = date_and_clock(head, time, first_row, options)
    form = form_of(head, time, first_row, options, names[time[0]])
    if form is None:
        return None
    known = [plain(name) for name in names]
    quality = next((known.index(name) for name in QUALITY_NAMES if name in known), None)
    used = {loops[0], quality, *time, *(signal.index for signal in signals)}
    left = ", ".join(name[:80] for index, name in enumerate(names) if name and index not in used)
    notes = (f"columns beside the signals of the loops were not read: {left[:300]}",) if left else ()
    width = named_width(head, names, first_row)
    return LongPlan(
        "loop_rows", first_row, width, time, form, loops[0], signals[0].index, quality, notes=notes, signals=signals
    )


def _signals(names: tuple[str, ...]) -> tuple[ValueColumn, ...]:
    """The first column of each signal that is named without a loop. A name that reads otherwise behind a loop's is
    that of its signal."""
    found: dict[str, ValueColumn] = {}
    for index, name in enumerate(names):
        at = place(name, "") if name else None
        if at is not None and at.loop == "" and at.signal != "OTHER":
            joined = place(f"A1.{name}", "")
            word = name if (joined.loop, joined.signal) == ("A1", at.signal) else at.signal
            found.setdefault(at.signal, ValueColumn(index, word))
    return tuple(found.values())


def _names_loops(head: Head, name: str, fields: list[str]) -> bool:
    """Whether a column has names of loops: numbers are some where it is called so alone, and they repeat."""
    known = plain(name)
    if known not in LOOPS_OR_TAGS or not fields:
        return False
    if not all(is_number(text, head.decimal_mark) for text in fields):
        return True
    return known in _LOOP_NAMES and 2 * len(set(fields)) <= len(fields)
