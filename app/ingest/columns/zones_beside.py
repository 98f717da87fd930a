"""Zones that a file names elsewhere than in its times and in the name of their column: in a column of their own, or in
a line above the names. They are told, and not taken."""

import re
from collections.abc import Iterator, Set

from app.ingest.columns.names import name_at
from app.ingest.columns.plans import LongPlan, Plan
from app.ingest.files.head import PREAMBLE_ROWS, Head
from app.ingest.model import IngestOptions
from app.ingest.telling import without_controls
from app.ingest.times.spelled_times import ZONES_IN_LETTERS

_OFFSET = r"(?:UTC|GMT)\s*(?:[+-]\s*\d{1,2}(?::?\d{2})?)?|[+-]\d{2}:\d{2}"
_REGION = r"(?:Africa|America|Antarctica|Arctic|Asia|Atlantic|Australia|Etc|Europe|Indian|Pacific|US)/[A-Z][\w+/-]+"
_FOR_SURE = re.compile(rf"(?:UTC|GMT)(?:\s*[+-]\s*\d{{1,2}}(?::?\d{{2}})?)?|{_REGION}")
"""Under any name: a rain gauge is `WET`, a value `IST`, and an area `Plant/Unit1`."""
_ZONE = re.compile(rf"(?:{_OFFSET}|{'|'.join(ZONES_IN_LETTERS)}|[A-Z]{{1,2}}[SD]T|{_REGION})")
_CALLED = r"(?:time ?zone|zeitzone|fuseau(?: horaire)?|(?:zona|huso|fuso) hor[aá]ri[oa]|时区)"
_NAME = re.compile(rf"[#\s]*{_CALLED}\s*[:=]?\s*", re.IGNORECASE)
_TOLD = re.compile(rf"[#\s]*{_CALLED}\s*[:=]\s*(\S.*)", re.IGNORECASE)
_COLUMN = re.compile(rf"tz|zone|{_CALLED}|(?:(?:utc|gmt|tz|zone)[ _-]?)?offset|dst", re.IGNORECASE)
_IN_FULL = r"\(?coordinated universal time\)?"
_UTC = re.compile(
    rf"\(?(?:(?:etc/)?(?:utc|uct|gmt|zulu)|z)?\s*(?:[+±-]\s*0{{1,2}}(?::?00)?)?\)?\s*(?:{_IN_FULL})?", re.IGNORECASE
)
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
    shown = without_controls(told[0])[:_MOST_SHOWN]
    return (
        f"check this first, the file names a zone that was not taken: {shown}; times are in the set zone, {set_zone}, "
        "and `--time-zone` sets it",
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
    names = head.row(plan.first_row - 1 - len(plan.heading)) if plan.first_row else ()
    for at in sorted(set(range(plan.width)) - _read(plan)):
        fields = _zones_of(head, at, plan.first_row, name_at(names, at))
        yield from ((f"{name_at(names, at) or f'column {at + 1}'} is {zone}", zone) for zone in dict.fromkeys(fields))


def _read(plan: Plan) -> Set[int | None]:
    """The columns that hold no zone: in a wide table, all others are taken for values before they are read."""
    return plan.read if isinstance(plan, LongPlan) else {at for group in plan.groups for at in group.time}


def _zones_of(head: Head, at: int, first_row: int, name: str) -> list[str]:
    """The fields of a column, if all are zones; a look at the first one spares most columns the rest."""
    zone = _ZONE if _COLUMN.fullmatch(name.strip()) else _FOR_SURE
    row = head.row(first_row)
    if at < len(row) and row[at] and not zone.fullmatch(row[at]):
        return []
    fields = head.column(at, first_row)
    return fields if all(map(zone.fullmatch, set(fields))) else []
