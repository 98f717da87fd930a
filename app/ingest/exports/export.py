"""Exports: their blocks of signals or stretches of loops, what was refused, and what they hold."""

import re
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from datetime import UTC, datetime
from functools import partial
from types import MappingProxyType
from typing import Protocol

import polars as pl

from app.counting import counted
from app.errors import DataError
from app.ingest.align import stretches
from app.ingest.columns.plans import Plan, WidePlan
from app.ingest.exports.mixing import refuse_mixed
from app.ingest.exports.preparing import prepared
from app.ingest.files.head import Head
from app.ingest.model import FileSummary, IngestOptions, LoopSamples, Rejects, SignalBlock
from app.ingest.numbers.evidence import Evidence
from app.ingest.numbers.marks import DoubtfulMarks
from app.ingest.numbers.scale_jumps import ScaleJumps
from app.ingest.numbers.units import UnitsOfTags
from app.ingest.numbers.writing import Writing
from app.ingest.rejecting import RejectLog
from app.ingest.tables.frames import UNREADABLE, RowReader, in_short
from app.ingest.tables.long_table import LongTable
from app.ingest.tables.loop_rows_table import LoopRowsTable
from app.ingest.tables.spreading import SPREAD_NOTE
from app.ingest.tables.tally import Tally, UnsettledError
from app.ingest.tables.wide_table import WideTable
from app.ingest.tags.grouping import TagMapping
from app.ingest.tags.loops import Grouping, group
from app.ingest.tags.settling import told
from app.ingest.telling import without_controls
from app.ingest.times.read_once import puts_clocks_back
from app.ingest.times.stamps import TimeForm
from app.ingest.times.wall_clock import may_come_twice
from app.nanoseconds import NS_PER_S

CLOCKS_APART_NS = 15 * 60 * NS_PER_S
"""Of a historian and of this machine. Zones lie as far apart at least, but for what a file's last rows are old."""

_OF_INTERVALS = re.compile(r"(?i)[\s_.(\[-](min|max|avg|ave|mean|minimum|maximum|average)[)\]]?$")
SHARE_REPEATED = 0.1
"""Of the rows, above which times that run back and that no name tells are doubted."""


class Source(Protocol):
    """A table whose layout is known. `notes`: what was odd about it; `damage`: what of it was lost on its way here."""

    @property
    def plan(self) -> Plan: ...

    @property
    def head(self) -> Head: ...

    @property
    def encoding(self) -> str: ...

    @property
    def compressed(self) -> bool: ...

    @property
    def notes(self) -> list[str]: ...

    @property
    def share_taken(self) -> float: ...

    @property
    def damage(self) -> tuple[str, ...]: ...

    def reader(self, width: int, types: dict[int, pl.DataType], log: RejectLog) -> RowReader: ...


class Export(ABC):
    """One export file. Iterate it once, for blocks of signals, or take `loops()` once, for stretches of loops.

    `summary()` and `rejects()` tell what was found so far, and all of it when the iteration has ended.
    """

    stem: str

    @abstractmethod
    def __iter__(self) -> Iterator[SignalBlock]: ...

    @abstractmethod
    def loops(self) -> Iterator[LoopSamples]:
        """Each loop once, signals side by side. Memory is a few times that of `options.buffered_values` values, or of
        the largest loop."""

    @property
    def share_taken(self) -> float:
        """How much of the file, 0 to 1, has been read at the most; 1 where its kind does not tell."""
        return 1.0

    @abstractmethod
    def takes_its_name(self) -> bool:
        """Whether, as far as its first rows show, a loop or a tag is called by the name of the file."""

    @abstractmethod
    def bears_dates(self) -> bool:
        """Whether its times are instants, and not seconds from a start that it does not tell."""

    @abstractmethod
    def on_one_clock(self) -> bool:
        """Whether the times of its loops may be held against each other."""

    @abstractmethod
    def rejects(self) -> Rejects: ...

    @abstractmethod
    def doubts(self) -> tuple[str, ...]:
        """How numbers were read whose writing is in doubt."""

    @abstractmethod
    def times_assumed(self) -> tuple[str, ...]:
        """What was taken for times where no column is named so."""

    @abstractmethod
    def damage(self) -> tuple[str, ...]:
        """What of the file itself was lost on its way here."""

    @abstractmethod
    def summary(self) -> FileSummary: ...

    @abstractmethod
    def notes(self) -> tuple[str, ...]:
        """What is to be said of how the rows were read so far."""


