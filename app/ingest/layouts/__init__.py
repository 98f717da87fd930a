"""The layouts that ingest knows, each in its own file, asked in this order.

A new layout is a new file with a function `sniff(head, options) -> Plan | None` and a line here.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

from app.errors import DataError
from app.ingest.columns.dates_alone import refuse_dates_alone
from app.ingest.columns.fractions import with_fraction
from app.ingest.columns.further_down import tells_more
from app.ingest.columns.further_groups import refuse_further_groups
from app.ingest.columns.headings import heading_notes, units_in
from app.ingest.columns.joined_stamps import stamps_of_rows
from app.ingest.columns.names import TAG_NAMES, VALUE_NAMES
from app.ingest.columns.of_words import WordsPartRows, are_sorted_by
from app.ingest.columns.plain_names import plain
from app.ingest.columns.plans import LongPlan, Plan, WidePlan
from app.ingest.columns.quality import notes_of_short_names
from app.ingest.columns.quality_of_rows import columns_without_name, with_columns_left, with_flags
from app.ingest.columns.row_ends import with_ends
from app.ingest.columns.state_column import with_state_column
from app.ingest.columns.time_names import time_columns
from app.ingest.columns.unit_column import with_unit_column
from app.ingest.columns.zones_beside import notes_of_zones
from app.ingest.files.head import PREAMBLE_ROWS, Head, is_number
from app.ingest.layouts import (
    aveva,
    dcs_tab,
    ignition,
    labview,
    long,
    long_bare,
    long_by_content,
    loop_rows,
    loop_words,
    own_times,
    per_tag,
    pi_datalink,
    trendminer,
    two_rows,
    wide,
)
from app.ingest.model import IngestOptions
from app.ingest.telling import first_of

_CLOCK = re.compile(r"\d{1,2}:\d\d(:\d\d([.,]\d+)?)?( ?[AaPp][Mm])?")
_FEWEST_WORDS = 3  # a time and two signals
Every = Callable[[Sequence[int]], Sequence[tuple[str, ...]]]
Sniff = Callable[[Head, IngestOptions], Plan | None]

LAYOUTS: tuple[Sniff, ...] = (
    dcs_tab.sniff,
    ignition.sniff,
    labview.sniff,
    own_times.sniff,
    two_rows.sniff,
    trendminer.sniff,
    aveva.sniff,
    loop_rows.sniff,
    loop_words.sniff,
    long.sniff,
    long_by_content.sniff,
    pi_datalink.sniff,
    long_bare.sniff,
    per_tag.sniff,
    wide.sniff,
)


def recognise(head: Head, options: IngestOptions) -> Plan | None:
    """None where no layout is known. Raises DataError where the rows are such that they would be mixed, or have no
    times."""
    plan = next((plan for sniff in LAYOUTS if (plan := sniff(head, options)) is not None), None)
    if plan is None:
        return None
    refuse_dates_alone(plan, head)
    plan = with_fraction(with_ends(plan, head), head, options)
    if isinstance(plan, LongPlan):
        plan = with_flags(with_unit_column(with_state_column(plan, head), head), head)
        refuse_further_groups(plan, head)
        plan = with_columns_left(plan, head)
    further = (*notes_of_zones(plan, head, options), *_notes_of_further_times(plan), *_notes_of_nameless(plan, head))
    further = (*further, *notes_of_short_names(plan, head))
    notes = (*further, *plan.notes, *heading_notes(head, plan.heading))
    return replace(_with_units(plan, head), notes=notes)


def _notes_of_further_times(plan: Plan) -> tuple[str, ...]:
    further = plan.further_times if isinstance(plan, WidePlan) else ()
    shown = ", ".join(column.tag[:80] for column in further[:5])
    return (f"columns of further times were not read, neither as times nor as values: {shown}",) if further else ()


def _notes_of_nameless(plan: Plan, head: Head) -> tuple[str, ...]:
    """The columns of a wide table that hold something under an empty name."""
    if not isinstance(plan, WidePlan) or all(plan.names):
        return ()
    read = plan.read  # worked out from all columns
    unread = {index: name for index, name in enumerate(plan.names) if index not in read}
    shown = first_of(list(columns_without_name(head, unread, plan.first_row).values()), 5)
    return (f"columns without a name were not read: {shown}",) if shown else ()


def recognise_again(plan: Plan, head: Head, options: IngestOptions, every: Every) -> Plan:
    """The plan by a head with rows from further down, where they tell more than the first rows did. They make none of
    tags and loops unknown: a word that no signal has may stand beside those that are known. every: gives the fields
    of some columns, row by row, of the whole table, or nothing where these are too many.

    Raises DataError where the rows of a wide table are such that they would be mixed.
    """
    try:
        found = recognise(head, options)
    except DataError as error:
        if isinstance(plan, LongPlan) or (
            isinstance(error, WordsPartRows) and _part_none(plan, error.column, options, every)
        ):
            return plan
        raise
    return found if found is not None and tells_more(found, plan) else plan


def _part_none(plan: WidePlan, column: int, options: IngestOptions, every: Every) -> bool:
    """Whether the words of a column, which some rows show to part them, do not by all rows."""
    rows = every((column, *plan.groups[0].time))
    stamps = stamps_of_rows(rows, range(1, 1 + len(plan.groups[0].time)))
    return bool(rows) and not are_sorted_by([word for word, *_ in rows], stamps, plan, options)


def _with_units(plan: Plan, head: Head) -> Plan:
    """With the units of its columns where a row of the heading tells them."""
    units = units_in(head, plan.heading)
    if not units or not isinstance(plan, WidePlan):
        return plan
    groups = (
        replace(group, values=tuple(replace(value, unit=units.get(value.index, "")) for value in group.values))
        for group in plan.groups
    )
    return replace(plan, groups=tuple(groups))


class NotRecognised(DataError):
    """No layout is known. named: names are there, but no rows, or none with times."""

    def __init__(self, message: str, named: bool) -> None:
        super().__init__("unknown_layout", message)
        self.named = named

    def __reduce__(self) -> tuple[type, tuple[str, bool]]:  # type: ignore[override]  # what makes it anew is other
        return type(self), (self.message, self.named)


def not_recognised(head: Head) -> NotRecognised:
    at = next((index for index, row in enumerate(head.rows[:PREAMBLE_ROWS]) if _are_names(row)), None)
    if at is None and _parted_by_blanks(head):
        return NotRecognised(
            "the fields of a row are parted by blanks alone, which is not read; needed are commas, semicolons or tabs "
            "between them",
            named=False,
        )
    if at is None:
        return NotRecognised(
            "no column of times with signals beside it was found; needed is a row of names with time, PV and OP "
            "(or tags such as FIC101.PV), or rows of tag, time and value",
            named=False,
        )
    names = head.rows[at]
    time = time_columns(names)[0]
    below = head.column(time, at + 1)
    shown = f"the first of them is {below[0][:60]!r}" if below else "there is none"
    listed = ", ".join(names[:5])[:200]
    without = next((row for row, cells in enumerate(head.rows[at + 1 :]) if any(cells[time : time + 1])), 0)
    if without >= PREAMBLE_ROWS:
        return NotRecognised(
            f"the first {without} rows below the names {listed} have no time; needed are rows that have one: leave out "
            f"those above the first one that has, {below[0][:60]!r}",
            named=True,
        )
    if below and all(map(_CLOCK.fullmatch, below)):
        shown += ", a clock without a date; needed is the date beside it, in a column of its own too"
    return NotRecognised(f"below the names {listed} no row has a time that can be read; {shown}", named=True)


def _parted_by_blanks(head: Head) -> bool:
    """Whether most lines are one field, of several words that end with numbers."""
    lines = [row[0].split() for row in head.rows if any(row) and not any(row[1:])]
    numbers = sum(len(words) >= _FEWEST_WORDS and all(map(is_number, words[-2:])) for words in lines)
    return 2 * numbers > sum(any(row) for row in head.rows)


def _are_names(row: tuple[str, ...]) -> bool:
    known = {plain(name) for name in row}
    long_names = bool(known & TAG_NAMES) and not known.isdisjoint(VALUE_NAMES)
    return bool(time_columns(row)) and (long_names or wide.audited_signals(row) > 0)
