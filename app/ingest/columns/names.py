"""Knowing columns by their names and by what stands in them; shared by the layouts."""

import re
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence, Sized
from dataclasses import replace

import numpy as np

from app.ingest.columns.clocks import MOST, SHOWN, are_clocks, are_midnights, date_and_clock, stamp_of
from app.ingest.columns.headings import below_names, is_data
from app.ingest.columns.of_words import are_sorted_by
from app.ingest.columns.plain_names import plain
from app.ingest.columns.plans import LongPlan, TimedColumns, ValueColumn, WidePlan
from app.ingest.columns.quality import with_quality
from app.ingest.columns.stamp_parts import parts_of_stamps
from app.ingest.columns.widths import named_width
from app.ingest.files.head import PREAMBLE_ROWS, Head, is_number
from app.ingest.model import FloatArray, IngestOptions
from app.ingest.numbers.units import as_number
from app.ingest.tags.grouping import SIMULATED, place, without_unit
from app.ingest.tags.quality import holds_quality_words, tell_good_from_bad
from app.ingest.times.counted_times import OURS_FROM_S, OURS_TO_S
from app.ingest.times.stamps import TimeForm, find_form
from app.ingest.times.told_units import told_unit
from app.ingest.times.told_zones import told_utc_offset_ns, without_zone
from app.nanoseconds import NS_PER_S

TIME_NAMES = frozenset(
    (
        *("time", "datetime", "date", "timestamp", "dateandtime", "tstamp", "ts", "zeit"),
        *("datum", "zeitstempel", "t", "localtime", "timeutc", "utc", "utctime", "sampletime"),
        *("datatime", "times", "datetimes", "seconds", "timesec", "timeseconds", "sourcetime", "sourcetimestamp"),
        *("servertime", "servertimestamp", "eventtime", "timestring", "iptrendtime", "horodatage"),
    )
)
SHORT_TIME_NAMES = frozenset(("t", "ts"))
"""Names of times where no other is: a temperature and a sampling interval are called so too."""
TAG_NAMES = frozenset(
    (
        *("tag", "tagname", "name", "point", "pointname", "tagpath", "path", "item", "itemid", "signal"),
        *("wwtagname", "tagid", "tagindex", "pointid", "variable", "series", "datasource", "messstelle"),
        *("varname", "nodeid", "etiqueta"),
    )
)
VALUE_NAMES = (
    "value",
    "val",
    "vvalue",
    "wert",
    "pointvalue",
    "floatvalue",
    "numvalue",
    "reading",
    "varvalue",
    "iptrendvalue",
    "valuedouble",
    "valeur",
    "valor",
    "messwert",
    "mesure",
    "medida",
    "测量值",
    "realvalue",
)
QUALITY_NAMES = (
    "opcquality",
    "dataquality",
    "quality",
    "status",
    "qualitydetail",
    "dataintegrity",
    "good",
    "valuestatus",
    "qualitycode",
    "confidence",
    "statuscode",
    "qstatus",
    "iptrendqstatus",
    "validity",
    "isgood",
    "isvalid",
    "qualitaet",
    "qualite",
    "calidad",
)
SKIPPED_NAMES = frozenset(("id", "index", "row", "rowid", "ndx", "unnamed0", ""))
_ROW_NAMES = frozenset(("#", "no", "nr", "n°", "nº", "№", "lfd.nr", "id", "row", "rowid", "ndx"))
"""Names of the number of a row, in small letters and without blanks: no times, however they rise."""
_OF_A_LOGGER = re.compile(r"(?i)[^\s_]_ndx\s*$|_numericid\s*$")
"""Behind the names of tables in Ignition, the number of the row; behind those of tags in KEPServerEX, one of theirs."""
_OF_SERIES = ("result", "table", "_measurement", "_field")
_OF_WINCC = "processvalue"
_ROWS_OR_VALUES = frozenset(("no", "nr"))
NO_ROWS = -1
_DATE_AND_CLOCK = 2  # columns
_MAY_BE_STAMP = re.compile(r"\d\D+\d+\D+\d|\d{8}|年|^\d{5}([.,]|$)")
ONE_WAY = 0.98  # of the steps of times that no name tells, at least


