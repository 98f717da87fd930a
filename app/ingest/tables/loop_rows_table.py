"""Reads a table of a loop a row: each of its signals as the values of a long table, one after the other."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.columns.plans import ValueColumn, name_of
from app.ingest.tables.frames import RowReader, Rows
from app.ingest.tables.long_table import LongTable
from app.ingest.tables.pieces import Gathered, joined
from app.ingest.tables.scanning import Scanner


class LoopRowsTable(LongTable):
    """What is wrong with a row is told with its first signal."""

    _telling = True

    def types(self) -> dict[int, pl.DataType]:
        types = super().types()
        types.update({signal.index: pl.Float64() for signal in self._plan.signals})
        types[self._plan.tag] = pl.String()
        if self._plan.word is not None:
            types[self._plan.word] = pl.String()
        return types

    def _scanning(self, reader: RowReader) -> Scanner | None:
        return None

    def _gather(self, rows: Rows, reader: RowReader) -> Gathered:
        return joined(list(self._of_signals(rows, reader)))

    def _of_signals(self, rows: Rows, reader: RowReader) -> Iterator[Gathered]:
        clock = self._time.clock.before
        for number, signal in enumerate(self._plan.signals):
            self._telling = number == 0
            self._time.clock.before = clock
            self._plan = replace(self._plan, value=signal.index)
            self._tags_before = len(self._places)
            before = self._tally.rows_kept
            yield self._of_frame(replace(rows, frame=self._with_tags(rows.frame, signal)), reader)
            self._tally.rows_kept = self._tally.rows_kept if self._telling else before

    def _with_tags(self, frame: pl.DataFrame, signal: ValueColumn) -> pl.DataFrame:
        loops = pl.col(name_of(self._plan.tag)).str.strip_chars()
        word = pl.lit(signal.tag) if self._plan.word is None else pl.col(name_of(self._plan.word)).str.strip_chars()
        tags = pl.when(loops.str.len_bytes() > 0).then(loops + "." + word)
        return frame.with_columns(tags.cast(self._tag_type).alias(name_of(self._plan.tag)))

    def _tell_left_out(
        self,
        rows: Rows,
        texts: pl.Series,
        tags: pl.Series,
        timed: NDArray[np.bool_],
        kept: NDArray[np.bool_],
        reader: RowReader,
    ) -> None:
        if self._telling:
            super()._tell_left_out(rows, texts, tags, timed, kept, reader)
