"""Wide: a row of names, then a row an instant. Recordings `time,SP,PV,OP[,MODE]` and SQL dumps with date and time
apart are of this form."""

from collections.abc import Callable
from dataclasses import replace

from app.ingest.columns.clocks import date_and_clock, is_date_or_clock
from app.ingest.columns.names import ONE_WAY, name_at, numbers_of
from app.ingest.columns.of_words import column_that_sorts, column_that_takes_turns, refuse_to_mix
from app.ingest.columns.plans import WidePlan
from app.ingest.columns.plans_by_names import wide_from
from app.ingest.columns.time_columns import (
    first_row_below,
    first_row_of_times,
    may_be_times,
    stamps_in,
    time_columns_in,
    times_assumed,
)
from app.ingest.columns.time_names import time_columns
from app.ingest.columns.widths import usual_width
from app.ingest.files.head import PREAMBLE_ROWS, Head, is_number
from app.ingest.model import IngestOptions
from app.ingest.tags.grouping import AUDITED, place, share_like_tags

_FEWEST_NAMES = 2
_MOST_OF_TIMES = 2  # columns: date and clock
_FEW_ROWS = 8
_MOST_STAMPS = 0.75  # of the rows, where those of a stamp may be told apart by a word


def sniff(head: Head, options: IngestOptions) -> WidePlan | None:
    """By words that may be names; where there are none, by numbers beside the name of the times."""
    plan = _sniff_below(head, options, _may_be_names)
    return plan if plan is not None else _sniff_below(head, options, _are_numbers_beside_times)


def _sniff_below(head: Head, options: IngestOptions, may_be_names: Callable[[Head, int], bool]) -> WidePlan | None:
    for index, names in enumerate(head.rows[:PREAMBLE_ROWS]):
        if not may_be_names(head, index):
            continue
        written, names = names, _with_name_of_times(head, names, index)
        time = time_columns_in(head, names, index + 1, options)
        time = time or stamps_in(head, names, index + 1, options, of_rows=True) or (0,)
        time = date_and_clock(head, time, names, index + 1, options)
        name = name_at(names, time[0])
        if time_columns(names):
            first_row = first_row_below(head, index, time[0], options, name)
        else:
            first_row = first_row_of_times(head, time[0], options, name)
        if any(names_better(row, written) for row in head.rows[index + 1 : max(first_row, 0)]):
            continue  # a title with a comma in it stands above the names
        if first_row > index and not signal_of_numbers(head, names, first_row, time[0]):
            plan = wide_from(head, "wide", names, (index,), first_row, options, time)
            if plan is not None:
                _refuse_words_that_part(head, names, plan, options)
            return plan and _of_times(plan, head, names)
    return None


def _may_be_names(head: Head, at: int) -> bool:
    """Whether a row may name columns, some of them by numbers."""
    row = head.row(at)
    named = [name for name in row if name]
    if len(named) < _FEWEST_NAMES:
        return False
    if _has_number(head, row) and (_is_title(head, at) or not _may_have_numbers(row)):
        return False
    return not (_are_starts(named) or _say_time_of_each(named))


def _has_number(head: Head, row: tuple[str, ...]) -> bool:
    return any(is_number(name, head.decimal_mark) for name in row if name)


def _is_title(head: Head, at: int) -> bool:
    """Whether a row with numbers may be one of settings, as `Range,PV,0,OP,100`: it has not as many cells as the rows,
    or a row without numbers below it names as many signals, or the times."""
    row = head.row(at)
    if len(row) != usual_width(head, at + 1):
        return True
    below = (other for other in head.rows[at + 1 : PREAMBLE_ROWS] if any(other) and not _has_number(head, other))
    return any(audited_signals(other) >= audited_signals(row) > 0 or time_columns(other) for other in below)


def _may_have_numbers(row: tuple[str, ...]) -> bool:
    """Whether a row with numbers has the names of signals beside that of times, or PV and OP behind a first cell that
    is neither a time nor a signal: then the numbers are names too, as of tags or of columns that somebody added."""
    if time_columns(row):
        return _names_times_and_signals(row)
    if any(map(str.isdigit, row[0])) or place(row[0], "").signal != "OTHER":
        return False
    return {place(name, "").signal for name in row} >= AUDITED


def _are_numbers_beside_times(head: Head, at: int) -> bool:
    """Whether a row names the times, and other columns by numbers that differ: it has as many cells as the rows, and no
    other one names times and signals."""
    row = head.row(at)
    times = time_columns(row)
    others = [name for index, name in enumerate(row) if index not in times]
    if not 0 < len(others) < len(row) or len(set(others)) < len(others) or not all(others):
        return False
    if not _has_number(head, tuple(others)) or len(row) != usual_width(head, at + 1):
        return False
    return not any(map(_names_times_and_signals, head.rows))