def time_columns(names: tuple[str, ...]) -> tuple[int, ...]:
    """The column named as a time; date and time apart are two. Those of UTC go before those of another clock."""
    known = {index: plain(name) for index, name in enumerate(names)}
    told = {index: offset for index, name in enumerate(names) if (offset := told_utc_offset_ns(name)) is not None}
    if told:
        bare = {index: plain(without_zone(names[index])) or known[index] for index in told}
        in_utc = {index: name for index, name in bare.items() if told[index] == 0}
        if named := _named_as_times(in_utc) or _named_as_times(bare):
            return named
    with_unit = {index for index, name in enumerate(names) if not _is_time(known[index]) and _is_time_with_unit(name)}
    return _named_as_times(known, with_unit)


def _named_as_times(names: Mapping[int, str], with_unit: Collection[int] = ()) -> tuple[int, ...]:
    """By their plain names, or with a unit behind a name where no other is one in full: date and clock have none."""
    of = {name: index for index, name in reversed(list(names.items()))}
    if "date" in of and "time" in of:
        return of["date"], of["time"]
    times = sorted(
        (name in SHORT_TIME_NAMES, index in with_unit, index)
        for index, name in names.items()
        if _is_time(name) or index in with_unit
    )
    return (times[0][2],) if times else ()


def _is_time_with_unit(name: str) -> bool:
    return unit_of_times(name) is not None


def unit_of_times(name: str) -> float | None:
    """In s, as `time_ms` has one; but T_h is a temperature."""
    told = told_unit(name)
    return told.seconds if told is not None and plain(told.bare) in TIME_NAMES - SHORT_TIME_NAMES else None


def _is_time(name: str) -> bool:
    return name in TIME_NAMES or name.startswith("timestamp")


def time_columns_in(head: Head, names: tuple[str, ...], first_row: int, options: IngestOptions) -> tuple[int, ...]:
    """The columns of times by their names and by what they hold from a row on: of several with such names, one of dates
    and clocks that is filled and moves goes before one of counts, and those of all parts of a stamp before one of
    them, such as Seconds."""
    named = time_columns(names)
    parts = parts_of_stamps(head, names, first_row) if named else ()
    if set(named) < set(parts):
        return parts
    others = [(index,) for index, name in enumerate(names) if _is_full_time(name) and (index,) != named]
    if not others or _are_instants(form_of(head, named, first_row, options)):
        return named
    moving = (time for time in others if _moves(head, time[0], first_row))
    return next((time for time in moving if _are_instants(form_of(head, time, first_row, options))), named)


def stamps_in(
    head: Head, names: tuple[str, ...], first_row: int, options: IngestOptions, of_rows: bool = False
) -> tuple[int, ...]:
    """The first column, or date and clock, that holds stamps from a row on, whatever it is called; one of dates alone
    where there is no other, or else those of their parts by name. of_rows: a row is an instant, and beside a first
    column of seconds from a start those that do not tell the rows apart are of something else, as of the export or the
    batch."""
    dates: tuple[int, ...] = ()
    without_clocks = False
    beside_seconds = of_rows and _first_are_seconds(head, names, first_row, options)
    for index in range(min(len(names), max(map(len, head.rows[first_row:]), default=0))):
        form = _form_of_stamps(head, index, names[index], first_row, options)
        if form is None:
            continue
        are_dates = form.is_date or are_midnights(head.column(index, first_row))
        single = are_dates and without_clocks  # clocks are looked for in all columns, and there is none
        time = (index,) if single else date_and_clock(head, (index,), names, first_row, options)
        without_clocks = without_clocks or (are_dates and len(time) == 1)
        if max(time) >= len(names) or (beside_seconds and not _tell_rows(head, names, time, first_row, are_dates)):
            continue
        if len(time) > 1 or not are_dates:
            return time
        dates = dates or time
    return dates or parts_of_stamps(head, names, first_row)


def _first_are_seconds(head: Head, names: tuple[str, ...], first_row: int, options: IngestOptions) -> bool:
    """Whether the first column counts from a start under a name that may be that of times."""
    form = find_form(head.column(0, first_row), "", options)
    if not names or form is None or form.kind != "relative":
        return False
    return may_be_times(names[0], numbers_of(head, 0, first_row))


