"""A row a loop and an instant, as a database's table of loops is queried: Loop,Time,PV,OP,SP. Its signals have the
name of the row's loop before their own."""

from app.ingest.columns.names import mostly_numbers, names_no_measurement, of_series, quality_named
from app.ingest.columns.of_loops import Rows, columns_of_loops
from app.ingest.columns.plain_names import plain, words_in
from app.ingest.columns.plans import LongPlan, ValueColumn
from app.ingest.columns.time_columns import times_of_rows
from app.ingest.columns.widths import named_width
from app.ingest.files.head import PREAMBLE_ROWS, Head
from app.ingest.model import IngestOptions
from app.ingest.tags.grouping import AUDITED, place


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
    loops = columns_of_loops(head, names, first_row, range(len(names)), in_words=False)
    found = times_of_rows(head, names, first_row, options) if loops else None
    loops = Rows(head, names, first_row, found, options).loops(loops) if found else []
    if not loops or found is None:
        return None
    time, form = found
    quality = quality_named([plain(name) for name in names])
    used = {*loops, quality, *time, *(signal.index for signal in signals)}
    others = _others(head, names, first_row, used, {plain(signal.tag) for signal in signals})
    used.update(other.index for other in others)
    left = ", ".join(name[:80] for index, name in enumerate(names) if name and index not in used - {*loops[1:]})
    notes = (f"columns beside the signals of the loops were not read: {left[:300]}",) if left else ()
    width = named_width(head, names, first_row)
    return LongPlan(
        "loop_rows",
        first_row,
        width,
        time,
        form,
        loops[0],
        signals[0].index,
        quality,
        notes=notes,
        signals=signals,
        others=others,
    )


def _signals(names: tuple[str, ...]) -> tuple[ValueColumn, ...]:
    """The first column of each signal that is named without a loop. A name that reads otherwise behind a loop's is
    that of its signal."""
    found: dict[str, ValueColumn] = {}
    for index, name in words_in(names).items():
        at = place(name, "")
        if at.loop == "" and at.signal != "OTHER":
            joined = place(f"A1.{name}", "")
            word = name if (joined.loop, joined.signal) == ("A1", at.signal) else at.signal
            found.setdefault(at.signal, ValueColumn(index, word))
    return tuple(found.values())


def _others(
    head: Head, names: tuple[str, ...], first_row: int, used: set[int | None], taken: set[str]
) -> tuple[ValueColumn, ...]:
    """The further columns of numbers, each under a name of its own."""
    found: dict[str, ValueColumn] = {}
    series = of_series(head, names, first_row)
    for index, name in enumerate(names):
        if (
            index in used
            or index in series
            or names_no_measurement(name)
            or plain(name) in taken
            or plain(name) in found
        ):
            continue
        if mostly_numbers(head.column(index, first_row), head.decimal_mark):
            found[plain(name)] = ValueColumn(index, name)
    return tuple(found.values())
