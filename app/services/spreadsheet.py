"""Tables as CSV that a spreadsheet opens without running anything: a text cell never begins like a formula."""

import csv
import io
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

BYTE_ORDER_MARK = "\ufeff"  # by which spreadsheets know UTF-8
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r", "\n", "\uff1d", "\uff0b", "\uff0d", "\uff20")  # also in full width
# Where a semicolon parts cells (Excel in many languages), quotes around a cell of ours protect nothing in it. An
# apostrophe that stands there by itself gets another one, so that `plain_cell` knows which was ours.
# What follows is looked at and may be anything: a pattern that asked for it would try each of a thousand blanks anew.
AFTER_SEPARATOR = re.compile(r"([;\t\r\n]\s*)('*)(?=([=+\-@\uff1d\uff0b\uff0d\uff20])?)")


def safe_cell(value: Any) -> Any:
    """Numbers stay numbers, None is empty; a text that a spreadsheet would calculate gets an apostrophe, also where it
    would begin a cell because the spreadsheet parts cells by semicolons, tabs or lines."""
    if value is None:
        return ""
    return _safe_text(value) if isinstance(value, str) else value


@lru_cache(maxsize=2000)  # most texts of a table are codes, times of its run and sentences that come again
def _safe_text(value: str) -> str:
    parted = AFTER_SEPARATOR.sub(lambda found: f"{found[1]}'{found[2]}" if found[3] else found[0], value)
    return "'" + parted if value.lstrip("'").startswith(FORMULA_STARTS) else parted


def plain_cell(cell: str) -> str:
    """The text of which `safe_cell` made this one."""
    parted = AFTER_SEPARATOR.sub(lambda found: found[1] + found[2][1:] if found[3] else found[0], cell)
    return parted[1:] if parted.startswith("'") and parted.lstrip("'").startswith(FORMULA_STARTS) else parted


def csv_lines(rows: Iterable[Mapping[str, Any]], columns: Sequence[str]) -> Iterator[str]:
    """The header line, then a line a row; columns that a row lacks are empty."""
    yield from _lines([list(columns)])
    yield from csv_rows(rows, columns)


def csv_rows(rows: Iterable[Mapping[str, Any]], columns: Sequence[str], *, raw: bool = False) -> Iterator[str]:
    """The same without the header. raw: texts as they are, for programs, which calculate nothing."""
    return _lines(_cells(rows, columns, raw))


def csv_text(rows: Iterable[Mapping[str, Any]], columns: Sequence[str], *, raw: bool = False) -> str:
    """The same in one: for parts of a long table."""
    buffer = io.StringIO(newline="")
    csv.writer(buffer, lineterminator="\r\n").writerows(_cells(rows, columns, raw))
    return buffer.getvalue()


def _cells(rows: Iterable[Mapping[str, Any]], columns: Sequence[str], raw: bool) -> Iterator[Iterable[Any]]:
    """None is written as nothing."""
    if raw:
        return (map(row.get, columns) for row in rows)
    return ([_safe_text(v) if isinstance(v, str) else v for v in map(row.get, columns)] for row in rows)


def _lines(rows: Iterable[Iterable[Any]]) -> Iterator[str]:
    buffer = io.StringIO(newline="")
    writer = csv.writer(buffer, lineterminator="\r\n")
    for cells in rows:
        writer.writerow(cells)
        yield buffer.getvalue()
        buffer.seek(0)
        buffer.truncate()
