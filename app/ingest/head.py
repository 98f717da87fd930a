"""The first lines of a text export, split into fields: what the layouts look at to know their own."""

import csv
import re
from collections import Counter
from dataclasses import dataclass, replace

from app.ingest.units import without_unit

DELIMITERS = ("\t", ";", "|", ",")
HEAD_ROWS = 400
TAIL_ROWS = 150
HEAD_CHARACTERS = 1 << 20
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")


@dataclass(frozen=True)
class Head:
    """The start of a file. `rows` are its lines, split at `delimiter`; `stem` is the file's name without suffixes."""

    stem: str
    lines: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    delimiter: str
    decimal_mark: str

    @property
    def thousands_mark(self) -> str:
        """What stands between thousands: the one of point and comma that is not seen before decimals. Empty where
        neither is seen there: 1,005 may be either."""
        if self.decimal_mark == ",":
            return "."
        return "," if any("." in text and is_number(text) for row in self.rows for text in row) else ""

    def row(self, index: int) -> tuple[str, ...]:
        return self.rows[index] if index < len(self.rows) else ()

    def column(self, index: int, first_row: int) -> list[str]:
        """A column's fields that are not empty, from `first_row` on."""
        return [row[index] for row in self.rows[first_row:] if index < len(row) and row[index]]


def look(text: str, stem: str) -> Head:
    """Splits the text's first lines; the last one is left out where the text was cut inside it."""
    lines = text.split("\n")
    lines = lines[:-1] if len(lines) > 1 else lines
    usual = sorted(map(len, lines))[len(lines) // 2] + 1
    lines = lines[: max(8, min(HEAD_ROWS, HEAD_CHARACTERS // usual))]
    delimiter = find_delimiter(lines)
    rows = tuple(split_line(line, delimiter) for line in lines)
    return Head(stem, tuple(lines), rows, delimiter, find_decimal_mark(rows, delimiter))


def with_tail(head: Head, text: str) -> Head:
    """A head whose second half are rows from the file's end: what the first day leaves open, the last one may tell."""
    rows = tuple(split_line(line, head.delimiter) for line in text.split("\n")[-TAIL_ROWS:] if line.strip())
    kept = HEAD_ROWS - TAIL_ROWS
    return replace(head, lines=head.lines[:kept], rows=head.rows[:kept] + rows)


def find_delimiter(lines: list[str]) -> str:
    """The character that stands equally often in most lines of data; a preamble counts little."""
    data = [line for line in lines[len(lines) // 4 :] if line.strip()] or lines
    best, best_share = ",", 0.0
    for delimiter in DELIMITERS:
        counts = Counter(len(split_line(line, delimiter)) for line in data)
        width, times = counts.most_common(1)[0]
        share = times / len(data) if width > 1 else 0.0
        if share > best_share + 0.2:
            best, best_share = delimiter, share
    return best


def split_line(line: str, delimiter: str) -> tuple[str, ...]:
    if '"' not in line:
        return tuple(field.strip() for field in line.split(delimiter))
    try:
        return tuple(field.strip() for field in next(csv.reader([line], delimiter=delimiter)))
    except (csv.Error, StopIteration):
        return tuple(field.strip() for field in line.split(delimiter))


def find_decimal_mark(rows: tuple[tuple[str, ...], ...], delimiter: str) -> str:
    if delimiter == ",":
        quoted = sum(_is_comma_number(field) for row in rows for field in row)
        return "," if quoted > 2 and quoted > sum("." in f for row in rows for f in row if is_number(f)) else "."
    commas = points = 0
    for row in rows:
        for field in row:
            commas += _is_comma_number(field)
            points += "." in field and is_number(field)
    return "," if commas > points else "."


def _is_comma_number(text: str) -> bool:
    return bool(_COMMA_NUMBER.fullmatch(without_unit(text)))


def is_number(text: str, decimal_mark: str = ".") -> bool:
    """Whether a field is a number, perhaps with its unit behind it."""
    number = without_unit(text)
    return bool(_NUMBER.fullmatch(number.replace(",", ".") if decimal_mark == "," else number))