def _tell_rows(head: Head, names: tuple[str, ...], time: tuple[int, ...], first_row: int, are_dates: bool) -> bool:
    """Whether stamps, or dates with clocks, stand in the rows and differ from one to the next; those of minutes need
    not beside what may be the number of a row."""
    if plain(names[0]) in SKIPPED_NAMES and not (are_dates and len(time) == 1):
        return _moves(head, time[-1], first_row)
    fields = list(zip(*(head.column(index, first_row) for index in time), strict=False))
    return _is_filled(head, fields, first_row) and 2 * len(set(fields)) > len(fields)


def numbers_of(head: Head, column: int, first_row: int) -> FloatArray:
    """(n,) those of a column's fields that are some, without their units."""
    texts = (text for text in head.column(column, first_row) if is_number(text, head.decimal_mark))
    return np.array([as_number(text) for text in texts])


def name_at(names: tuple[str, ...], index: int) -> str:
    """Empty behind the last one."""
    return names[index] if index < len(names) else ""


def _form_of_stamps(head: Head, column: int, name: str, first_row: int, options: IngestOptions) -> TimeForm | None:
    """None where a column has seconds from a start, or tells a signal. Behind the first one, numbers are stamps where
    they are seconds since 1970 of our time and rise: days since 1900 may be anything."""
    fields = head.column(column, first_row)
    if place(name, "").signal != "OTHER" or not any(map(_MAY_BE_STAMP.search, fields[:SHOWN])):
        return None
    form = find_form(fields, "", options)
    if form is None or form.kind == "relative" or (form.kind == "serial" and column):
        return None
    if form.kind != "epoch" or not column:
        return form
    numbers = numbers_of(head, column, first_row)
    seconds = (numbers * form.scale + form.origin_ns) / NS_PER_S
    ours = np.all((seconds > OURS_FROM_S) & (seconds < OURS_TO_S))
    return form if len(numbers) > 1 and ours and _rises(numbers) else None


def _moves(head: Head, column: int, first_row: int) -> bool:
    """Whether a column is filled and tells instants: not the one of the start or the export in all rows, no dates at
    midnight."""
    fields = head.column(column, first_row)
    filled = _is_filled(head, fields, first_row)
    rests = max(Counter(fields).values(), default=0) >= MOST * len(fields)
    return filled and not rests and not are_midnights(fields)


def _is_filled(head: Head, fields: Sized, first_row: int) -> bool:
    return len(fields) >= MOST * sum(any(row) for row in head.rows[first_row:])


def _is_full_time(name: str) -> bool:
    known = plain(name)
    return _is_time_with_unit(name) or (_is_time(known) and known not in SHORT_TIME_NAMES)


def _are_instants(form: TimeForm | None) -> bool:
    return form is not None and form.kind != "relative" and not form.is_date and not form.is_of_hours


def may_be_times(name: str, numbers: FloatArray) -> bool:
    """Whether the numbers (n,) of a first column that no name calls times are some: the name tells neither a signal nor
    a simulation, and they rise."""
    told = place(name, "").signal != "OTHER" or without_unit(name).strip().lower() in SIMULATED
    return not told and not _numbers_rows(name) and _rises(numbers)


def _numbers_rows(name: str) -> bool:
    return _bare_name(name) in _ROW_NAMES


def _bare_name(name: str) -> str:
    return re.sub(r"\s", "", name).rstrip(".").lower()


def _rises(numbers: FloatArray) -> bool:
    """Whether numbers (n,) in the order of the rows go one way, but for a few: those of a signal turn. One alone does
    not turn."""
    steps = np.diff(numbers[np.isfinite(numbers)])
    if len(steps) == 0:
        return True
    ways = np.mean(steps >= 0.0), np.mean(steps <= 0.0)
    return bool(max(ways) >= ONE_WAY and min(ways) < ONE_WAY)


def counts_rows(numbers: FloatArray) -> bool:
    """Whether numbers (n,) in the order of the rows are whole and grow from each to the next one."""
    return bool(len(numbers) > 1 and np.all(numbers == np.round(numbers)) and np.all(np.diff(numbers) > 0.0))


