"""Parts of a second that stand in a column of their own beside times of whole seconds, as FactoryTalk's Millitm does:
which column they are, and the times that they make."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType

import numpy as np
import polars as pl

from app.ingest.columns.clocks import MOST
from app.ingest.columns.joined_stamps import stamps_of_rows
from app.ingest.columns.names import ONE_WAY, name_at
from app.ingest.columns.plain_names import plain
from app.ingest.columns.plans import Fraction, LongPlan, Plan, TimedColumns, WidePlan, name_of
from app.ingest.columns.time_names import unit_of_times
from app.ingest.files.head import Head
from app.ingest.model import NO_TIME, FloatArray, IngestOptions, TimeArray
from app.ingest.times.stamps import TimeForm
from app.ingest.times.time_reader import TimeReader, to_numbers
from app.nanoseconds import NS_PER_S

_NS_PER_MS, _NS_PER_US = 1_000_000, 1_000
_MILLISECONDS = (
    *("millitm", "milli", "millis", "millisec", "millisecs", "millisecond", "milliseconds", "milisecond"),
    *("miliseconds", "msec", "msecs", "mseconds", "millisekunde", "millisekunden", "milliseconde", "millisecondes"),
    *("milisegundo", "milisegundos", "毫秒"),
)
_MICROSECONDS = ("usec", "usecs", "micros", "microsec", "microsecs", "microsecond", "microseconds")
_NAMED = MappingProxyType(dict.fromkeys(_MILLISECONDS, _NS_PER_MS) | dict.fromkeys(_MICROSECONDS, _NS_PER_US))
_OF_TIMES = MappingProxyType({1e-3: _NS_PER_MS, 1e-6: _NS_PER_US})
_UNIT_ALONE = "ms"
"""The name of parts of a second or of anything that is measured in them."""
_GOES_BACK = 0.5  # of the steps from a second to a later one, at least, where parts begin again
_MOVES = 0.5  # of the steps within a second, at least
_LEAP_NS, _EVEN = NS_PER_S / 10, 0.9  # a step of parts, and how many of the seconds are as long as the usual one


@dataclass(frozen=True)
class _Sample:
    """What the first rows have: seconds of their times, (n,) ns, what stands in the column, (n,), and their tags."""

    time_ns: TimeArray
    parts: FloatArray
    tags: Sequence[Sequence[str]]

    def steps(self) -> tuple[FloatArray, FloatArray]:
        """From row to row of a tag, (n,), ns and parts: on from a time to the same or a later one."""
        rows: dict[Sequence[str], list[tuple[int, float]]] = {}
        for tag, at, part in zip(self.tags, self.time_ns.tolist(), self.parts.tolist(), strict=True):
            rows.setdefault(tag, []).append((at, part))
        pairs = [pair for own in rows.values() for pair in pairwise(own)]
        on = np.array([other - one for (one, _), (other, _) in pairs], dtype=np.float64)
        parts = np.array([following - part for (_, part), (_, following) in pairs], dtype=np.float64)
        return np.abs(on), np.where(on < 0.0, -parts, parts)


def with_fraction(plan: Plan, head: Head, options: IngestOptions) -> Plan:
    """The plan with the column that has the parts of a second of its times, where there is one; a note where one may
    be that and is not taken."""
    if isinstance(plan, WidePlan) and len(plan.groups) > 1:
        return plan
    time = plan.groups[0].time if isinstance(plan, WidePlan) else plan.time
    for index, name in _candidates(plan, head):
        unit_ns = _unit_told(name) or _NS_PER_MS
        named, beside = _unit_told(name) is not None, index in (max(time) + 1, min(time) - 1)
        if not named and not beside:
            continue
        why_not = _why_not(_sample(head, plan, time, index, options), plan.form, unit_ns, named, beside)
        if why_not is None:
            note = f"the parts of a second in {name.strip()[:80]!r} were joined to the times"
            return _joined(plan, Fraction(index, unit_ns), note)
        if why_not and not _is_of_times(name):
            note = f"the column {name.strip()[:80]!r} was not joined to the times: {why_not}"
            return replace(plan, notes=(*plan.notes, note))
    return plan


def _candidates(plan: Plan, head: Head) -> Iterator[tuple[int, str]]:
    """Columns that may be parts of a second by their names; those whose names say so first."""
    if isinstance(plan, WidePlan):
        values = plan.groups[0].values
        names = {value.index: value.tag for value in values if len(values) > 1}
        names |= {column.index: column.tag for column in plan.further_times}
    else:
        row = head.row(plan.first_row - 1) if plan.first_row else ()
        others = {other.index for other in plan.others}
        names = {index: name_at(row, index) for index in range(plan.width) if index not in plan.read - others}
    yield from ((index, name) for index, name in names.items() if _unit_told(name) is not None)
    yield from ((index, name) for index, name in names.items() if plain(name) == _UNIT_ALONE)


def _unit_told(name: str) -> int | None:
    """In ns, by a name that is one of parts of a second, or that of times in such a unit, as Time_ms."""
    return _NAMED.get(plain(name)) or _OF_TIMES.get(unit_of_times(name) or 0.0)


def _is_of_times(name: str) -> bool:
    """What has the name of times is no signal, and whatever is left unread is told elsewhere."""
    return unit_of_times(name) is not None


def _sample(head: Head, plan: Plan, time: tuple[int, ...], column: int, options: IngestOptions) -> _Sample:
    keys = plan.keys if isinstance(plan, LongPlan) else ()
    different = dict.fromkeys(head.rows[plan.first_row :])  # the same row may be sent again
    rows = [row for row in different if len(row) > max(*time, *keys, 0)]
    stamps = pl.Series(stamps_of_rows(rows, time), dtype=pl.String)
    time_ns = TimeReader(plan.form, options).read(stamps)
    timed = np.flatnonzero(time_ns != NO_TIME)
    given = [at for at in timed if name_at(rows[at], column)]
    filled = given if len(given) >= MOST * len(timed) else timed  # a row without them has no time
    fields = pl.Series([name_at(rows[at], column) for at in filled], dtype=pl.String)
    return _Sample(time_ns[filled], to_numbers(fields), [tuple(rows[at][key] for key in keys) for at in filled])


def _why_not(sample: _Sample, form: TimeForm, unit_ns: int, named: bool, beside: bool) -> str | None:
    """What speaks against it; nothing to be said where what has no such name is no part of a second."""
    most = NS_PER_S // unit_ns - 1
    if not len(sample.parts) or not np.all(_are_parts(sample.parts, unit_ns)):
        return f"it holds more than whole numbers from 0 to {most}" if named else ""
    if np.any(sample.time_ns % NS_PER_S) or form.resolution_ns > NS_PER_S:
        return "the times are not of whole seconds" if named else ""
    seconds, parts = sample.steps()
    again = seconds == 0.0
    if np.any(again):
        goes_on = _begin_again(parts[again], parts[~again], named)
        return None if goes_on else "within a second it does not go on as times do"
    if named and beside and form.kind != "relative" and not _leaps(seconds, parts * unit_ns):
        return None
    return "nothing tells whether it is a part of them or a signal, as which it was read"


def _leaps(seconds: FloatArray, parts: FloatArray) -> bool:
    """Whether parts leap beside even seconds, which those of times do not: steps (n,), ns, of both."""
    even = len(seconds) > 0 and np.mean(seconds == np.median(seconds)) >= _EVEN
    return bool(even and np.median(np.abs(parts)) > _LEAP_NS)


def _begin_again(within: FloatArray, between: FloatArray, named: bool) -> bool:
    """Whether parts go one way within seconds, and back from a second to the next one: a signal turns, a count goes
    on. Where the name does not say that they are such, what rests from a second to the next is a signal."""
    moved = within[within != 0.0]
    if len(moved) < _MOVES * len(within):
        return False
    one_way = max(np.mean(moved > 0.0), np.mean(moved < 0.0)) >= ONE_WAY
    back = between <= 0.0 if named else between < 0.0
    return bool(one_way and (not len(between) or np.mean(back) >= _GOES_BACK))


def _are_parts(numbers: FloatArray, unit_ns: int) -> np.ndarray:
    return (numbers >= 0.0) & (numbers * unit_ns < NS_PER_S) & (numbers == np.floor(numbers))


def _joined(plan: Plan, fraction: Fraction, note: str) -> Plan:
    form = replace(plan.form, resolution_ns=fraction.unit_ns)
    notes = (*plan.notes, note)
    if isinstance(plan, LongPlan):
        others = tuple(other for other in plan.others if other.index != fraction.index)
        return replace(plan, form=form, fraction=fraction, others=others, notes=notes)
    group = plan.groups[0]
    values = tuple(value for value in group.values if value.index != fraction.index)
    further = tuple(column for column in plan.further_times if column.index != fraction.index)
    groups = (TimedColumns(group.time, form, values, fraction),)
    return replace(plan, groups=groups, notes=notes, further_times=further)


def with_parts(
    frame: pl.DataFrame, fraction: Fraction | None, texts: pl.Series, time_ns: TimeArray
) -> tuple[pl.Series, TimeArray]:
    """What stands in the rows for their times, and the times (n,), ns, with their parts of a second: none where what
    stands there is no such part."""
    if fraction is None:
        return texts, time_ns
    column = frame[name_of(fraction.index)]
    numbers = to_numbers(column)
    good = _are_parts(numbers, fraction.unit_ns)
    odd = pl.Series(~good & (time_ns != NO_TIME))
    if odd.any():
        shown = pl.concat_str(texts.cast(pl.String), column.cast(pl.String).fill_null("nothing"), separator=" with ")
        texts = pl.select(pl.when(odd).then(shown).otherwise(texts.cast(pl.String)).alias("t")).to_series()
    parts_ns = np.where(good, numbers, 0.0).astype(np.int64) * fraction.unit_ns
    return texts, np.where(good & (time_ns != NO_TIME), time_ns + parts_ns, NO_TIME)
