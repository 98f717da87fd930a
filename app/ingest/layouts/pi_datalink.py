"""PI DataLink: groups of columns (time, value), often with a status or a blank column behind them; the times differ
from group to group."""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise, takewhile

from app.ingest.columns.clocks import SHOWN
from app.ingest.columns.headings import is_data
from app.ingest.columns.names import QUALITY_NAMES
from app.ingest.columns.plain_names import plain
from app.ingest.columns.plans import TimedColumns, ValueColumn, WidePlan
from app.ingest.columns.time_columns import NO_ROWS, first_row_of_times
from app.ingest.columns.time_names import TIME_NAMES
from app.ingest.columns.widths import usual_width
from app.ingest.files.head import Head, is_number
from app.ingest.model import IngestOptions
from app.ingest.numbers.units import is_unit
from app.ingest.tags.grouping import AUDITED, like_a_tag, place, without_unit
from app.ingest.tags.quality import tells_quality
from app.ingest.times.stamps import TimeForm, find_form, with_told_zone

_GENERIC = frozenset(("", "value", *TIME_NAMES, *QUALITY_NAMES))
_TAG_AND_WORD = re.compile(r"(?P<tag>.+)[ ._/](?P<word>[^ ._/]+)")
_PLAIN = re.compile(r"[+-]?\d+([.]\d*)?")
_NUMBER_BEHIND = re.compile(r"[ _]?\d+$")
_MOST_STRAY = 0.02  # of the rows, that have a cell in a column that is none
_LEAST_SERIAL = 20_000.0  # a smaller number is no date

Rows = tuple[tuple[str, ...], ...]


def sniff(head: Head, options: IngestOptions) -> WidePlan | None:
    first_row = first_row_of_times(_without_lone_dates(head), 0, options)
    if first_row == NO_ROWS:
        return None
    widths = Counter(len(row) for row in head.rows[first_row:])
    widest = max(widths)
    of_widest = _plan(head, first_row, widest, options)
    width = usual_width(head, first_row)
    if width == widest:
        return of_widest
    usual = _plan(head, first_row, width, options)
    if of_widest is None or usual is None:
        return of_widest or usual
    named = any(any(row[width:]) for row in head.rows[: of_widest.first_row])
    more = widths[widest] > 1 and len(of_widest.groups) > len(usual.groups)
    return of_widest if named or more else usual  # else a row has fields too many


def _without_lone_dates(head: Head) -> Head:
    """A title may be of a date alone: a first row of data has something beside it."""
    return replace(head, rows=tuple(row if any(row[1:]) else () for row in head.rows))


def _plan(head: Head, first_row: int, width: int, options: IngestOptions) -> WidePlan | None:
    """Of rows of so many columns. A row may end behind any group: spreadsheets leave out what is empty behind it."""
    forms = {column: form for column in range(width) if (form := _dated(head.column(column, first_row), options))}
    if len(forms) < 2 or 0 not in forms:
        return None
    start = _first_data(head, first_row, [column for column in range(width) if column not in forms])
    titles = head.rows[:start]
    columns = {
        time: _values(head, range(time + 1, end), start, first_row)
        for time, end in zip(forms, [*list(forms)[1:], width], strict=True)
    }
    if not all(_may_be_group(titles, time, values) for time, values in columns.items()):
        return None
    tags = _tags(titles, [(time, value) for time, own in columns.items() for value in own])
    groups: list[TimedColumns] = []
    for column, values in columns.items():
        named = tuple(
            ValueColumn(value, tags[value] or f"{head.stem}.{len(groups) + 1}", quality=judging)
            for value, judging in values.items()
        )
        names = (row[column] for row in titles if column < len(row))
        groups.append(TimedColumns((column,), with_told_zone(forms[column], " ".join(names)), named))
    heading = _heading(titles, groups)
    ends = {end for one, other in pairwise(groups) for end in range(_last(one) + 1, other.time[0] + 1)}
    ends.update(range(_last(groups[-1]) + 1, width))
    return WidePlan("pi_datalink", start, width, tuple(groups), heading=heading, ends=frozenset(ends))


def _may_be_group(titles: Rows, time: int, values: Mapping[int, int | None]) -> bool:
    return bool(values) and (len(values) == 1 or _named_as_time(titles, time))


def _last(group: TimedColumns) -> int:
    """Its last column that is read."""
    return max(column for value in group.values for column in (value.index, value.quality or 0))


def _first_data(head: Head, first_row: int, values: list[int]) -> int:
    """The row from which on all are rows of data down to the first one with a time."""
    above = list(takewhile(lambda at: not any(head.row(at)) or is_data(head, at, values), range(first_row)[::-1]))
    return min((at for at in above if any(head.row(at))), default=first_row)


def _heading(titles: Rows, groups: list[TimedColumns]) -> tuple[int, ...]:
    """The rows below those that name anything; where none does, it is not known which are a title."""
    tags = {value.tag for group in groups for value in group.values}
    named = [at for at, row in enumerate(titles) if any(cell in tags or plain(cell) in _GENERIC - {""} for cell in row)]
    return tuple(
        at for at in range(max(named, default=len(titles)), len(titles)) if at not in named and any(titles[at])
    )


