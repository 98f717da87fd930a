"""The first lines of a text export, split into fields: what the layouts look at to know their own."""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

from app.ingest.numbers.marks import before_decimals, other_mark
from app.ingest.numbers.units import without_unit

DELIMITERS = ("\t", ";", "|", ",")
HEAD_ROWS = 400
PREAMBLE_ROWS = 40  # within so many rows names or data begin
TAIL_ROWS = 150
HEAD_CHARACTERS = 1 << 20
MOST_BLANK = 8
_BLANK = "".join((*DELIMITERS, ' "\r'))
_LEAST_NAMES = 3
_TOLD_DELIMITER = re.compile(r"\s*\"?sep=.\"?\s*", re.IGNORECASE)  # to a spreadsheet; it names nothing
_MILLISECONDS = re.compile(r'(?:^|,)"?\d\d?:\d\d:\d\d;\d{3}"?,')  # as Logix marks them, in a field of clocks
_STAMP = re.compile(r"\d\D+\d+\D+\d")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_SURE = {mark: re.compile(before_decimals(mark, r"(?:[eE][+-]?\d+)?$")) for mark in ".,"}
_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")


@dataclass(frozen=True)
class Head:
    """The start of a file. `rows` are its lines, split at `delimiter`; `stem` is the file's name without suffixes.
    typed: they are not lines of text, but those of a table whose cells may be numbers. first_line: the number of the
    first one; 0 where it holds names that are in no row. sampled: the last ones are some of many from further down.
    blanks: before which rows how many blank lines were left out."""

    stem: str
    lines: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    delimiter: str
    decimal_mark: str
    typed: bool = False
    first_line: int = 1
    sampled: bool = False
    blanks: tuple[tuple[int, int], ...] = ()

    def in_file(self, index: int) -> int:
        """Which row of the file one of these is, both counted from 0."""
        return index + sum(count for before, count in self.blanks if before <= index)

    @cached_property
    def marks_told(self) -> bool:
        """Whether it is seen what stands before decimals: in 1,005 it is not. A point of 1.005 is taken for one where
        commas part the fields. Of cells that are numbers themselves, none was written."""
        if self.typed:
            return False
        rows = data_rows(self.rows)
        if any(_surely(text, self.decimal_mark) for row in rows for text in row):
            return True
        if self.delimiter != "," or self.decimal_mark == ",":
            return False
        return any("." in text and is_number(text) for row in rows for text in row)

    @property
    def thousands_mark(self) -> str:
        """What stands between thousands: the one of point and comma that does not stand before decimals. Empty where
        that is not told."""
        return other_mark(self.decimal_mark) if self.marks_told else ""

    def row(self, index: int) -> tuple[str, ...]:
        return self.rows[index] if index < len(self.rows) else ()

    def column(self, index: int, first_row: int) -> list[str]:
        """A column's fields that are not empty, from `first_row` on."""
        return [row[index] for row in self.rows[first_row:] if index < len(row) and row[index]]


