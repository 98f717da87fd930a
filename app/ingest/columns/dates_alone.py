"""Rows whose times are dates without a clock, or hours without minutes: many of one day, or hour, have no times."""

from app.errors import DataError
from app.ingest.columns.clocks import are_midnights
from app.ingest.columns.joined_stamps import stamps_of_rows
from app.ingest.columns.names import name_at
from app.ingest.columns.plans import LongPlan, Plan
from app.ingest.files.head import Head

_FEWEST, _OF_A_DAY = 6, 3
"""Rows that are looked at, and rows that a day or an hour has on the mean; two may have been sent twice."""


def refuse_dates_alone(plan: Plan, head: Head) -> None:
    """Raises DataError where most days have several rows, of each tag, and no clock, or hours and no minutes: spread
    over them they would have times that are made up."""
    time, keys = (plan.time, plan.keys) if isinstance(plan, LongPlan) else (plan.groups[0].time, ())
    different = dict.fromkeys(head.rows[plan.first_row :])  # the same row may be sent over and over
    rows = [row for row in different if len(row) > max(time) and row[time[0]]]
    stamps = stamps_of_rows(rows, time)
    if plan.form.kind != "text" or not (plan.form.is_date or plan.form.is_of_hours or _are_of_days(stamps)):
        return
    days = {(stamp, *(name_at(row, key) for key in keys)) for stamp, row in zip(stamps, rows, strict=True)}
    if len(rows) >= max(_FEWEST, _OF_A_DAY * len(days)):
        what = "hours without minutes" if plan.form.is_of_hours else "dates without a clock"
        raise DataError(
            "unknown_layout",
            f"the times are {what}, {stamps[0][:60]!r} the first of them, and rows share them; needed "
            "is the time of day, in the same column or in one beside it, such as 06:00:30",
        )


def _are_of_days(stamps: list[str]) -> bool:
    """Whether stamps are all of midnight, and of several: a record may begin with many rows of one."""
    return len(set(stamps)) > 1 and all(are_midnights([stamp]) for stamp in set(stamps))
