"""Zones that a file names elsewhere than in its times and in the name of their column: in a column of their own, or in
a line above the names. They are told, and not taken."""

import re
from collections.abc import Iterable, Iterator, Set

import polars as pl

from app.ingest.columns.joined_stamps import stamps_of_rows
from app.ingest.columns.names import name_at
from app.ingest.columns.plans import LongPlan, Plan
from app.ingest.files.head import PREAMBLE_ROWS, Head
from app.ingest.model import NO_TIME, IngestOptions
from app.ingest.telling import without_controls
from app.ingest.times.spelled_times import OFFSETS_OF_LETTERS, ZONES_IN_LETTERS
from app.ingest.times.time_reader import TimeReader, from_utc
from app.nanoseconds import NS_PER_S

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
_OFFSET_ALONE = re.compile(r"(?:UTC|GMT)?\s*([+-])\s*(\d{1,2})(?::?(\d{2}))?")
_MOST_SHOWN = 60


def notes_of_zones(plan: Plan, head: Head, options: IngestOptions) -> tuple[str, ...]:
    """Where the times themselves tell no zone and the set one is not the same by its name."""
    form = plan.form
    if form.kind not in ("text", "serial") or form.zoned or form.zone or form.utc_offset_ns is not None:
        return ()
    set_zone = options.time_zone
    told = {what: zone for what, zone in _named(plan, head) if not _is(zone, set_zone)}
    if not told:
        return ()
    shown = without_controls(next(iter(told)))[:_MOST_SHOWN]
    if _are_offsets_of(set_zone, told.values(), plan, head, options):
        return (f"the file names a zone, {shown}; {set_zone}, the set one, has the same clock at its first times",)
    return (
        f"check this first, the file names a zone that was not taken: {shown}; times are in the set zone, {set_zone}, "
        "and `--time-zone` sets it",
    )


def _is(zone: str, set_zone: str) -> bool:
    return _UTC.fullmatch(zone) is not None if set_zone == "UTC" else set_zone in zone


def _are_offsets_of(set_zone: str, told: Iterable[str], plan: Plan, head: Head, options: IngestOptions) -> bool:
    """Whether the set zone's clock is as far from UTC, at the first times of the file, as what is told: `UTC+02:00` in
    summer is no other zone than Europe/Berlin."""
    offsets = {_offset_ns(zone) for zone in told}
    if None in offsets:
        return False
    columns = plan.time if isinstance(plan, LongPlan) else plan.groups[0].time
    rows = [row for row in head.rows[plan.first_row :] if any(row)]
    at = TimeReader(plan.form, options).read(pl.Series(stamps_of_rows(rows, columns), dtype=pl.String))
    at = at[at != NO_TIME]
    return len(at) > 0 and set((from_utc(at, set_zone) - at).tolist()) == offsets


def _offset_ns(zone: str) -> int | None:
    """Of an offset from UTC, or of letters that tell one; None for the name of a place, and for other letters."""
    found = _OFFSET_ALONE.fullmatch(OFFSETS_OF_LETTERS.get(zone, zone))
    if found is None:
        return None
    sign, hours, minutes = found.groups()
    seconds = (int(hours) * 60 + int(minutes or 0)) * 60
    return (-seconds if sign == "-" else seconds) * NS_PER_S


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
