"""Lists that a plant keeps in spreadsheets, of its tags or its loops: the bytes of a CSV into rows of named cells."""

import csv
import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from app.errors import DataError
from app.ingest.files.opening import detect_encoding
from app.ingest.numbers.marks import before_decimals

DELIMITERS = ",;\t"
BEYOND = "beyond the names"
KEYS = {"tag", "loop"}
"""Columns of which every list has one: what parts its name from others parts the cells."""
MAY_PART_THOUSANDS = "whose mark may part thousands; write it without one, or with other than three decimals"

_END_OF_FILE = "\x1a"
_EITHER_WAY = re.compile(r"[+-]?[1-9]\d{0,2}([.,])\d{3}", re.ASCII)  # one and a half, or a thousand and a half
_SHOWN = {mark: re.compile(before_decimals(mark, "$"), re.ASCII) for mark in ".,"}
_SAID_DELIMITER = re.compile(r"(?i)\Asep=([,;|\t])[ \t\r]*\n")


@dataclass(frozen=True)
class Listed:
    """rows: each row's cells by their names, blank rows left out, with the number of its row (the names have 1).
    delimiter: what parts cells.
    """

    rows: list[tuple[int, dict[str, str]]]
    delimiter: str

    @cached_property
    def marks(self) -> set[str]:
        """What stands before decimals in numbers that can be read in one way; where none tells, and commas part the
        cells, a point.
        """
        texts = {text for _, row in self.rows for text in row.values()}
        shown = {mark for mark, decimals in _SHOWN.items() if any(map(decimals.match, texts))}
        return shown or ({"."} if self.delimiter == "," else set())

    def in_doubt(self, text: str) -> bool:
        """Whether the mark of a number (1.500) may part thousands here."""
        found = _EITHER_WAY.fullmatch(text)
        return found is not None and self.marks != {found[1]}


def list_text(data: bytes, what: str, code: str) -> str:
    """Decoded as an export is. Raises DataError(code), which says `what` it was to be, where it is no text."""
    encoding = detect_encoding(data)
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        raise DataError(code, f"{what} is no text in {encoding}: {error.reason}") from error


def list_rows(text: str, what: str, code: str) -> Listed:
    """Cells by the names in the first row that is not blank, both without blanks around, names in small letters; under
    `BEYOND` what a row has beyond them. Raises DataError(code) where it is no CSV, or names a column twice.
    """
    text = _in_lines(text)
    said = _SAID_DELIMITER.match(text)
    text = text[said.end() :].lstrip("\n") if said else text
    delimiter = said[1] if said else _delimiter(text)
    try:
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
        names = [name.strip().lower() for name in next(reader, [])]
        _refuse_twins(names, what, code)
        return Listed([(number, row) for number, row in enumerate(_named(reader, names), 2) if row], delimiter)
    except csv.Error as error:
        raise DataError(code, f"{what} is not CSV: {error}") from error


def _in_lines(text: str) -> str:
    """Without what old systems put at the ends, and blank lines first."""
    text = text.lstrip("\ufeff").rstrip(_END_OF_FILE)
    return (text if "\n" in text else text.replace("\r", "\n")).lstrip("\r\n")


def _delimiter(text: str) -> str:
    """With which a key is a column; else what the names have most of."""
    first = text.split("\n", 1)[0]

    def parts(sign: str) -> bool:
        names = [name.strip().lower() for name in next(csv.reader([first], delimiter=sign), [])]
        return not KEYS.isdisjoint(names) and len(names) > 1

    return max(DELIMITERS, key=lambda sign: (parts(sign), first.count(sign)))


def _refuse_twins(names: list[str], what: str, code: str) -> None:
    twin = next((name for k, name in enumerate(names) if name and name in names[:k]), None)
    if twin is not None:
        raise DataError(code, f"{what} has two columns {twin[:60]!r}; which of them counts is not told")


def _named(rows: Iterator[list[str]], names: list[str]) -> Iterator[dict[str, str]]:
    """Nothing of rows whose cells are all blank."""
    for cells in rows:
        told = {name: cell.strip() for name, cell in zip(names, cells, strict=False)}
        beyond = " ".join(cell for cell in cells[len(names) :] if cell.strip())
        if not any(cell.strip() for cell in cells):
            yield {}
        else:
            yield told | ({BEYOND: beyond} if beyond else {})