def _names_times_and_signals(row: tuple[str, ...]) -> bool:
    return bool(time_columns(row)) and not AUDITED.isdisjoint(place(name, "").signal for name in row)


def _are_starts(named: list[str]) -> bool:
    """Whether a row has the starts of signals: dates or clocks, and none of its cells names one."""
    return 2 * sum(map(is_date_or_clock, named)) >= len(named) and audited_signals(tuple(named)) == 0


def _say_time_of_each(named: list[str]) -> bool:
    """Whether a row says of each signal that it is one of time: X_Dimension, Time, Time."""
    first, *others = named
    return len(others) > 1 and len(set(others)) == 1 and bool(time_columns((others[0],))) and not time_columns((first,))


def _refuse_words_that_part(head: Head, names: tuple[str, ...], plan: WidePlan, options: IngestOptions) -> None:
    """Raises WordsPartRows where a column of words tells the rows of one time apart, or those of some time: each word
    has values of its own, which would be mixed."""
    refuse_to_mix(names, _words_of_stamps(head, names, plan))
    refuse_to_mix(names, column_that_sorts(plan, head, options))
    refuse_to_mix(names, column_that_takes_turns(plan, head))


def _words_of_stamps(head: Head, names: tuple[str, ...], plan: WidePlan) -> int | None:
    """The column whose words tell rows of one stamp apart that follow each other."""
    needed = max(plan.width, len(names))
    rows = [row + ("",) * (needed - len(row)) for row in head.rows[plan.first_row :] if any(row)]
    stamps = [tuple(row[index] for index in plan.groups[0].time) for row in rows]
    if len(rows) < _FEW_ROWS or len(set(stamps)) > _MOST_STAMPS * len(rows):
        return None
    for index in range(len(names)):
        words = [row[index] for row in rows]
        pairs = set(zip(stamps, words, strict=True))
        if 1 < len(set(words)) <= len(rows) / 2 and len(pairs) >= ONE_WAY * len(rows) and _are_words(head, words):
            return index
    return None


def _are_words(head: Head, fields: list[str]) -> bool:
    return all(fields) and not any(is_number(field, head.decimal_mark) for field in set(fields))


def _of_times(plan: WidePlan, head: Head, names: tuple[str, ...]) -> WidePlan | None:
    """Numbers that no name calls times, and no count since 1970, are some where they rise, and then this is told."""
    if time_columns(names) or plan.form.kind != "relative":
        return plan
    column = plan.groups[0].time[0]
    if not may_be_times(names[column], numbers_of(head, column, plan.first_row)):
        return None
    told = times_assumed(names[column], plan.form)
    return replace(plan, times_assumed=told, notes=(*plan.notes, told))


def names_better(row: tuple[str, ...], names: tuple[str, ...]) -> bool:
    """Whether the names stand in the lower row: a row of descriptions or units below them may be the wider one too."""
    above, below = audited_signals(names), audited_signals(row)
    if _as_wide(row, names) and below > above and share_like_tags(row) > share_like_tags(names):
        return True
    if not time_columns(row):  # as where Tag stands above them, and many more names than a title has
        more = wider(row, names) and not _as_wide(row, names) and share_like_tags(row) >= share_like_tags(names)
        return above == 0 < below and not time_columns(names) and more
    if wider(row, names):
        return above == 0 or below > above
    return above == 0 < below and not time_columns(names)


def _with_name_of_times(head: Head, names: tuple[str, ...], at: int) -> tuple[str, ...]:
    """Where descriptions stand beside the row of names, one of the two alone may name the times."""
    if time_columns(names):
        return names
    for row in (*head.rows[max(at - 2, 0) : at], *head.rows[at + 1 : at + 3]):
        time = time_columns(row)
        if time and _as_wide(row, names) and all(place(names[index], "").signal == "OTHER" for index in time):
            return tuple(row[index] if index in time else name for index, name in enumerate(names))
    return names


def _as_wide(row: tuple[str, ...], names: tuple[str, ...]) -> bool:
    """Whether a row names as many columns as another one, but for those of times."""
    return len(row) == len(names) and abs(sum(map(bool, row)) - sum(map(bool, names))) <= _MOST_OF_TIMES


def audited_signals(names: tuple[str, ...]) -> int:
    return sum(place(name, "").signal in AUDITED for name in names)


def wider(row: tuple[str, ...], names: tuple[str, ...]) -> bool:
    return sum(map(bool, row)) > sum(map(bool, names))


def signal_of_numbers(head: Head, names: tuple[str, ...], first_row: int, column: int) -> bool:
    """Whether the column is a signal by its name, so that its numbers are no times: the file has none then."""
    numbers = is_number(head.rows[first_row][column], head.decimal_mark)
    return numbers and place(name_at(names, column), "").signal != "OTHER"