def _dated(fields: list[str], options: IngestOptions) -> TimeForm | None:
    if 2 * sum(_is_too_small(field) for field in fields[:SHOWN]) > len(fields[:SHOWN]):
        return None
    form = find_form(fields, "date", options)
    if form is None or form.kind == "relative" or (form.is_date and _PLAIN.fullmatch(fields[0])):
        return None  # 20240301 may count anything: no name says here that it is a date
    return form


def _is_too_small(field: str) -> bool:
    return bool(_PLAIN.fullmatch(field)) and abs(float(field)) < _LEAST_SERIAL


def _values(head: Head, columns: range, start: int, first_row: int) -> dict[int, int | None]:
    """The columns of values of a group, each with the one of qualities right of it; the first of a group may be empty,
    others are not read then, nor where nothing names a few cells, as of a note."""
    values: dict[int, int | None] = {}
    rows = sum(map(any, head.rows[first_row:]))
    for column in columns:
        fields = head.column(column, first_row)
        if values and _are_qualities(head.rows[:start], column, fields):
            values[list(values)[-1]] = column
        elif not values or len(fields) > _MOST_STRAY * rows or (fields and _is_named(head.rows[:start], column)):
            values[column] = None
    return values


def _are_qualities(titles: Rows, column: int, fields: list[str]) -> bool:
    named = any(plain(row[column]) in QUALITY_NAMES for row in titles if column < len(row))
    words = not any(is_number(field) for field in fields)
    return bool(fields) and (named or words) and tells_quality(fields)


def _is_named(titles: Rows, column: int) -> bool:
    return any(row[column] for row in titles if column < len(row))


def _named_as_time(titles: Rows, column: int) -> bool:
    return any(plain(row[column]) in TIME_NAMES for row in titles if column < len(row))


def _tags(titles: Rows, columns: list[tuple[int, int]]) -> dict[int, str]:
    """By column of values the name above it, or above its time; empty where none is. columns: of times and values.

    Titles and descriptions may stand above the row of tags, which is the one that reads most as such; the others tell
    what it leaves open."""
    rows = [
        {value: _name_in(_without_repeats(row, columns), time, value) for time, value in columns}
        | _of_loops(row, columns)
        for row in titles
    ]
    rows.sort(key=_reads_as_tags, reverse=True)
    return {value: next((row[value] for row in rows if row[value]), "") for _, value in columns}


def _of_loops(row: tuple[str, ...], columns: list[tuple[int, int]]) -> dict[int, str]:
    """FIC1.PV and FIC1.OP of FIC1, PV, FIC1, OP: the loop above the times of its values, the signals above these."""
    named = [(row[time], row[value], value) for time, value in columns if value == time + 1 and value < len(row)]
    signals = {(loop, place(word, "").signal) for loop, word, _ in named if place(word, "").loop == ""}
    return {
        value: f"{loop}.{word}"
        for loop, word, value in named
        if like_a_tag(loop) and all((loop, signal) in signals for signal in AUDITED) and place(word, "").loop == ""
    }


def _without_repeats(row: tuple[str, ...], columns: list[tuple[int, int]]) -> tuple[str, ...]:
    """A row without what stands above each of several times, as X axis: names above their values tell these apart."""
    times = {time for time, _ in columns}
    above = {row[time] for time in times if time < len(row)}
    values = {row[value] for _, value in columns if value < len(row)}
    if len(times) < 2 or len(above) > 1 or len(values - above - {""}) < len(columns):
        return row
    return tuple("" if column in times else name for column, name in enumerate(row))


def _name_in(row: tuple[str, ...], time: int, value: int) -> str:
    columns = (time, value) if value == time + 1 else (value,)
    names = [row[column] for column in columns if column < len(row)]
    if len(names) > 1 and (tag := _before_time(*names)):
        return tag
    if len(names) > 1 and plain(_NUMBER_BEHIND.sub("", names[0])) in TIME_NAMES and _tells_signal(names[1]):
        return names[1]
    return next((name for name in names if plain(name) not in _GENERIC), "")


def _before_time(of_time: str, of_value: str) -> str:
    """The tag in FIC101.PV Time beside FIC101.PV ValueY; empty where the two names share none. The name of the value is
    the tag where it alone tells a signal, as beside FIC101 Time, or the unit."""
    found = _TAG_AND_WORD.fullmatch(of_time)
    if found is None or plain(found["word"]) not in TIME_NAMES or not of_value.startswith(found["tag"]):
        return ""
    tag = found["tag"]
    if without_unit(of_value) == tag or (_tells_signal(of_value) and not _tells_signal(tag)):
        return of_value
    return "" if of_value[len(tag) :][:1].isalnum() else tag


def _tells_signal(name: str) -> bool:
    return place(name, "").signal != "OTHER"


def _reads_as_tags(row: Mapping[int, str]) -> tuple[int, int, int]:
    """How many names of a row are like tags or tell a loop's signal, these once more, and how many names there are."""
    names = [name for name in row.values() if name and not is_unit(name)]
    signals = sum(found.signal != "OTHER" and found.loop != "" for found in (place(name, "") for name in names))
    return sum(map(like_a_tag, names)) + signals, signals, len(names)
