"""Workbooks: which of their sheets hold loops, one sheet after the other in memory."""

import zipfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import polars as pl

from app.errors import DataError
from app.ingest.columns.plans import WidePlan, name_of
from app.ingest.exports.tables_in import Table, TableSource
from app.ingest.layouts import NotRecognised
from app.ingest.model import IngestOptions
from app.ingest.tables.frames import in_short
from app.ingest.tags.grouping import TagMapping, place
from app.ingest.tags.loops import group
from app.ingest.telling import first_of

WORKBOOK_BYTES = 1 << 30  # what is asked of a sheet is found in a workbook unpacked
_SHOWN = 10


class Workbook:
    """Its sheets as tables. The cells of one are held, of the one that was asked for last."""

    def __init__(self, path: Path) -> None:
        try:
            import fastexcel
        except ImportError as error:
            raise DataError(
                "excel_not_installed", "reading workbooks needs the extra 'excel': pip install loopaudit[excel]"
            ) from error
        self._faults = fastexcel.FastExcelError
        try:
            self._book: Any = fastexcel.read_excel(path)
        except self._faults as error:
            raise _unreadable(error) from error
        self.names: list[str] = self._book.sheet_names
        self.hidden: set[int] = set()  # of the sheets that were asked for
        self._held: tuple[int, pl.DataFrame] = (-1, pl.DataFrame())

    def sheet(self, number: int) -> Table:
        """Raises DataError where it cannot be read."""
        frame = self._frame(number)

        def part(offset: int, count: int, columns: Sequence[int]) -> pl.DataFrame:
            return self._frame(number).slice(offset, count).select(name_of(i) for i in columns)

        return Table(frame.width, frame.height, (), part)

    def _frame(self, number: int) -> pl.DataFrame:
        if self._held[0] != number:
            self._held = (-1, pl.DataFrame())
            frame = self._cells(number, "string")
            if small := [index for index, column in enumerate(frame) if _is_small(column)]:
                numbers = self._cells(number, "float", set(small))
                names = [name_of(index) for index in small]
                frame = frame.with_columns(map(_in_full, frame.select(names), numbers))
            self._held = (number, frame)
        return self._held[1]

    def _cells(self, number: int, kind: str, columns: Collection[int] | None = None) -> pl.DataFrame:
        """Raises DataError where the sheet cannot be read."""
        # As numbers they would count from the sheet's own column A, which may be empty.
        asked = None if columns is None else lambda column: column.index in columns
        try:
            sheet = self._book.load_sheet(number, header_row=None, dtypes=kind, use_columns=asked)
            frame: pl.DataFrame = sheet.to_polars()
        except self._faults as error:
            raise _unreadable(error) from error
        if sheet.visible != "visible":
            self.hidden.add(number)
        frame.columns = [name_of(index) for index in (range(frame.width) if columns is None else sorted(columns))]
        return frame


@dataclass(frozen=True)
class ReadSheets:
    """By their names, and what is to be said of the others. together: the signals of a loop are on several of them."""

    sheets: Mapping[str, TableSource]
    notes: tuple[str, ...]
    together: bool = False


def _is_small(cells: pl.Series) -> bool:
    """Whether most numbers of a column are below 1: as text, cells have nine decimals at most, which of 7.323844e-08
    leave 7.3e-08."""
    middle = cells.cast(pl.Float64, strict=False).abs().median()
    return isinstance(middle, float) and middle < 1.0


def _in_full(cells: pl.Series, numbers: pl.Series) -> pl.Series:
    """Cells that lost digits with all of them; a mode of 1 does not become one of 1.0."""
    lost = (cells.cast(pl.Float64, strict=False) != numbers).fill_null(False)
    return numbers.cast(pl.String).zip_with(lost, cells).alias(cells.name)


def _unreadable(error: Exception) -> DataError:
    return DataError("not_an_export", f"the workbook cannot be read: {in_short(error)}")


