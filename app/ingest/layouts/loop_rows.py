"""A row a loop and an instant, as a data base's table of loops is queried: Loop,Time,PV,OP,SP. Its signals have the
name of the row's loop before their own."""

import numpy as np
import polars as pl

from app.ingest.columns.clocks import MOST
from app.ingest.columns.names import TAG_NAMES, plain, quality_named, times_of_rows
from app.ingest.columns.plans import LongPlan, ValueColumn
from app.ingest.columns.widths import named_width
from app.ingest.files.head import PREAMBLE_ROWS, Head, is_number
from app.ingest.model import IngestOptions
from app.ingest.tags.grouping import AUDITED, place
from app.ingest.tags.modes import UNKNOWN_MODE, automatic_flags
from app.ingest.tags.quality import holds_quality_words

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
    filled = MOST * sum(any(row) for row in head.rows[first_row:])
    columns = ((index, name, head.column(index, first_row)) for index, name in enumerate(names))
    loops = [index for index, name, fields in columns if len(fields) >= filled and _names_loops(head, name, fields)]
    loops.sort(key=lambda index: plain(names[index]) not in _LOOP_NAMES)
    if not loops:
        return None
    found = times_of_rows(head, names, first_row, options)
    if found is None:
        return None
    time, form = found
    quality = quality_named([plain(name) for name in names])
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
    """Whether a column has names of loops: numbers are some where it is called so alone, and they repeat. Under another
    name most words have a digit, and none is a mode or a quality: it may be of operators, products or remarks."""
    known = plain(name)
    if known not in LOOPS_OR_TAGS or not fields:
        return False
    if not all(is_number(text, head.decimal_mark) for text in fields):
        return known in _LOOP_NAMES or _may_be_loops(set(fields))
    return known in _LOOP_NAMES and 2 * len(set(fields)) <= len(fields)


def _may_be_loops(words: set[str]) -> bool:
    flags = automatic_flags(pl.Series(sorted(words), dtype=pl.String))
    if np.any(np.isfinite(flags) & (flags != UNKNOWN_MODE)) or any(holds_quality_words([word]) for word in words):
        return False
    return 2 * sum(any(map(str.isdigit, word)) for word in words) > len(words)
