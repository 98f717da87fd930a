"""Exports: their blocks of signals or stretches of loops, what was refused, and what they hold."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import partial
from types import MappingProxyType
from typing import Protocol

import polars as pl

from app.errors import DataError
from app.ingest.align import stretches
from app.ingest.columns.plans import Plan, WidePlan
from app.ingest.columns.quality import as_mapped, judged_by
from app.ingest.exports.mixing import refuse_mixed
from app.ingest.exports.notes import NotesOfRows, mapping_notes
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
from app.ingest.tables.tally import Tally, UnsettledError
from app.ingest.tables.wide_table import WideTable
from app.ingest.tags.grouping import TagMapping
from app.ingest.tags.loops import Grouping, group
from app.ingest.telling import without_controls
from app.ingest.times.stamps import TimeForm
from app.nanoseconds import NS_PER_S

OF_DECIMAL_COMMAS = "%d.%m."
"""Dates with points between day and month: where they are written so, no comma parts thousands."""


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
        plan = judged_by(as_mapped(self._source.plan, self._is_mapped, head), tally.judging)
        self._plan: Plan = prepared(plan, self._grouping, head, self._options, self._log)

    def _is_mapped(self, name: str) -> bool:
        """To a signal of a loop."""
        entry = self._mapping.find(name) if self._mapping else None
        return entry is not None and entry.signal != "OTHER"

    def _writing(self) -> Writing:
        head = self._source.head
        commas = head.delimiter == "," and not self._source.plan.form.format.startswith(OF_DECIMAL_COMMAS)
        return Writing(head.thousands_mark, marks=DoubtfulMarks("thousands" if commas else "decimals"))

    @property
    def share_taken(self) -> float:
        return self._source.share_taken

    def __iter__(self) -> Iterator[SignalBlock]:
        for batch in self._batches():
            yield from batch

    def loops(self) -> Iterator[LoopSamples]:
        for batch in self._batches():
            for block in batch:
                self._scale_jumps.look(block, self._tally.writing.units.in_per_cent(block.tag))
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
        """Rows are read once more where the later ones told how the earlier ones are meant. What was held of them is
        let go before: the error has it."""
        table = self._table(self._plan)
        try:
            yield from table.batches(self._reader(table, self._log))
            return
        except UnsettledError:
            pass
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
        late = table.late_qualities() if isinstance(table, WideTable) else frozenset()
        return Tally(writing=writing, quality=self._tally.quality.settled(), again=True, judging=late)

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
        return (told, *self._found().times_in_doubt()) if told else ()

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
        return (*self._source.notes, *self._found().all())

    def _found(self) -> NotesOfRows:
        return NotesOfRows(self._plan, self._tally, self._grouping, self._scale_jumps, self._options)
