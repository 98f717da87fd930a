"""Parts of a second that stand in a column of their own beside times of whole seconds, as FactoryTalk's Millitm does:
which column they are, and the times that they make."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType

import numpy as np
import polars as pl

from app.ingest.columns.clocks import joined_stamp
from app.ingest.columns.names import ONE_WAY, name_at, plain
from app.ingest.columns.plans import Fraction, LongPlan, Plan, TimedColumns, WidePlan, name_of
from app.ingest.files.head import Head
from app.ingest.model import NO_TIME, FloatArray, IngestOptions, TimeArray
from app.ingest.times.stamps import TimeForm, TimeReader, to_numbers
from app.nanoseconds import NS_PER_S

_NS_PER_MS, _NS_PER_US = 1_000_000, 1_000
_MILLISECONDS = (
    *("millitm", "milli", "millis", "millisec", "millisecs", "millisecond", "milliseconds", "milisecond"),
    *("miliseconds", "msec", "msecs", "millisekunde", "millisekunden", "milliseconde", "millisecondes"),
    *("milisegundo", "milisegundos", "毫秒"),
)
_MICROSECONDS = ("usec", "usecs", "micros", "microsec", "microsecs", "microsecond", "microseconds")
_NAMED = MappingProxyType(dict.fromkeys(_MILLISECONDS, _NS_PER_MS) | dict.fromkeys(_MICROSECONDS, _NS_PER_US))
_UNIT_ALONE = "ms"
"""The name of parts of a second or of anything that is measured in them."""
_GOES_BACK = 0.5  # of the steps from a second to a later one, at least, where parts begin again


@dataclass(frozen=True)
class _Sample:
    """What the first rows have: seconds of their times, (n,) ns, what stands in the column, (n,), and their tags."""

    time_ns: TimeArray
    parts: FloatArray
    tags: Sequence[str]

    def steps(self) -> tuple[list[float], list[float]]:
        """From row to row of a tag: those of the parts within a second, and from one second to a later one."""
        within, between = [], []
        rows: dict[str, list[tuple[int, float]]] = {}
        for tag, at, part in zip(self.tags, self.time_ns.tolist(), self.parts.tolist(), strict=True):
            rows.setdefault(tag, []).append((at, part))
        for (one, part), (other, following) in (pair for own in rows.values() for pair in pairwise(own)):
            if one == other:
                within.append(following - part)
            else:
                between.append((following - part) * (1 if other > one else -1))
        return within, between


def with_fraction(plan: Plan, head: Head, options: IngestOptions) -> Plan:
    """The plan with the column that has the parts of a second of its times, where there is one; a note where one may
    be that and is not taken."""
    if isinstance(plan, WidePlan) and len(plan.groups) > 1:
        return plan
    time, tag = (plan.groups[0].time, None) if isinstance(plan, WidePlan) else (plan.time, plan.tag)
    for index, name in _candidates(plan, head):
        unit_ns = _NAMED.get(plain(name), _NS_PER_MS)
        named = plain(name) in _NAMED
        if not named and index not in (max(time) + 1, min(time) - 1):
            continue
        why_not = _why_not(_sample(head, plan, time, tag, index, options), plan.form, unit_ns, named)
        if why_not is None:
            note = f"the parts of a second in {name.strip()[:80]!r} were joined to the times"
            return _joined(plan, Fraction(index, unit_ns), note)
        if why_not:
            note = f"the column {name.strip()[:80]!r} was not joined to the times: {why_not}"
            return replace(plan, notes=(*plan.notes, note))
    return plan


def _candidates(plan: Plan, head: Head) -> Iterator[tuple[int, str]]:
    """Columns that may be parts of a second by their names; those whose names say so first."""
    if isinstance(plan, WidePlan):
        values = plan.groups[0].values
        names = {value.index: value.tag for value in values if len(values) > 1}
    else:
        row = head.row(plan.first_row - 1) if plan.first_row else ()
        others = {other.index for other in plan.others}
        names = {index: name_at(row, index) for index in range(plan.width) if index not in plan.read - others}
    yield from ((index, name) for index, name in names.items() if plain(name) in _NAMED)
    yield from ((index, name) for index, name in names.items() if plain(name) == _UNIT_ALONE)


def _sample(
    head: Head, plan: Plan, time: tuple[int, ...], tag: int | None, column: int, options: IngestOptions
) -> _Sample:
    rows = [row for row in head.rows[plan.first_row :] if len(row) > max(*time, tag or 0)]
    stamps = pl.Series([joined_stamp([row[at] for at in time]) for row in rows], dtype=pl.String)
    time_ns = TimeReader(plan.form, options).read(stamps)
    timed = np.flatnonzero(time_ns != NO_TIME)
    fields = pl.Series([name_at(rows[at], column) for at in timed], dtype=pl.String)
    return _Sample(time_ns[timed], to_numbers(fields), ["" if tag is None else rows[at][tag] for at in timed])


def _why_not(sample: _Sample, form: TimeForm, unit_ns: int, named: bool) -> str | None:
    """What speaks against it; nothing to be said where what has no such name is no part of a second."""
    most = NS_PER_S // unit_ns - 1
    if not len(sample.parts) or not np.all(_are_parts(sample.parts, unit_ns)):
        return f"it holds more than whole numbers from 0 to {most}" if named else ""
    if np.any(sample.time_ns % NS_PER_S) or form.resolution_ns > NS_PER_S:
        return "the times are not of whole seconds" if named else ""
    within, between = sample.steps()
    moved = [step for step in within if step]
    if moved and not _begin_again(moved, between):
        return "within a second it does not go on as times do"
    if moved or (named and form.kind != "relative"):
        return None
    return "nothing tells whether it is a part of them or a signal, as which it was read"


def _begin_again(within: Sequence[float], between: Sequence[float]) -> bool:
    """Whether parts go one way within seconds, and back from a second to the next one: a signal turns, a count goes
    on."""
    way = np.sign(np.array(within))
    one_way = max(np.mean(way > 0), np.mean(way < 0)) >= ONE_WAY
    return bool(one_way and (not between or np.mean(np.array(between) <= 0.0) >= _GOES_BACK))


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
    return replace(plan, groups=(TimedColumns(group.time, form, values, fraction),), notes=notes)


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
