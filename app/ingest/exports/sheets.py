"""The sheets of a workbook as one export: each is read by itself, one after the other."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import chain
from types import MappingProxyType
from typing import TypeVar

from app.errors import DataError
from app.ingest.align import stretches
from app.ingest.exports.export import Export, TableExport
from app.ingest.exports.notes import mapping_notes
from app.ingest.exports.workbooks import ReadSheets
from app.ingest.model import FileSummary, IngestOptions, LoopSamples, LoopTags, Reject, Rejects, SignalBlock
from app.ingest.tags.grouping import TagMapping

Part = TypeVar("Part", SignalBlock, LoopSamples)
NOT_READ = "sheet_not_read"


class SheetsExport(Export):
    """A loop is that of the first sheet that has it, unless its signals are on several. A sheet whose rows cannot be
    read is refused, the others are read."""

    def __init__(self, book: ReadSheets, stem: str, mapping: TagMapping | None, options: IngestOptions) -> None:
        self.stem = stem
        self._together = book.together
        self._notes, self._mapping, self._max_rejects = book.notes, mapping, options.max_rejects
        self._sheets = {name: TableExport(sheet, stem, mapping, options) for name, sheet in book.sheets.items()}
        self._errors: dict[str, DataError] = {}
        self._owners: dict[str, str] = {}  # of loops, by their casefolded names
        self._left_out: dict[str, None] = {}

    def __iter__(self) -> Iterator[SignalBlock]:
        return self._each(iter)

    def loops(self) -> Iterator[LoopSamples]:
        return stretches(self) if self._together else self._each(TableExport.loops)

    def _each(self, parts: Callable[[TableExport], Iterator[Part]]) -> Iterator[Part]:
        for name, sheet in self._sheets.items():
            try:
                yield from (part for part in parts(sheet) if self._is_of(name, part.loop))
            except DataError as error:
                self._errors[name] = error
        if len(self._errors) == len(self._sheets):
            raise next(iter(self._errors.values()))

    def _is_of(self, sheet: str, loop: str) -> bool:
        own = self._together or self._owners.setdefault(loop.casefold(), sheet) == sheet
        if not own:
            self._left_out[loop] = None
        return own

    def takes_its_name(self) -> bool:
        return any(sheet.takes_its_name() for sheet in self._sheets.values())

    def bears_dates(self) -> bool:
        return all(sheet.bears_dates() for sheet in self._sheets.values())

    def on_one_clock(self) -> bool:
        sheets = self._sheets.values()
        return self.bears_dates() or (len(sheets) == 1 and all(s.on_one_clock() for s in sheets))

    def rejects(self) -> Rejects:
        each = {name: sheet.rejects() for name, sheet in self._sheets.items()}
        counts = sum((Counter(rejects.counts) for rejects in each.values()), Counter[str]())
        listed = [Reject(None, NOT_READ, f"{_sheet(name)}: {error.message}") for name, error in self._errors.items()]
        counts.update({NOT_READ: len(listed)} if listed else {})
        listed += [
            replace(reject, text=f"{_sheet(name)}: {reject.text}") if len(each) > 1 else reject
            for name, rejects in each.items()
            for reject in rejects.listed
        ]
        return Rejects(MappingProxyType(dict(counts)), tuple(listed[: self._max_rejects]))

    def doubts(self) -> tuple[str, ...]:
        return self._of_sheets(TableExport.doubts)

    def times_assumed(self) -> tuple[str, ...]:
        return self._of_sheets(TableExport.times_assumed)

    def damage(self) -> tuple[str, ...]:
        errors = (f"{_sheet(name)} was not read: {error.message}" for name, error in self._errors.items())
        return (*self._of_sheets(TableExport.damage), *errors)

    def notes(self) -> tuple[str, ...]:
        tags = list(chain.from_iterable(sheet.tags() for sheet in self._sheets.values()))
        told = self._of_sheets(TableExport.notes_of_rows)
        twice = ", ".join(list(self._left_out)[:5])
        again = (f"read from the first sheet that has them, and not from further ones: {twice}",) if twice else ()
        return (*self._notes, *again, *told, *mapping_notes(self._mapping, tags))

    def _of_sheets(self, said: Callable[[TableExport], tuple[str, ...]]) -> tuple[str, ...]:
        """What is said of each sheet; once where it is said of all."""
        notes: dict[str, list[str]] = {}
        for name, sheet in self._sheets.items():
            for note in said(sheet):
                notes.setdefault(note, []).append(name)
        return tuple(
            note if len(names) == len(self._sheets) else f"{', '.join(map(_sheet, names))}: {note}"
            for note, names in notes.items()
        )

    def summary(self) -> FileSummary:
        each = [sheet.summary() for sheet in self._sheets.values()]
        firsts = [part.first_time_ns for part in each if part.first_time_ns is not None]
        lasts = [part.last_time_ns for part in each if part.last_time_ns is not None]
        return replace(
            each[0],
            layout=_joined(part.layout for part in each),
            time_format=_joined(part.time_format for part in each),
            time_zone=_joined(part.time_zone for part in each),
            tags=sum(part.tags for part in each),
            loops=_once(chain.from_iterable(part.loops for part in each), self._together),
            rows_read=sum(part.rows_read for part in each),
            rows_kept=sum(part.rows_kept for part in each),
            values_kept=sum(part.values_kept for part in each),
            first_time_ns=min(firsts, default=None),
            last_time_ns=max(lasts, default=None),
            notes=(*self.notes(), *self._of_sheets(TableExport.origin)),
            units=MappingProxyType({tag: unit for part in reversed(each) for tag, unit in part.units.items()}),
        )


def _once(loops: Iterable[LoopTags], together: bool) -> tuple[LoopTags, ...]:
    """The first of each name; together: with what it has not from further ones."""
    found: dict[str, LoopTags] = {}
    for loop in loops:
        first = found.setdefault(loop.loop.casefold(), loop)
        if not together:
            continue
        given = {signal: getattr(first, signal) or getattr(loop, signal) for signal in ("pv", "op", "sp", "mode")}
        others = tuple(dict.fromkeys((*first.others, *loop.others)))
        found[loop.loop.casefold()] = replace(first, **given, others=others)
    return tuple(found.values())


def _sheet(name: str) -> str:
    return f"sheet {name[:80]!r}"


def _joined(texts: Iterator[str]) -> str:
    return ", ".join(dict.fromkeys(texts))
