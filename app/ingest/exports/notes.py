"""What is to be said of how a table was read: notes on its rows, times and names, and on its mapping."""

import re
from collections.abc import Collection
from dataclasses import dataclass
from datetime import UTC, datetime

from app.counting import counted
from app.ingest.columns.plans import Plan, WidePlan
from app.ingest.model import IngestOptions
from app.ingest.numbers.scale_jumps import ScaleJumps
from app.ingest.tables.spreading import SPREAD_NOTE
from app.ingest.tables.tally import Tally
from app.ingest.tags.grouping import TagMapping
from app.ingest.tags.loops import Grouping
from app.ingest.tags.settling import told
from app.ingest.telling import first_of
from app.ingest.times.doubled_hour import are_put_back
from app.ingest.times.read_once import puts_clocks_back
from app.ingest.times.wall_clock import may_come_twice
from app.nanoseconds import NS_PER_S

CLOCKS_APART_NS = 15 * 60 * NS_PER_S
"""Of a historian and of this machine. Zones lie as far apart at least, but for what a file's last rows are old."""

_OF_INTERVALS = re.compile(r"(?i)[\s_.(\[-](min|max|avg|ave|mean|minimum|maximum|average)[)\]]?$")
SHARE_REPEATED = 0.1
"""Of the rows, above which times that run back and that no name tells are doubted."""


@dataclass(frozen=True)
class NotesOfRows:
    """What was found, as far as rows were read."""

    plan: Plan
    tally: Tally
    grouping: Grouping
    scale_jumps: ScaleJumps
    options: IngestOptions

    def all(self) -> list[str]:
        """All but those that tell what of the mapping is in the file."""
        notes = [*self.plan.notes, *self.plan.form.notes, *self.times_in_doubt()]
        notes += self._notes_of_times()
        notes += self._ahead_of_clock()
        notes += self.tally.writing.notes(self.grouping.placed)
        notes += self.scale_jumps.notes()
        if self.tally.wordy:
            shown = first_of([tag[:80] for tag in self.tally.wordy], 5)
            notes.append(f"columns that hold no number were left out: {shown}")
        if self.tally.unknown_qualities:
            shown = first_of([tag[:80] for tag in self.tally.unknown_qualities], 5)
            notes.append(
                "columns are called as qualities of values are, and nothing tells which of their numbers are good; no "
                f"value was refused by them: {shown}"
            )
        notes += self.tally.no_data.notes()
        notes += self.tally.modes.notes()
        notes += self.tally.quality.notes()
        notes += self._notes_of_unknown_names()
        if second := self.grouping.second:
            pairs = list(second.items())[:5]
            shown = ", ".join(f"{tag} ({owner.signal} is {owner.tag})" for tag, owner in pairs)
            name = counted(len(second), "tag names a signal that its", "tags name a signal that their")
            notes.append(f"{name} loop has already; kept beside it: {shown}")
        notes += [f"{what}: {told(moves)}" for what, moves in self.grouping.settled.items()]
        if odd := self.grouping.with_controls:
            notes.append(f"control characters in names of tags were replaced: {', '.join(list(odd)[:5])}")
        if self.grouping.of_other_number:
            shown = ", ".join(self.grouping.of_other_number[:5])
            notes.append(f"of another number than PV and OP, and not read as set point or mode: {shown}")
        return notes

    def times_in_doubt(self) -> list[str]:
        """Of times that no name tells, and that rose in the first rows alone."""
        tally = self.tally
        assumed = isinstance(self.plan, WidePlan) and self.plan.times_assumed
        if not assumed or not tally.backward or tally.repeats <= SHARE_REPEATED * tally.rows_read:
            return []
        rows = f"{tally.repeats:,} of {tally.rows_read:,} rows have the time of a row before"
        return [f"what was read as times goes back and forth, and may be a signal: {rows}"]

    def _notes_of_unknown_names(self) -> list[str]:
        """Where no loop has a signal but others."""
        loops = self.grouping.loops()
        if any(loop.pv or loop.op or loop.sp for loop in loops):
            return []
        shown = ", ".join([tag for loop in loops for tag in loop.others[:5]][:25])
        if not shown:
            return ["of its loops the file has the mode alone"]
        notes = [f"no tag is named like PV, OP or SP of a loop, a mapping can say it; here is {shown}"]
        if any(_OF_INTERVALS.search(tag) for loop in loops for tag in loop.others):
            notes.append(
                "names end with Min, Max or Avg: such values are of intervals, in which sticking is not seen; needed "
                "are the samples themselves (raw values)"
            )
        return notes

    def _notes_of_times(self) -> list[str]:
        """How the times of the rows stood to each other, and which rows have none."""
        notes = []
        if self.tally.spread:
            notes.append(SPREAD_NOTE)
        notes += self.tally.set_back.notes(self.options.start_ns if self.plan.form.kind == "relative" else None)
        if self.tally.backward:
            notes.append("rows were not in order of time; they were sorted")
        if count := self.tally.in_other_order:
            exchanged = counted(
                count,
                "date fits with them exchanged alone and was",
                "dates fit with them exchanged alone and were",
            )
            notes.append(
                f"check this first, day and month stand in both orders: {exchanged} refused; those that fit in both "
                "orders may be months off"
            )
        if self.tally.lacks_half:
            notes.append("hours go to 12 and begin again: nothing tells AM from PM, and times may be wrong by 12 hours")
        if self.tally.without_date:
            rows = counted(self.tally.without_date, "row has", "rows have")
            notes.append(f"{rows} a clock without a date: that of a row above was taken")
        notes += self.tally.turns.notes()
        if self.tally.stuttering:
            notes.append(
                counted(
                    self.tally.stuttering,
                    "stamp repeated the one before; its row",
                    "stamps repeated the one before; their rows",
                )
                + " went into the missing step"
            )
        if self.tally.repeats:
            what = "the time of a row before; of each tag the last value of a time was taken"
            notes.append(f"{counted(self.tally.repeats, 'row has', 'rows have')} {what}")
            notes += self._hour_came_twice()
        if self.tally.comments:
            lines = counted(
                self.tally.comments, "line that begins with *, # or [ was", "lines that begin with *, # or [ were"
            )
            notes.append(f"{lines} passed over as comments")
        return notes

    def _hour_came_twice(self) -> list[str]:
        """Where a clock may have been put back in a zone that nobody named: in that one none is."""
        form, tally, zone = self.plan.form, self.tally, self.options.time_zone
        first, last = tally.first_time_ns, tally.last_time_ns
        twice = tally.backward or are_put_back(tally.repeated_ns, zone)
        local = form.kind in ("text", "serial") and not form.zone_in_file and twice
        if not local or first is None or last is None or puts_clocks_back(zone, first, last):
            return []
        if not may_come_twice(first, last, tally.rows_read, tally.repeats):
            return []
        read_as = f"they were read as those of {zone}"
        return [
            "an hour of rows came twice: if it is the one that a clock shows twice in autumn, name the zone of the "
            f"times ({read_as}), and both hours are kept"
        ]

    def _ahead_of_clock(self) -> list[str]:
        now_ns, last_ns = self.options.now_ns, self.tally.last_time_ns
        relative = self.plan.form.kind == "relative"
        if relative or now_ns is None or last_ns is None or last_ns <= now_ns + CLOCKS_APART_NS:
            return []
        last, now = (f"{datetime.fromtimestamp(at // NS_PER_S, UTC):%Y-%m-%d %H:%M}" for at in (last_ns, now_ns))
        by = _how_long(last_ns - now_ns)
        return [f"times go on until {last} UTC, ahead of the clock ({now} UTC) by {by}: are date, year and zone right?"]


