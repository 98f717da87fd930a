"""Plans of wide and long tables from their row of names."""

from collections.abc import Mapping
from dataclasses import replace

from app.ingest.columns.clocks import MOST, date_and_clock
from app.ingest.columns.headings import below_names
from app.ingest.columns.joined_stamps import stamps_of_rows
from app.ingest.columns.names import (
    QUALITY_NAMES,
    TAG_NAMES,
    VALUE_NAMES,
    may_hold_values,
    mostly_numbers,
    mostly_signals,
    name_at,
    of_series,
    quality_of,
)
from app.ingest.columns.of_words import are_sorted_by
from app.ingest.columns.plain_names import first_of_each, plain, words_in
from app.ingest.columns.plans import LongPlan, TimedColumns, ValueColumn, WidePlan
from app.ingest.columns.quality import with_quality
from app.ingest.columns.time_columns import form_of, holds_times, stamps_in, times_of_rows
from app.ingest.columns.time_names import is_full_time, time_columns
from app.ingest.columns.widths import named_width
from app.ingest.files.head import Head
from app.ingest.model import IngestOptions
from app.ingest.tags.grouping import place
from app.ingest.tags.quality import holds_quality_words

_OF_WINCC = "processvalue"
_LAST_NAMES = frozenset(("tagindex", "fullname", "valueid"))  # where a tag has another one, too


def wide_from(
    head: Head,
    layout: str,
    names: tuple[str, ...],
    names_at: tuple[int, ...],
    first_row: int,
    options: IngestOptions,
    time: tuple[int, ...] = (),
) -> WidePlan | None:
    """A wide plan from the names, the rows in which they stand, and the first row with a time."""
    time = time or time_columns(names) or stamps_in(head, names, first_row, options, of_rows=True) or (0,)
    time = date_and_clock(head, time, names, first_row, options)
    form = form_of(head, time, first_row, options, name_at(names, time[0]))
    if form is None:
        return None
    passed = of_series(head, names, first_row).union(time)
    named = [
        index for index in range(len(names)) if index not in passed and may_hold_values(head, names, index, first_row)
    ]
    stamps = [
        index
        for index in named
        if (is_full_time(names[index]) or holds_times(head, index, first_row, options))
        and place(names[index], "").signal == "OTHER"
    ]
    values = tuple(ValueColumn(index, names[index]) for index in named if index not in stamps)
    further = tuple(ValueColumn(index, names[index]) for index in stamps)
    if not values:
        return None
    below = below_names(head, names_at, first_row, [value.index for value in values])
    width = named_width(head, names, below.first_row, time)
    judged = with_quality(head, names, first_row, values, lambda name: plain(name) in QUALITY_NAMES)
    groups = (TimedColumns(time, form, _called_after_file(head, judged, below.first_row)),)
    written = head.row(names_at[0]) if len(names_at) == 1 else ()
    return WidePlan(layout, below.first_row, width, groups, heading=below.heading, names=written, further_times=further)


def _called_after_file(head: Head, values: tuple[ValueColumn, ...], first_row: int) -> tuple[ValueColumn, ...]:
    """Of a file a tag, whose values are called just so, the tag is the file's name."""
    called = [value for value in values if plain(value.tag) in VALUE_NAMES]
    others = [value for value in values if value not in called]
    if len(called) != 1 or any(
        mostly_numbers(head.column(value.index, first_row), head.decimal_mark) for value in others
    ):
        return values
    return tuple(replace(value, tag=head.stem) if value in called else value for value in values)


def long_from(
    head: Head, layout: str, names: tuple[str, ...], first_row: int, options: IngestOptions
) -> LongPlan | None:
    """A long plan from the row of names; None where tag, time or value are not among them."""
    words = words_in(names)
    tags = [index for index, name in words.items() if plain(name) in TAG_NAMES]
    if not tags:
        return None
    first = first_of_each(words)
    values = [first[name] for name in VALUE_NAMES if name in first] or _of_wincc(words)
    if not values:
        return None
    known = [plain(name) for name in names]
    tags = _tags_first(head, known, first_row, tags)
    found = times_of_rows(head, names, first_row, options)
    if found is None:
        return None
    time, form = found
    quality = quality_of(head, known, first_row, {*time, tags[0], values[0]}, holds_quality_words)
    zero = None if quality is None else _zero_is_good(known[quality], known)
    width = named_width(head, names, first_row)
    plan = LongPlan(layout, first_row, width, time, form, tags[0], values[0], quality, zero)
    return None if known[values[0]] == _OF_WINCC and not _has_tags(plan, head, options) else plan


def _tags_first(head: Head, known: list[str], first_row: int, tags: list[int]) -> list[int]:
    """The columns of names, the one of the tags first: a full name where it tells more of them apart than the others
    do, names of signals before other words, and what may be of something else last."""
    others = [len(set(head.column(at, first_row))) for at in tags if known[at] not in _LAST_NAMES]

    def place_of(at: int) -> tuple[bool, bool, bool, bool]:
        fields = head.column(at, first_row)
        fuller = known[at] == "fullname" and mostly_signals(fields) and len(set(fields)) > max(others, default=0)
        return (
            not fuller,
            known[at] in _LAST_NAMES and bool(others),
            not mostly_signals(fields),
            known[at] == "tagindex",
        )

    return sorted(tags, key=place_of)


def _of_wincc(words: Mapping[int, str]) -> list[int]:
    """The column of values that is called as a PV is: it is one where no further signal stands beside it."""
    signals = [index for index, name in words.items() if place(name, "").signal != "OTHER"]
    return signals if [plain(words[index]) for index in signals] == [_OF_WINCC] else []


def _has_tags(plan: LongPlan, head: Head, options: IngestOptions) -> bool:
    """Whether words beside a process value are names of signals, or several stand at a time or have rows one after the
    other: they may be of batches."""
    rows = [row for row in head.rows[plan.first_row :] if any(row)]
    stamps = stamps_of_rows(rows, plan.time)
    words = [name_at(row, plan.tag) for row in rows]
    at_a_time = len(set(stamps)) < MOST * len(set(zip(stamps, words, strict=True)))
    return at_a_time or mostly_signals(words) or are_sorted_by(words, stamps, plan, options, head.sampled)


def _zero_is_good(quality: str, names: list[str]) -> bool | None:
    if quality in ("opcquality", "dataintegrity", "confidence", "isgood", "isvalid"):
        return False
    return True if quality == "quality" and ("qualitydetail" in names or "vvalue" in names) else None