def times_assumed(name: str, form: TimeForm) -> str:
    """What is to be said where the numbers of a column are taken for times that no name tells."""
    shown = f", {name.strip()[:80]!r}," if name.strip() else ", which has no name,"
    unit = "seconds" if form.scale == NS_PER_S else f"steps of {form.scale / NS_PER_S:g} s"
    return f"no column is named as times: the numbers of the first{shown} were read as {unit}"


def form_of(
    head: Head, time: tuple[int, ...], first_row: int, options: IngestOptions, name: str = ""
) -> TimeForm | None:
    """The form of one time column, or of those of date and clock, or of their parts, joined."""
    if len(time) == 1:
        return find_form(head.column(time[0], first_row), name, options)
    rows = [row for row in head.rows[first_row:] if len(row) > max(time) and all(row[index] for index in time)]
    stamps = [stamp_of(row, time) for row in rows]
    form = find_form(stamps, name, options)
    if form is None or (len(time) == _DATE_AND_CLOCK and not form.is_of_hours):
        return form
    note = f"the times were joined from their parts in {len(time)} columns, {stamps[0]!r} the first of them"
    return replace(form, notes=(note, *form.notes))


def first_row_of_times(head: Head, column: int, options: IngestOptions, name: str = "", start: int = 0) -> int:
    """The first row from `start` on from which on the column of this name, which may tell the unit of its numbers,
    holds times; NO_ROWS where it never does."""
    for index, row in enumerate(head.rows[start:PREAMBLE_ROWS], start):
        if column < len(row) and row[column] and find_form([row[column]], name, options) is not None:
            following = head.column(column, index)
            return index if find_form(following, name, options) is not None else NO_ROWS
    return NO_ROWS