def _how_long(time_ns: int) -> str:
    minutes = round(time_ns / (60 * NS_PER_S))
    if minutes < 90:
        return counted(minutes, "minute")
    hours = round(minutes / 60)
    return f"{hours} hours" if hours < 2 * 24 else f"{round(hours / 24)} days"


def mapping_notes(mapping: TagMapping | None, tags: Collection[str]) -> tuple[str, ...]:
    """What of a mapping is not in a file of these tags."""
    if mapping is None or not mapping.entries:
        return ()
    come = {tag.casefold() for tag in tags}
    loops = {entry.loop for entry in mapping.entries.values()}
    here = {entry.loop for name, entry in mapping.entries.items() if name in come}
    if not here:
        named = [entry.tag for entry in mapping.entries.values()][:5]
        shown = f"; here is {', '.join(list(tags)[:5])}, there {', '.join(named)}"
        return (f"the mapping names none of the tags of this file{shown}",) if tags else ()
    notes = []
    missing = [entry.tag for name, entry in mapping.entries.items() if entry.loop in here and name not in come]
    if missing:
        tags_missing = counted(len(missing), "mapped tag is", "mapped tags are")
        notes.append(f"of loops of the file {tags_missing} not in it: {', '.join(missing[:5])}")
    if absent := sorted(loops - here):
        # A plant's mapping beside a file of one unit is no mistake: names would only be noise.
        names = f": {', '.join(absent[:5])}" if len(absent) <= len(here) else ""
        of_all = counted(len(loops), "loop")
        notes.append(f"of the {of_all} of the mapping {counted(len(absent), 'is', 'are')} not in this file{names}")
    return tuple(notes)
