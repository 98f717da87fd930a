"""Rows of several plants that have the same tags in one file: refused when it is known what contradicts what."""

from collections.abc import Callable, Iterable

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.columns.of_words import would_mix
from app.ingest.columns.parting_rows import asked_columns, parts_rows
from app.ingest.columns.plans import Plan, name_of
from app.ingest.files.head import Head
from app.ingest.tables.frames import RowReader, Rows

ReaderOf = Callable[[dict[int, pl.DataType]], RowReader]
"""Reads some columns, each in a type."""


def refuse_mixed(plan: Plan, head: Head, lines: NDArray[np.int64], reader_of: ReaderOf) -> None:
    """Raises WordsPartRows where a column that is no signal tells rows apart from those that they contradict. lines
    (2, k): of the ones and of the others. The file is read once more for it, in these columns alone."""
    names = asked_columns(plan, head)
    if not names:
        return
    wanted = np.unique(lines)
    texts = _of_lines(reader_of(dict.fromkeys(names, pl.String())).rows(plan.first_row), wanted, list(names))
    earlier, later = np.searchsorted(wanted, lines)
    for column, name in names.items():
        if texts.height == len(wanted) and parts_rows(texts[name_of(column)], earlier, later):
            raise would_mix(name, column)


def _of_lines(each: Iterable[Rows], wanted: NDArray[np.int64], columns: list[int]) -> pl.DataFrame:
    """The rows in some lines, which are in order."""
    names = [name_of(column) for column in columns]
    found = [pl.DataFrame(schema=dict.fromkeys(names, pl.String))]
    for rows in each:
        first, last = np.searchsorted(wanted, (rows.first, rows.first + rows.height))
        found.append(rows.frame.select(names)[wanted[first:last] - rows.first].cast(pl.String))
        if last == len(wanted):
            break
    return pl.concat(found)
