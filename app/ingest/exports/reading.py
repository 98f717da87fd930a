"""An export file, opened: which kind of file it is."""

import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import polars as pl

from app.errors import DataError
from app.ingest.columns.further_down import may_part_rows_below
from app.ingest.columns.plans import Plan
from app.ingest.exports.export import Export, TableExport
from app.ingest.exports.matlab import open_matlab
from app.ingest.exports.sheets import SheetsExport
from app.ingest.exports.tables_in import open_parquet
from app.ingest.exports.workbooks import open_workbook
from app.ingest.files.head import Head, look, split_line, with_samples, with_tail
from app.ingest.files.matlab_values import is_matlab
from app.ingest.files.opening import MOST_ROWS, TextFile
from app.ingest.files.unpacking import GZIP
from app.ingest.layouts import not_recognised, recognise, recognise_again
from app.ingest.model import IngestOptions
from app.ingest.rejecting import RejectLog
from app.ingest.tables.frames import UNREADABLE, Dialect, FrameReader, in_short
from app.ingest.tags.grouping import TagMapping
from app.ingest.times.stamps import check_time_zone

_NO_TEXT = (GZIP, b"PK\x03\x04", b"PAR1")
_NO_NAME = "\ue000\ue001"  # of private letters
_JSON = re.compile(r'\s*(\[\s*)*(\{\s*"|\[\s*[\["\d])')
_MARKUP = re.compile(r"(?i)\s*<(\?xml|!doctype|html|table|meta|style)\b")
_LINE_PROTOCOL = re.compile(r"[^\s,=]+(?:,[^\s,=]+=[^\s,=]+)* [^\s,=]+=[^\s,=]+(?:,[^\s,=]+=[^\s,=]+)* \d{10,19}")
_MOST_LINES, _SHOWN = 0.8, 1 << 14  # share of the lines, and characters that are looked at
SUFFIXES = (
    *(".csv", ".tsv", ".txt", ".tab", ".dat", ".asc", ".lvm"),
    *(".parquet", ".pq", ".xls", ".xlsx", ".xlsm", ".xlsb", ".mat", ".gz"),
)
"""Those in which one of the forms comes that are read; what historians call .xls is text or an old workbook, which is
refused with a word."""


class TextSource:
    """A text file whose layout is known."""

    def __init__(self, file: TextFile, plan: Plan, head: Head, compressed: bool) -> None:
        self._file = file
        self.plan = plan
        self.head = head
        self.compressed = compressed

    @property
    def encoding(self) -> str:
        return self._file.encoding

    @property
    def share_taken(self) -> float:
        return self._file.share_taken

    @property
    def notes(self) -> list[str]:
        return self._file.notes

    @property
    def damage(self) -> tuple[str, ...]:
        """All that a text file has to note by itself."""
        return tuple(self._file.notes)

    def reader(self, width: int, types: dict[int, pl.DataType], log: RejectLog) -> FrameReader:
        head = self.head
        dialect = Dialect(head.delimiter, head.decimal_mark, width, head.marks_told, self.plan.ends)
        return FrameReader(self._file, dialect, types, log, head.in_file)


def _open_text(path: Path, stem: str, options: IngestOptions) -> TextSource:
    file = TextFile(path, options)
    head = look(file.head, stem)
    plan = recognise(head, options)
    if plan is not None and plan.form.rivals:
        plan = recognise(with_tail(head, file.tail()), options) or plan
    if plan is not None and may_part_rows_below(plan, head):
        start = sum(len(line.encode()) + 1 for line in head.lines)
        every = partial(_fields, file, head)
        plan = recognise_again(plan, with_samples(head, file.samples(start)), options, every)
    if plan is None:
        _refuse_other_text(file.head)
        raise not_recognised(head)
    return TextSource(file, plan, head, file.compressed)


def _fields(file: TextFile, head: Head, columns: Sequence[int]) -> list[tuple[str, ...]]:
    """Those of some columns in all rows that have them; none where there are too many rows."""
    found: list[tuple[str, ...]] = []
    for lines in file.chunks():
        if len(found) > MOST_ROWS:
            return []
        rows = (split_line(line, head.delimiter) for line in lines.data.decode("utf-8", "replace").split("\n"))
        found += [tuple(row[at] for at in columns) for row in rows if len(row) > max(columns)]
    return found


def _refuse_other_text(head: str) -> None:
    kind = "JSON" if _JSON.match(head) else "XML or HTML" if _MARKUP.match(head) else ""
    kind = kind or ("InfluxDB line protocol" if _is_line_protocol(head) else "")
    if kind:
        raise DataError(
            "not_an_export", f"this is {kind}, which is not read; CSV or TSV text, parquet or xlsx is needed"
        )


def _is_line_protocol(head: str) -> bool:
    lines = head[:_SHOWN].rpartition("\n")[0].split("\n")
    return sum(bool(_LINE_PROTOCOL.fullmatch(line)) for line in lines) >= max(1.0, _MOST_LINES * len(lines))


def is_export_name(name: str) -> bool:
    """Whether a file of a folder is taken for an export by its name; hidden ones never are."""
    return name.lower().removesuffix(".gz").endswith(SUFFIXES) and not name.startswith(".")


def is_read_packed(start: bytes) -> bool:
    """Whether a file that begins so, by its first 128 bytes, is read in the same way inside of a gzip file: text alone
    is looked for there."""
    return not start.startswith(_NO_TEXT) and not is_matlab(start)


def stem_of(name: str) -> str:
    """A file's name without its folder and the suffixes of exports: a tag's own dots stay."""
    stem = name.replace("\\", "/").rsplit("/", 1)[-1]
    for _ in range(2):
        suffix = next((suffix for suffix in SUFFIXES if stem.lower().endswith(suffix) and len(stem) > len(suffix)), "")
        stem = stem[: len(stem) - len(suffix)] if suffix else stem
    return stem


def read_export(
    path: Path, *, filename: str | None = None, mapping: TagMapping | None = None, options: IngestOptions | None = None
) -> Export:
    """Opens an export: finds out what it is, reads nothing further yet.

    filename: the name that the user gave the file, where it is stored under another one.
    Raises DataError where the file is no export or its layout is unknown (now), or where it turns out so later (while
    iterating).
    """
    options = options or IngestOptions()
    check_time_zone(options.time_zone)
    try:
        return _opened(path, stem_of(filename or path.name), mapping, options)
    except UNREADABLE as error:
        raise DataError("not_an_export", f"the file cannot be read: {in_short(error)}") from error


def takes_its_name(path: Path, mapping: TagMapping | None = None) -> bool:
    """Whether a file is read otherwise under another name, because its content does not name its loops; False where it
    cannot be read."""
    try:
        return read_export(path, filename=_NO_NAME, mapping=mapping).takes_its_name()
    except DataError:
        return False


def _opened(path: Path, stem: str, mapping: TagMapping | None, options: IngestOptions) -> Export:
    book = open_workbook(path, stem, mapping, options)
    if book is not None:
        return SheetsExport(book, stem, mapping, options)
    source = open_parquet(path, stem, options) or open_matlab(path, stem, options) or _open_text(path, stem, options)
    return TableExport(source, stem, mapping, options)
