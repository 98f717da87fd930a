"""Zones that a file names elsewhere than in its times and in the name of their column: in a column of their own, or in
a line above the names. They are told, and not taken."""

import re
from collections.abc import Iterator

from app.ingest.columns.names import name_at
from app.ingest.columns.plans import LongPlan, Plan
from app.ingest.files.head import PREAMBLE_ROWS, Head
from app.ingest.model import IngestOptions
from app.ingest.times.spelled_times import ZONES_IN_LETTERS

_OFFSET = r"(?:UTC|GMT)\s*(?:[+-]\s*\d{1,2}(?::?\d{2})?)?|[+-]\d{2}:\d{2}"
_ZONE = re.compile(rf"(?:{_OFFSET}|{'|'.join(ZONES_IN_LETTERS)}|[A-Z]{{1,2}}[SD]T|[A-Z][A-Za-z]+/[A-Z]\w+)")
_CALLED = r"(?:time ?zone|zeitzone|fuseau(?: horaire)?|(?:zona|huso|fuso) hor[aá]ri[oa]|时区)"
_NAME = re.compile(rf"[#\s]*{_CALLED}\s*[:=]?\s*", re.IGNORECASE)
_TOLD = re.compile(rf"[#\s]*{_CALLED}\s*[:=]\s*(\S.*)", re.IGNORECASE)
_UTC = re.compile(r"(?:UTC|GMT|Z)?\s*(?:[+-]\s*0{1,2}(?::?00)?)?")
_MOST_SHOWN = 60


def notes_of_zones(plan: Plan, head: Head, options: IngestOptions) -> tuple[str, ...]:
    """Where the times themselves tell no zone and the set one is not the same by its name."""
    form = plan.form
    if form.kind not in ("text", "serial") or form.zoned or form.zone or form.utc_offset_ns is not None:
        return ()
    set_zone = options.time_zone
    told = [what for what, zone in _named(plan, head) if not _is(zone, set_zone)]
    if not told:
        return ()
    return (
        f"check this first, the file names a zone that was not taken: {told[0][:_MOST_SHOWN]}; times are in the set "
        f"zone, {set_zone}, and `--time-zone` sets it",
    )


def _is(zone: str, set_zone: str) -> bool:
    return _UTC.fullmatch(zone) is not None if set_zone == "UTC" else set_zone in zone


def _named(plan: Plan, head: Head) -> Iterator[tuple[str, str]]:
    """What is shown of each, and the zone in it."""
    for row in head.rows[: min(plan.first_row, PREAMBLE_ROWS)]:
        for at, cell in enumerate(row):
            if found := _TOLD.fullmatch(cell):
                yield cell.strip("# "), found[1]
            elif _NAME.fullmatch(cell) and at + 1 < len(row) and _ZONE.fullmatch(row[at + 1]):
                yield f"{cell.strip('# :=')}: {row[at + 1]}", row[at + 1]
    times = plan.time if isinstance(plan, LongPlan) else {at for group in plan.groups for at in group.time}
    names = head.row(plan.first_row - 1 - len(plan.heading)) if plan.first_row else ()
    for at in range(plan.width):
        fields = [] if at in times else head.column(at, plan.first_row)
        if fields and all(map(_ZONE.fullmatch, set(fields))):
            name = name_at(names, at) or f"column {at + 1}"
            yield f"{name} is {fields[0]}", fields[0] if len(set(fields)) == 1 else ""
