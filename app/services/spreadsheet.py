"""Tables as CSV that a spreadsheet opens without running anything: a text cell never begins like a formula."""

import csv
import io
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r", "\n", "\uff1d", "\uff0b", "\uff0d", "\uff20")  # also in full width
# Where a semicolon parts cells (Excel in many languages), quotes around a cell of ours protect nothing in it. An
# apostrophe that stands there by itself gets another one, so that `plain_cell` knows which was ours.
AFTER_SEPARATOR = re.compile(r"([;\t\r\n]\s*)('*)(?=[=+\-@\uff1d\uff0b\uff0d\uff20])")
OURS_AFTER_SEPARATOR = re.compile(r"([;\t\r\n]\s*)'('*)(?=[=+\-@\uff1d\uff0b\uff0d\uff20])")


def safe_cell(value: Any) -> Any:
    """Numbers stay numbers, None is empty; a text that a spreadsheet would calculate gets an apostrophe, also where it
    would begin a cell because the spreadsheet parts cells by semicolons, tabs or lines."""
    if value is None:
        return ""
    if not isinstance(value, str):
        return value
    parted = AFTER_SEPARATOR.sub(r"\1'\2", value)
    return "'" + parted if value.lstrip("'").startswith(FORMULA_STARTS) else parted


def plain_cell(cell: str) -> str:
    """The text of which `safe_cell` made this one."""
    parted = OURS_AFTER_SEPARATOR.sub(r"\1\2", cell)
    return parted[1:] if parted.startswith("'") and parted.lstrip("'").startswith(FORMULA_STARTS) else parted


def csv_lines(rows: Iterable[Mapping[str, Any]], columns: Sequence[str]) -> Iterator[str]:
    """The header line, then a line a row; columns that a row lacks are empty."""
    yield from _lines([list(columns)])
    yield from csv_rows(rows, columns)


def csv_rows(rows: Iterable[Mapping[str, Any]], columns: Sequence[str], *, raw: bool = False) -> Iterator[str]:
    """The same without the header. raw: texts as they are, for programs, which calculate nothing."""
    written: Callable[[Any], Any] = (lambda value: value) if raw else safe_cell
    return _lines([written(row.get(column)) for column in columns] for row in rows)


def _lines(rows: Iterable[list[Any]]) -> Iterator[str]:
    buffer = io.StringIO(newline="")
    writer = csv.writer(buffer, lineterminator="\r\n")
    for cells in rows:
        writer.writerow(cells)
        yield buffer.getvalue()
        buffer.seek(0)
        buffer.truncate()