class TableExport(Export):
    """An export of one table."""

    def __init__(self, source: Source, stem: str, mapping: TagMapping | None, options: IngestOptions) -> None:
        self._options = options
        self.stem = stem
        self._source = source
        self._mapping = mapping
        self._scale_jumps = ScaleJumps()
        self._taken = False
        self._begin(Tally(writing=self._writing()))

    def _begin(self, tally: Tally) -> None:
        """With nothing found yet but what is known before."""
        head = self._source.head
        self._tally = tally
        self._log = RejectLog(self._options.max_rejects)
        self._grouping = Grouping(head.stem, self._mapping)
        self._plan: Plan = prepared(self._source.plan, self._grouping, head, self._options, self._log)

    def _writing(self) -> Writing:
        head = self._source.head
        return Writing(head.thousands_mark, marks=DoubtfulMarks("thousands" if head.delimiter == "," else "decimals"))

    @property
    def share_taken(self) -> float:
        return self._source.share_taken

    def __iter__(self) -> Iterator[SignalBlock]:
        for batch in self._batches():
            yield from batch

    def loops(self) -> Iterator[LoopSamples]:
        for batch in self._batches():
            for block in batch:
                self._scale_jumps.look(block)
            yield from stretches(batch)

    def _batches(self) -> Iterator[list[SignalBlock]]:
        if self._taken:
            raise RuntimeError("an export is read once; open it again")
        self._taken = True
        try:
            for batch in self._settled():
                self._refuse_mixed()
                self._refuse_half_clock()
                yield batch
        except UNREADABLE as error:
            raise DataError("not_an_export", f"the file's rows cannot be read: {in_short(error)}") from error
        if not self._tally.rows_kept:
            rows = f"{self._tally.rows_read:,} rows"
            raise DataError("nothing_readable", f"none of {rows} has a readable time and values")

    def _settled(self) -> Iterator[list[SignalBlock]]:
        """Rows are read once more where the later ones told how the earlier ones are meant."""
        table = self._table(self._plan)
        try:
            yield from table.batches(self._reader(table, self._log))
        except UnsettledError:
            self._begin(self._known(table))
            table = self._table(self._plan)
            yield from table.batches(self._reader(table, self._log))

    def _reader(self, table: WideTable | LongTable, log: RejectLog) -> RowReader:
        return self._source.reader(self._plan.width, table.types(), log)

    def _known(self, table: WideTable | LongTable) -> Tally:
        """With what all rows tell."""
        read, writing = self._tally.writing, self._writing()
        if not read.is_settled(table.kinds()):
            evidence = Evidence(read.odd.union(read.marks.met()))
            table.tell(self._reader(table, RejectLog(0)), evidence)
            writing.learn_once(evidence)
        writing.units = UnitsOfTags(read.units.of_most())
        return Tally(writing=writing, quality=self._tally.quality.settled(), again=True)

    def _refuse_mixed(self) -> None:
        lines = self._tally.contradictions.lines_to_ask()
        if lines is not None:
            read = partial(self._source.reader, self._plan.width, log=RejectLog(0))
            refuse_mixed(self._plan, self._source.head, lines, read)

    def _refuse_half_clock(self) -> None:
        if self._tally.lacks_half and self._plan.form.hours_apart:
            raise DataError(
                "unknown_layout",
                "the hours, which stand in a column of their own, go to 12 and begin again, and nothing tells AM from "
                "PM; needed are hours from 0 to 23, or a column with AM or PM in each row",
            )

    def _table(self, plan: Plan) -> WideTable | LongTable:
        if isinstance(plan, WidePlan):
            return WideTable(plan, self._grouping, self._options, self._log, self._tally)
        table = LoopRowsTable if plan.signals else LongTable
        return table(plan, self._grouping, self._options, self._log, self._tally)

    def takes_its_name(self) -> bool:
        plan, head = self._plan, self._source.head
        if isinstance(plan, WidePlan):
            tags = [value.tag for timed in plan.groups for value in timed.values]
        else:
            tags = plan.tags_of(dict.fromkeys(head.column(plan.tag, plan.first_row)))
        loops = group(tags, self._mapping, head.stem)
        return any(self.stem in name for name in (*tags, *(loop.loop for loop in loops)))

    def bears_dates(self) -> bool:
        return "relative" not in {form.kind for _, form in self._times()}

    def on_one_clock(self) -> bool:
        """Seconds are of one start where they stand in one column: each loop may count its own from another."""
        return self.bears_dates() or len({column for column, _ in self._times()}) == 1

    def _times(self) -> Iterator[tuple[tuple[int, ...], TimeForm]]:
        plan = self._plan
        yield from ((part.time, part.form) for part in (plan.groups if isinstance(plan, WidePlan) else (plan,)))

    def rejects(self) -> Rejects:
        return self._log.result()

    def doubts(self) -> tuple[str, ...]:
        """How numbers were read whose writing is in doubt."""
        return tuple(self._tally.writing.doubts(self.tags()))

    def times_assumed(self) -> tuple[str, ...]:
        told = self._plan.times_assumed if isinstance(self._plan, WidePlan) else ""
        return (told, *self._times_in_doubt()) if told else ()

    def _times_in_doubt(self) -> list[str]:
        """Of times that no name tells, and that rose in the first rows alone."""
        tally = self._tally
        assumed = isinstance(self._plan, WidePlan) and self._plan.times_assumed
        if not assumed or not tally.backward or tally.repeats <= SHARE_REPEATED * tally.rows_read:
            return []
        rows = f"{tally.repeats:,} of {tally.rows_read:,} rows have the time of a row before"
        return [f"what was read as times goes back and forth, and may be a signal: {rows}"]

    def damage(self) -> tuple[str, ...]:
        """What of the file itself was lost on its way here."""
        return self._source.damage

    def summary(self) -> FileSummary:
        head, tally = self._source.head, self._tally
        return FileSummary(
            layout=self._plan.layout,
            encoding=self._source.encoding,
            delimiter=head.delimiter,
            decimal_mark=head.decimal_mark,
            time_format=self._plan.form.shown,
            time_zone=self._zone(),
            compressed=self._source.compressed,
            tags=self._grouping.tags,
            loops=self._grouping.loops(),
            rows_read=tally.rows_read,
            rows_kept=tally.rows_kept,
            values_kept=tally.values_kept,
            first_time_ns=tally.first_time_ns,
            last_time_ns=tally.last_time_ns,
            notes=(*self.notes(), *self.origin()),
            units=MappingProxyType(dict(self._units())),
        )

    def _units(self) -> Iterator[tuple[str, str]]:
        for timed in self._plan.groups if isinstance(self._plan, WidePlan) else ():
            yield from ((without_controls(value.tag), value.unit) for value in timed.values if value.unit)
        yield from self._tally.units.items()

    def _zone(self) -> str:
        form = self._plan.form
        if form.kind == "relative":
            return "none: relative times"
        return "in the file" if form.zone_in_file else self._options.time_zone

    def origin(self) -> tuple[str, ...]:
        """Which instant relative times were given: it matters where samples of several files come together."""
        if self._plan.form.kind != "relative":
            return ()
        start = f"{datetime.fromtimestamp(self._options.start_ns / NS_PER_S, UTC):%Y-%m-%d %H:%M:%S}"
        return (f"times are relative to a start that the file does not tell; 0 was taken for {start} UTC",)

    def tags(self) -> tuple[str, ...]:
        """That have come so far."""
        return self._grouping.placed

    def notes(self) -> tuple[str, ...]:
        return (*self.notes_of_rows(), *mapping_notes(self._mapping, self.tags()))

    def notes_of_rows(self) -> tuple[str, ...]:
        """All but those that tell what of the mapping is in the file."""
        notes = [*self._source.notes, *self._plan.notes, *self._plan.form.notes, *self._times_in_doubt()]
        notes += self._notes_of_times()
        notes += self._ahead_of_clock()
        notes += self._tally.writing.notes(self.tags())
        notes += self._scale_jumps.notes()
        if self._tally.wordy:
            shown = ", ".join(tag[:80] for tag in self._tally.wordy[:5]) + (
                ", ..." if len(self._tally.wordy) > 5 else ""
            )
            notes.append(f"columns that hold no number were left out: {shown}")
        notes += self._tally.no_data.notes()
        notes += self._tally.modes.notes()
        notes += self._tally.quality.notes()
        notes += self._notes_of_unknown_names()
        if second := self._grouping.second:
            pairs = list(second.items())[:5]
            shown = ", ".join(f"{tag} ({owner.signal} is {owner.tag})" for tag, owner in pairs)
            name = counted(len(second), "tag names a signal that its", "tags name a signal that their")
            notes.append(f"{name} loop has already; kept beside it: {shown}")
        notes += [f"{what}: {told(moves)}" for what, moves in self._grouping.settled.items()]
        if odd := self._grouping.with_controls:
            notes.append(f"control characters in names of tags were replaced: {', '.join(list(odd)[:5])}")
        if self._grouping.of_other_number:
            shown = ", ".join(self._grouping.of_other_number[:5])
            notes.append(f"of another number than PV and OP, and not read as set point or mode: {shown}")
        return tuple(notes)

    def _notes_of_unknown_names(self) -> list[str]:
        """Where no loop has a signal but others."""
        loops = self._grouping.loops()
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
        if self._tally.spread:
            notes.append(SPREAD_NOTE)
        if self._tally.backward:
            notes.append("rows were not in order of time; they were sorted")
        if count := self._tally.in_other_order:
            exchanged = counted(
                count,
                "date fits with them exchanged alone and was",
                "dates fit with them exchanged alone and were",
            )
            notes.append(
                f"check this first, day and month stand in both orders: {exchanged} refused; those that fit in both "
                "orders may be months off"
            )
        if self._tally.lacks_half:
            notes.append("hours go to 12 and begin again: nothing tells AM from PM, and times may be wrong by 12 hours")
        if self._tally.without_date:
            rows = counted(self._tally.without_date, "row has", "rows have")
            notes.append(f"{rows} a clock without a date: that of a row above was taken")
        notes += self._tally.turns.notes()
        if self._tally.stuttering:
            notes.append(
                counted(
                    self._tally.stuttering,
                    "stamp repeated the one before; its row",
                    "stamps repeated the one before; their rows",
                )
                + " went into the missing step"
            )
        if self._tally.repeats:
            what = "the time of a row before; of each tag the last value of a time was taken"
            notes.append(f"{counted(self._tally.repeats, 'row has', 'rows have')} {what}")
            notes += self._hour_came_twice()
        if self._tally.comments:
            lines = counted(
                self._tally.comments, "line that begins with *, # or [ was", "lines that begin with *, # or [ were"
            )
            notes.append(f"{lines} passed over as comments")
        return notes

    def _hour_came_twice(self) -> list[str]:
        """Where a clock may have been put back in a zone that nobody named: in that one none is."""
        form, tally, zone = self._plan.form, self._tally, self._options.time_zone
        first, last = tally.first_time_ns, tally.last_time_ns
        local = form.kind in ("text", "serial") and not form.zone_in_file and tally.backward
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
        now_ns, last_ns = self._options.now_ns, self._tally.last_time_ns
        relative = self._plan.form.kind == "relative"
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
