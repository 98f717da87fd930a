"""LabVIEW's measurement files (.lvm): lines of a name and what it is set to, then X_Value and the channels. Seconds
count from the start that the header tells or, where Time_Pref is Absolute, from 1904.

LabVIEW Measurement
Time_Pref <tab> Relative
***End_of_Header***
Date <tab> 2026/03/01 <tab> 2026/03/01
Time <tab> 06:00:00.0000000 <tab> 06:00:00.0000000
***End_of_Header***
X_Value <tab> FIC101.PV <tab> FIC101.OP <tab> Comment
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import polars as pl

from app.errors import DataError
from app.ingest.columns.names import numbers_of
from app.ingest.columns.plans import TimedColumns, WidePlan
from app.ingest.columns.plans_by_names import wide_from
from app.ingest.columns.time_columns import NO_ROWS, first_row_of_times
from app.ingest.files.head import PREAMBLE_ROWS, Head
from app.ingest.model import NO_TIME, IngestOptions
from app.ingest.times.counted_times import EPOCH_ROUNDING_NS, OURS_FROM_S, OURS_TO_S
from app.ingest.times.stamps import TimeForm, find_form
from app.ingest.times.time_reader import TimeReader
from app.nanoseconds import NS_PER_S

_X = "X_Value"
_1904_S = -2_082_844_800
_OF_1904 = "times are seconds since 1904, as LabVIEW counts them"


def sniff(head: Head, options: IngestOptions) -> WidePlan | None:
    at = next((at for at, row in enumerate(head.rows[:PREAMBLE_ROWS]) if row[:1] == (_X,)), None)
    if at is None or not any(row[:1] == ("LabVIEW Measurement",) for row in head.rows[:at]):
        return None
    settings = {row[0]: row[1] for row in head.rows[:at] if len(row) > 1 and row[1]}
    if settings.get("X_Dimension", "Time") != "Time":
        return None
    names, first_row = head.row(at), first_row_of_times(head, 0, options, _X, at + 1)
    if first_row == NO_ROWS and settings.get("X_Columns") == "No":
        needed = "needed is one with a column of them (One Column)"
        raise DataError("unknown_layout", f"LabVIEW wrote this file without times (X_Columns is No); {needed}")
    plan = None if first_row == NO_ROWS else wide_from(head, "labview", names, (at,), first_row, options, time=(0,))
    return plan and _with_start(plan, head, settings, options)


def _with_start(plan: WidePlan, head: Head, settings: Mapping[str, str], options: IngestOptions) -> WidePlan | None:
    """The plan with the instants that the header makes of its seconds. Each column X_Value has the channels up to the
    next one; None where no one has any."""
    form = _absolute(plan, head) if settings.get("Time_Pref") == "Absolute" else _started(settings, options)
    form = form or plan.form
    times = [index for index, name in enumerate(plan.names) if name == _X]
    values = plan.groups[0].values
    groups = (
        TimedColumns((time,), form, tuple(value for value in values if time < value.index < end))
        for time, end in zip(times, (*times[1:], plan.width), strict=True)
    )
    with_channels = tuple(group for group in groups if group.values)
    return replace(plan, groups=with_channels) if with_channels else None


def _absolute(plan: WidePlan, head: Head) -> TimeForm | None:
    """None where its times are not of our years."""
    numbers = numbers_of(head, 0, plan.first_row) + _1904_S
    ours = np.all((numbers > OURS_FROM_S) & (numbers < OURS_TO_S))
    form = TimeForm("epoch", origin_ns=_1904_S * NS_PER_S, rounding_ns=EPOCH_ROUNDING_NS, notes=(_OF_1904,))
    return form if ours else None


def _started(settings: Mapping[str, str], options: IngestOptions) -> TimeForm | None:
    """None where the header tells no start, or comes anew with each segment, which has a start of its own."""
    stamp = f"{settings.get('Date', '')} {settings.get('Time', '')}"
    form = find_form([stamp], "", options)
    if form is None or form.kind != "text" or form.is_date or settings.get("Multi_Headings") == "Yes":
        return None
    start_ns = int(TimeReader(form, options).read(pl.Series([stamp]))[0])
    if start_ns == NO_TIME:
        return None
    note = f"times count from the start that the header tells: {stamp}"
    rounding_ns = EPOCH_ROUNDING_NS
    return TimeForm("epoch", origin_ns=start_ns, rounding_ns=rounding_ns, from_clock=True, notes=(*form.notes, note))