def first_row_below(head: Head, at: int, column: int, options: IngestOptions, name: str) -> int:
    """The same below the names in a row, whatever times titles above them hold; NO_ROWS where rows of data stand there,
    as wide as the names."""
    width = sum(map(bool, head.row(at)))
    for index, row in enumerate(head.rows[:at]):
        beside = [place for place in range(len(row)) if place != column]
        wide = len(beside) < len(row) and sum(map(bool, row)) >= width
        if wide and find_form([row[column]], name, options) is not None and is_data(head, index, beside):
            return NO_ROWS
    return first_row_of_times(head, column, options, name, at + 1)


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
        index for index in range(len(names)) if index not in passed and _may_hold_values(head, names, index, first_row)
    ]
    stamps = [
        index
        for index in named
        if (_is_full_time(names[index]) or _holds_times(head, index, first_row, options))
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


def _may_name_values(name: str) -> bool:
    return plain(name) not in SKIPPED_NAMES and plain(name) not in QUALITY_NAMES and not _numbers_rows(name)


def _may_hold_values(head: Head, names: tuple[str, ...], column: int, first_row: int) -> bool:
    """By its name; one that is called NO may be nitric oxide, where it does not rise as the number of a row, and one
    with fractions is no number of a row or a tag."""
    if _bare_name(names[column]) in _ROWS_OR_VALUES:
        return not _rises(numbers_of(head, column, first_row))
    return _may_name_values(names[column]) and not _counts_for_a_logger(head, names[column], column, first_row)


def _counts_for_a_logger(head: Head, name: str, column: int, first_row: int) -> bool:
    if not _OF_A_LOGGER.search(name):
        return False
    numbers = numbers_of(head, column, first_row)
    return bool(np.all(numbers == np.round(numbers)))


def of_series(head: Head, names: Sequence[str], first_row: int) -> frozenset[int]:
    """The columns in which InfluxDB tells of which result, table and measurement a row is; a result is no number."""
    found = {name.strip().lower(): index for index, name in enumerate(names)}
    result = found.get("result", len(names))
    if found.get("table", -1) != result + 1 or mostly_numbers(head.column(result, first_row), head.decimal_mark):
        return frozenset()
    return frozenset(found[name] for name in _OF_SERIES if name in found)


def names_no_measurement(name: str) -> bool:
    """Whether a column is by its name a mode, a quality or a number of the row: nothing that could move a PV."""
    return not _may_name_values(name) or _OF_A_LOGGER.search(name) is not None or place(name, "").signal == "MODE"


def _holds_times(head: Head, column: int, first_row: int, options: IngestOptions) -> bool:
    """Whether a column has stamps or clocks in letters; values are numbers, or words without any."""
    first = next((row[column] for row in head.rows[first_row:] if column < len(row) and row[column]), "")
    if not re.search(r"\d\D+\d+\D+\d", first) or is_number(first, head.decimal_mark):
        return False
    fields = head.column(column, first_row)
    form = find_form(fields, "", options)
    return are_clocks(fields) or (form is not None and form.kind == "text")


def times_of_rows(
    head: Head, names: tuple[str, ...], first_row: int, options: IngestOptions
) -> tuple[tuple[int, ...], TimeForm] | None:
    """The column of times of a table with a value, or a loop, a row, or those of dates and clocks; and their form."""
    time = time_columns_in(head, names, first_row, options) or stamps_in(head, names, first_row, options)
    if not time:
        return None
    time = date_and_clock(head, time, names, first_row, options)
    form = form_of(head, time, first_row, options, name_at(names, time[0]))
    return None if form is None else (time, form)


def long_from(
    head: Head, layout: str, names: tuple[str, ...], first_row: int, options: IngestOptions
) -> LongPlan | None:
    """A long plan from the row of names; None where tag, time or value are not among them."""
    known = [plain(name) for name in names]
    tags = [index for index, name in enumerate(known) if name in TAG_NAMES]
    values = [known.index(name) for name in VALUE_NAMES if name in known] or _of_wincc(names, known)
    if not tags or not values:
        return None
    # names of signals go before other words, and TagIndex comes last
    tags.sort(key=lambda at: (not mostly_signals(head.column(at, first_row)), known[at] == "tagindex"))
    found = times_of_rows(head, names, first_row, options)
    if found is None:
        return None
    time, form = found
    quality = quality_of(head, known, first_row, {*time, tags[0], values[0]}, holds_quality_words)
    zero = None if quality is None else _zero_is_good(known[quality], known)
    width = named_width(head, names, first_row)
    plan = LongPlan(layout, first_row, width, time, form, tags[0], values[0], quality, zero)
    return None if known[values[0]] == _OF_WINCC and not _has_tags(plan, head, options) else plan


def _of_wincc(names: tuple[str, ...], known: list[str]) -> list[int]:
    """The column of values that is called as a PV is: it is one where no further signal stands beside it."""
    signals = [index for index, name in enumerate(names) if place(name, "").signal != "OTHER"]
    return signals if [known[index] for index in signals] == [_OF_WINCC] else []


def _has_tags(plan: LongPlan, head: Head, options: IngestOptions) -> bool:
    """Whether words beside a process value are names of signals, or several stand at a time or have rows one after the
    other: they may be of batches."""
    rows = [row for row in head.rows[plan.first_row :] if any(row)]
    stamps = [stamp_of(row, plan.time) for row in rows]
    words = [name_at(row, plan.tag) for row in rows]
    at_a_time = len(set(stamps)) < MOST * len(set(zip(stamps, words, strict=True)))
    return at_a_time or mostly_signals(words) or are_sorted_by(words, stamps, plan, options, head.sampled)


def quality_of(
    head: Head,
    known: list[str],
    first_row: int,
    others: Collection[int | None],
    tell: Callable[[list[str]], bool] = tell_good_from_bad,
) -> int | None:
    """The column of qualities in a long table by its plain name, else by its words, which `tell` knows. others: those
    of something else."""
    if (named := quality_named(known)) is not None:
        return named
    left = (at for at in range(len(known)) if at not in others)
    return next((at for at in left if tell(head.column(at, first_row))), None)


def quality_named(known: list[str]) -> int | None:
    """The column of qualities by its plain name."""
    return next((known.index(name) for name in QUALITY_NAMES if name in known), None)


def _zero_is_good(quality: str, names: list[str]) -> bool | None:
    if quality in ("opcquality", "confidence", "isgood", "isvalid"):
        return False
    return True if quality == "quality" and ("qualitydetail" in names or "vvalue" in names) else None


def mostly_signals(fields: list[str]) -> bool:
    """Whether most of the words that differ tell a signal."""
    words = set(fields)
    return 2 * sum(place(word, "").signal != "OTHER" for word in words) > len(words)


def mostly_numbers(fields: list[str], decimal_mark: str) -> bool:
    return bool(fields) and sum(is_number(field, decimal_mark) for field in fields) >= 0.5 * len(fields)
