"""The values of one column of a chunk of a long table, with their tags."""

from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.tables.frames import Numbers, RowReader, Rows


@dataclass(frozen=True, eq=False)
class Cells:
    """The values of one column of a chunk, and the tag of each. telling: what is wrong with its rows is told with
    them. states: words that stand for values."""

    rows: Rows
    reader: RowReader
    tags: pl.Series
    column: int
    telling: bool = True
    states: pl.Series | None = None

    def numbers(self) -> Numbers:
        return self.rows.numbers([self.column])

    def texts(self) -> pl.Series:
        texts = self.reader.texts(self.rows, [self.column]).to_series(0)
        return texts if self.states is None else self.states.zip_with(self.states.is_not_null(), texts)

    def kinds(self) -> int:
        """Of the values' fields; 0 where they were not seen."""
        return 0 if self.rows.kinds is None else int(self.rows.kinds[self.column])

    def codes(self) -> NDArray[np.uint32]:
        """(n,) the codes of the tags, as polars counts them; 0 where there is none."""
        codes = self.tags.to_physical()
        return (codes.fill_null(0) if codes.null_count() else codes).to_numpy()
