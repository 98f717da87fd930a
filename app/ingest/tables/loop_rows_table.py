"""Reads a table of a loop a row: each of its signals as the values of a long table, one after the other."""

from collections.abc import Iterator

import polars as pl

from app.ingest.columns.plans import ValueColumn, name_of
from app.ingest.tables.cells import Cells
from app.ingest.tables.frames import RowReader, Rows
from app.ingest.tables.long_table import LongTable
from app.ingest.tables.pieces import Gathered, joined
from app.ingest.tables.scanning import Scanner


class LoopRowsTable(LongTable):
    """What is wrong with a row is told with its first signal."""

    def types(self) -> dict[int, pl.DataType]:
        types = super().types()
        types.update({column.index: pl.Float64() for column in self._columns})
        types[self._plan.tag] = pl.String()
        if self._plan.word is not None:
            types[self._plan.word] = pl.String()
        return types

    @property
    def _columns(self) -> tuple[ValueColumn, ...]:
        return (*self._plan.signals, *self._plan.others)

    def _scanning(self, reader: RowReader) -> Scanner | None:
        return None

    def _of_frame(self, rows: Rows, reader: RowReader) -> Gathered:
        texts, time_ns = self._timed(rows, reader)
        self._place_others(self._loops_of(rows))
        gathered = [self._of_cells(cells, texts, time_ns) for cells in self._cells(rows, reader)]
        self._tally.rows_kept += len(gathered[0])
        return joined(gathered)

    def _place_others(self, loops: pl.Series) -> None:
        """Beside the signals of their loops, which their names do not tell."""
        if not self._plan.others:
            return
        for loop in loops.drop_nulls().unique(maintain_order=True):
            of = self._grouping.place(f"{loop}.{self._plan.signals[0].tag}").loop
            for other in self._plan.others:
                self._grouping.place_beside(f"{loop}.{other.tag}", of)

    def _loops_of(self, rows: Rows) -> pl.Series:
        return rows.frame[name_of(self._plan.tag)].str.strip_chars()

    def _cells(self, rows: Rows, reader: RowReader) -> Iterator[Cells]:
        loops = self._loops_of(rows)
        for number, column in enumerate(self._columns):
            tags = self._named(rows.frame, loops, column)
            yield Cells(rows, reader, tags, column.index, telling=number == 0)

    def _named(self, frame: pl.DataFrame, loops: pl.Series, column: ValueColumn) -> pl.Series:
        word = pl.lit(column.tag) if self._plan.word is None else frame[name_of(self._plan.word)].str.strip_chars()
        tags = pl.when(loops.str.len_bytes() > 0).then(loops + "." + word)
        return pl.select(tags.cast(self._tag_type)).to_series(0)
