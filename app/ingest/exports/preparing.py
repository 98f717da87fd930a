"""A plan made ready for a file: names capped, the one loop of a file without tags, stamps that are cut, doubtful
forms said."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import polars as pl

from app.errors import DataError
from app.ingest.columns.joined_stamps import stamps_of_rows
from app.ingest.columns.plans import Plan, TimedColumns, ValueColumn, WidePlan
from app.ingest.files.head import Head
from app.ingest.model import NO_TIME, IngestOptions, TimeArray
from app.ingest.rejecting import RejectLog
from app.ingest.tables.spreading import SPREAD_NOTE, come_in_threes, shown_resolution, stamps_are_cut
from app.ingest.tags.grouping import place
from app.ingest.tags.loops import Grouping
from app.ingest.times.stamps import TimeForm, as_formatted, parse_text
from app.ingest.times.time_reader import TimeReader


def prepared(plan: Plan, grouping: Grouping, head: Head, options: IngestOptions, log: RejectLog) -> Plan:
    if not isinstance(plan, WidePlan):
        return plan
    groups = tuple(group for group in (_named(group, options, log) for group in plan.groups) if group.values)
    if not groups:
        raise DataError("nothing_readable", f"every column has a name of more than {options.max_name} characters")
    plan = replace(plan, groups=groups)
    tags = [value.tag for group in groups for value in group.values]
    if any(place(tag, "").loop == "" for tag in tags):
        grouping.attach_bare(tags)
    if _cut(plan, head):
        plan = replace(plan, spread=True, notes=(*plan.notes, SPREAD_NOTE))
    return plan


def _named(group: TimedColumns, options: IngestOptions, log: RejectLog) -> TimedColumns:
    """Without columns whose names are too long; names that repeat are numbered."""
    seen: Counter[str] = Counter()
    values: list[ValueColumn] = []
    for value in group.values:
        if len(value.tag) > options.max_name:
            log.add(
                "name_too_long", f"column {value.index + 1} has a name of {len(value.tag)} characters", None, value.tag
            )
            continue
        seen[value.tag] += 1
        again = seen[value.tag]
        values.append(value if again == 1 else replace(value, tag=f"{value.tag} ({again})"))
    return replace(group, values=tuple(values))


def _cut(plan: WidePlan, head: Head) -> bool:
    group = plan.groups[0]
    if len(plan.groups) > 1 or group.fraction is not None or group.form.kind not in ("text", "epoch"):
        return False
    rows = [row for row in head.rows[plan.first_row :] if len(row) > max(group.time)]
    texts = stamps_of_rows(rows, group.time)
    times = _times(texts, group.form)
    times = times[times != NO_TIME]
    if not stamps_are_cut(times, shown_resolution(times, group.form.resolution_ns)):
        return False
    values = [[field for index, field in enumerate(row) if index not in group.time] for row in rows]
    return not _sent_twice(texts, values, come_in_threes(times))


def _sent_twice(texts: list[str], values: Sequence[Sequence[str]], in_threes: bool) -> bool:
    """Whether stamps repeat because rows do: those of a stamp are all the same, and those of two stamps are not. Where
    nothing moves at all, rows come twice, and not three times."""
    pairs = [(texts[k] == texts[k + 1], values[k] == values[k + 1]) for k in range(len(values) - 1)]
    if not all(same for one_stamp, same in pairs if one_stamp):
        return False
    between = [same for one_stamp, same in pairs if not one_stamp]
    return not (in_threes and between and all(between))


def _times(texts: list[str], form: TimeForm) -> TimeArray:
    if form.kind == "epoch":
        return TimeReader(form, IngestOptions()).read(pl.Series(texts, dtype=pl.String))
    return parse_text(as_formatted(pl.Series(texts, dtype=pl.String), form), form.format, form.zoned)