def look(text: str, stem: str) -> Head:
    """Splits the text's first lines; the last one is left out where the text was cut inside it."""
    lines = text.split("\n")
    lines = lines[:-1] if len(lines) > 1 else lines
    lines[:1] = ["" if _TOLD_DELIMITER.fullmatch(line) else line for line in lines[:1]]
    lines, blanks = _without_long_blanks(lines)
    usual = sorted(map(len, lines))[len(lines) // 2] + 1
    lines = lines[: max(8, min(HEAD_ROWS, HEAD_CHARACTERS // usual))]
    delimiter = find_delimiter(lines)
    rows = tuple(_once(split_line(line, delimiter) for line in lines))
    return Head(stem, tuple(lines), rows, delimiter, find_decimal_mark(rows, delimiter), blanks=blanks)


def is_blank(line: str) -> bool:
    """Whether nothing stands in a line, be it parted into fields or not."""
    return not line.strip(_BLANK)


def _without_long_blanks(lines: list[str]) -> tuple[list[str], tuple[tuple[int, int], ...]]:
    """Lines, at most as many blank ones behind each other as a preamble may have, and before which of them there were
    how many more."""
    if sum(map(is_blank, lines[:HEAD_ROWS])) <= MOST_BLANK:
        return lines, ()  # as nearly all files
    kept: list[str] = []
    blanks: list[tuple[int, int]] = []
    for blank, run in groupby(lines, is_blank):
        own = list(run)
        kept += own[:MOST_BLANK] if blank else own
        if blank and len(own) > MOST_BLANK:
            blanks.append((len(kept), len(own) - MOST_BLANK))
    return kept, tuple(blanks)


def _once(rows: Iterable[tuple[str, ...]]) -> Iterator[tuple[str, ...]]:
    """Rows of names that come again, as on each page or before each series, as empty ones."""
    seen: set[tuple[str, ...]] = set()
    for row in rows:
        yield (len(row) * ("",)) if row in seen else row
        if sum(map(bool, row)) >= _LEAST_NAMES and not any(_may_be_number(cell) or _STAMP.search(cell) for cell in row):
            seen.add(row)


def with_tail(head: Head, text: str) -> Head:
    """A head whose second half are rows from the file's end: what the first day leaves open, the last one may tell."""
    rows = tuple(split_line(line, head.delimiter) for line in text.split("\n")[-TAIL_ROWS:] if line.strip())
    return with_rows(head, rows)


def with_samples(head: Head, texts: Sequence[str]) -> Head:
    """The same with rows from all over the file, its last ones among them: the first hundreds may be of one tag alone,
    and what was appended few."""
    parts = [[line for line in text.split("\n") if line.strip()] for text in texts]
    each = TAIL_ROWS // max(1, len(parts))
    taken = [part[:each] for part in parts]
    if parts and len(parts[-1]) > each:
        taken[-1] = [*parts[-1][: each // 2], *parts[-1][-(each - each // 2) :]]
    return with_rows(head, tuple(split_line(line, head.delimiter) for lines in taken for line in lines))


def with_rows(head: Head, rows: tuple[tuple[str, ...], ...]) -> Head:
    """With rows of further down in the place of the last ones."""
    kept = HEAD_ROWS - TAIL_ROWS
    return replace(head, lines=head.lines[:kept], rows=head.rows[:kept] + rows, sampled=True) if rows else head


def find_delimiter(lines: list[str]) -> str:
    """The character that stands equally often in most lines of data; a preamble counts little."""
    data = [line for line in lines[len(lines) // 4 :] if line.strip()] or lines
    best, best_share = ",", 0.0
    widths: dict[str, int] = {}
    for delimiter in DELIMITERS:
        counts = Counter(len(split_line(line, delimiter)) for line in data)
        widths[delimiter], times = counts.most_common(1)[0]
        share = times / len(data) if widths[delimiter] > 1 else 0.0
        if share > best_share + 0.2:
            best, best_share = delimiter, share
    if (
        best == ";"
        and widths[","] > widths[best] == 2
        and all(_MILLISECONDS.search(line) for line in data if ";" in line)
    ):
        return ","
    return "," if best in (";", "|") and _stands_in_fields(best, lines[0], widths) else best


def _stands_in_fields(delimiter: str, names: str, widths: Mapping[str, int]) -> bool:
    """Whether one stands inside fields that commas part, as in ns=2;s=FIC101.PV or CDU\\FIC101|PV: the names have none,
    and as many commas as the rows."""
    parted = split_line(names, ",")
    return delimiter not in names and all(parted) and len(parted) == widths[","] > max(widths[delimiter], 2)


def split_line(line: str, delimiter: str) -> tuple[str, ...]:
    if '"' not in line:
        return tuple(field.strip() for field in line.split(delimiter))
    try:
        return tuple(field.strip() for field in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True)))
    except (csv.Error, StopIteration):
        return tuple(field.strip() for field in line.split(delimiter))


def find_decimal_mark(rows: tuple[tuple[str, ...], ...], delimiter: str) -> str:
    commas = points = 0
    rows = data_rows(rows)
    for row in rows:
        for field in row:
            commas += _is_comma_number(field)
            points += "." in field and is_number(field)
    if delimiter == "," and commas <= 2:
        return "."
    if commas and points:  # those that tell more than that they have a mark go first
        sure_commas, sure_points = (sum(_surely(field, mark) for row in rows for field in row) for mark in ",.")
        if sure_commas != sure_points:
            return "," if sure_commas > sure_points else "."
        if delimiter == ",":
            return "."
    return "," if commas > points else "."


def data_rows(rows: tuple[tuple[str, ...], ...]) -> tuple[tuple[str, ...], ...]:
    """The rows from the first one on that has numbers where many have them: a version in a preamble is no value."""
    where = [tuple(column for column, text in enumerate(row) if _may_be_number(text)) for row in rows]
    times = Counter(columns for columns in where if columns)
    most = max(times.values(), default=0)
    for index, columns in enumerate(where[:PREAMBLE_ROWS]):
        if columns and 2 * times[columns] >= most:
            return rows[index:]
    return rows[PREAMBLE_ROWS:] or rows


def _may_be_number(text: str) -> bool:
    return is_number(text) or _is_comma_number(text)


def _surely(text: str, decimal_mark: str) -> bool:
    """Whether a number shows that the mark is the one before decimals."""
    return ("," in text or "." in text) and bool(_SURE[decimal_mark].match(without_unit(text)))


def _is_comma_number(text: str) -> bool:
    return "," in text and bool(_COMMA_NUMBER.fullmatch(without_unit(text)))


def is_number(text: str, decimal_mark: str = ".") -> bool:
    """Whether a field is a number, perhaps with its unit behind it."""
    if decimal_mark == ",":
        text = text.replace(",", ".")
    return bool(_NUMBER.fullmatch(text) or _NUMBER.fullmatch(without_unit(text)))