def open_workbook(path: Path, stem: str, mapping: TagMapping | None, options: IngestOptions) -> ReadSheets | None:
    """The sheets that are read, or None where the file is no workbook: all that have PV and OP of loops, by the
    mapping or by themselves, that no sheet before them has. Else those that have them together, or the first with a
    layout that is known: a cover with dates or a pivot table may stand before it. Loops without a name are called after
    their sheets where several are.

    Raises DataError where no sheet has a layout that is known.
    """
    if not _is_workbook(path, options):
        return None
    book = Workbook(path)
    known, faults = _known(book, stem, options)
    if not known:
        raise next(iter(faults.values()), None) or DataError("unknown_layout", "no sheet of the workbook has cells")
    _call_tags(known, stem)
    loops = {name: _loops(source.tags(), mapping, stem) for name, source in known.items()}
    nameless = [name for name, own in loops.items() if stem.casefold() in own]
    if len(nameless) > 1:
        for name in nameless:
            known[name].call(name)
            loops[name] = _loops(known[name].tags(), mapping, name)
    read, left = _parted(known, loops)
    parts = {} if read else _in_parts(known, mapping, stem)
    read = read or parts or dict([next(iter(known.items()))])
    named = {name: error for name, error in faults.items() if not isinstance(error, NotRecognised) or error.named}
    left += [f"{name[:80]!r} was not read: {error.message}" for name, error in named.items()]
    return ReadSheets(read, _told(len(book.names), read, left), together=bool(parts))


def _is_workbook(path: Path, options: IngestOptions) -> bool:
    with path.open("rb") as stream:
        if stream.read(4) != b"PK\x03\x04":
            return False
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
    except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError):
        return False
    if not any(entry.filename.startswith("xl/") for entry in entries):
        return False
    unpacked = sum(entry.file_size for entry in entries)
    if unpacked > min(WORKBOOK_BYTES, options.max_bytes):
        raise DataError("decompressed_too_large", f"the workbook unpacks to {unpacked:,} bytes; send it as CSV")
    return True


def _known(book: Workbook, stem: str, options: IngestOptions) -> tuple[dict[str, TableSource], dict[str, DataError]]:
    """The sheets whose layout is known, those that are seen first, and what is wrong with others that have cells."""
    known: dict[str, TableSource] = {}
    faults: dict[str, DataError] = {}
    for number, name in enumerate(book.names):
        try:
            table = book.sheet(number)
            if table.height and table.width:
                known[name] = TableSource(table, stem, "xlsx", True, options)
        except DataError as error:
            faults[name] = error
    hidden = {book.names[number] for number in book.hidden}
    return {name: known[name] for name in sorted(known, key=hidden.__contains__)}, faults


def _call_tags(known: dict[str, TableSource], stem: str) -> None:
    """Sheets of a tag each are called by it; one alone may have any name."""
    wide = {name: source for name, source in known.items() if isinstance(source.plan, WidePlan)}
    of_a_tag = [name for name, source in wide.items() if source.tags()[:1] == [stem]]
    for name in of_a_tag:
        if len(of_a_tag) > 1 or place(name, "").signal != "OTHER":
            known[name].call(name)


def _loops(tags: list[str], mapping: TagMapping | None, stem: str) -> set[str]:
    return {loop.loop.casefold() for loop in group(tags, mapping, stem) if loop.pv and loop.op}


def _parted(known: dict[str, TableSource], loops: dict[str, set[str]]) -> tuple[dict[str, TableSource], list[str]]:
    """The sheets that are read, and why others with loops are not."""
    read: dict[str, TableSource] = {}
    left: list[str] = []
    owners: dict[str, str] = {}
    for name, own in loops.items():
        before = next((owners[loop] for loop in sorted(own) if loop in owners), None)
        if before is not None:
            left.append(f"{name[:80]!r} has loops of {before[:80]!r} and was not read: send it as a file of its own")
        elif own:
            read[name] = known[name]
            owners |= dict.fromkeys(own, name)
    return read, left


def _in_parts(known: dict[str, TableSource], mapping: TagMapping | None, stem: str) -> dict[str, TableSource]:
    """The sheets with loops that no sheet has whole: a sheet a tag or a signal. None where a tag is on two of them."""
    tags = {name: source.tags() for name, source in known.items()}
    everywhere = list(chain.from_iterable(tags.values()))
    if len(set(everywhere)) < len(everywhere):
        return {}
    whole = _loops(everywhere, mapping, stem) - {stem.casefold()}
    loops = {name: {loop.loop.casefold() for loop in group(own, mapping, stem)} for name, own in tags.items()}
    return {name: source for name, source in known.items() if not whole.isdisjoint(loops[name])}


def _told(count: int, read: Collection[str], left: list[str]) -> tuple[str, ...]:
    if count < 2:
        return ()
    shown = first_of([repr(name[:80]) for name in read], _SHOWN)
    what = f"the one read is {shown}" if len(read) == 1 else f"{len(read)} of them were read: {shown}"
    return (f"the workbook has {count} sheets; {what}", *left[:_SHOWN])
