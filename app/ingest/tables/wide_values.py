"""The values of a wide table: what of its cells are numbers, modes, codes for no data, or refused by their quality."""

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.columns.plans import TimedColumns, ValueColumn, name_of
from app.ingest.model import FloatArray
from app.ingest.numbers.no_data import Span, ends_are_codes
from app.ingest.rejecting import RejectLog
from app.ingest.tables.blank_cells import BLANK
from app.ingest.tables.frames import Numbers, RowReader, Rows
from app.ingest.tables.late_qualities import LateQualities
from app.ingest.tables.odd_fields import ChunkColumns, OddFields
from app.ingest.tables.pieces import Grid
from app.ingest.tables.tally import Tally
from app.ingest.tables.wordy_columns import WordyColumns
from app.ingest.tags.confidences import of_confidences
from app.ingest.tags.grouping import AUDITED, Place
from app.ingest.tags.modes import UNKNOWN_MODE, stand_for_no_data
from app.ingest.times.time_reader import to_numbers


class _Columns:
    """What of a group's columns is the same in all chunks, by their position."""

    def __init__(self, group: TimedColumns, modes: Collection[int]) -> None:
        self.group = group
        self.columns = [value.index for value in group.values]
        self.modes = [at for at, column in enumerate(self.columns) if column in modes] if modes else []
        self.plain = dict(enumerate(group.values))
        for at in self.modes:
            del self.plain[at]
        self.judged = [
            (at, value)
            for at, value in enumerate(group.values)
            if value.off_line is not None or value.quality is not None
        ]


class WideValues:
    """`places`: of the tags of columns of values; judging: columns of them that may yet say how good others are."""

    def __init__(self, places: Mapping[int, Place], judging: Collection[int], log: RejectLog, tally: Tally) -> None:
        self._places, self._log, self._tally = places, log, tally
        self.late_qualities = LateQualities(judging)
        self._wordy = WordyColumns([place.tag for place in places.values() if place.signal == "OTHER"], log)
        self._odd_fields = OddFields(tally.writing, self._wordy, self._largest)
        self._modes = frozenset(index for index, place in places.items() if place.signal == "MODE")
        self._lowest = np.full(1 + max(places, default=0), np.inf)  # by column, of values that are no codes
        self._highest = -self._lowest
        self._known: dict[int, _Columns] = {}

    def is_mode(self, value: ValueColumn) -> bool:
        return value.index in self._modes

    def of_chunk(self, rows: Rows, group: TimedColumns, reader: RowReader, kept: NDArray[np.bool_]) -> FloatArray:
        """(n, columns) values; refused ones NaN. Odd columns are looked at one by one, the others not at all."""
        known = self._columns_of(group)
        if not known.modes:
            numbers = rows.numbers(known.columns)
        else:
            numbers = self._with_modes(rows, known, kept)
            self._refuse_modes(rows, group, numbers.values, known.modes, kept)
        chunk = ChunkColumns(rows, known.plain, numbers, kept, reader)
        self._odd_fields.read(chunk)
        self.late_qualities.see(chunk)
        self._refuse_odd_numbers(rows, group, numbers, kept)
        self._refuse_quality(rows, known.judged, numbers.values, reader, kept)
        return numbers.values

    def _columns_of(self, group: TimedColumns) -> _Columns:
        """Which holds the group, so that no other one is taken for it."""
        known = self._known.get(id(group))
        if known is None:
            known = self._known[id(group)] = _Columns(group, self._modes)
        return known

    def _largest(self, column: int) -> float:
        """How large the values of a column are at most that were read so far; 0 where there is none."""
        return float(max(-self._lowest[column], self._highest[column], 0.0))

    def _with_modes(self, rows: Rows, known: _Columns, kept: NDArray[np.bool_]) -> Numbers:
        """Columns of modes among the columns of numbers, in the rows that are kept."""
        group, plain = known.group, list(known.plain)
        shape = (rows.frame.height, len(group.values))
        values, missing = np.empty(shape, order="F"), np.zeros(shape, dtype=bool, order="F")
        if plain:
            found = rows.numbers([group.values[position].index for position in plain])
            values[:, plain], missing[:, plain] = found.values, found.missing
        for position in known.modes:
            flags = self._modes_of(rows, group.values[position], np.flatnonzero(kept))
            values[:, position] = BLANK
            values[kept, position] = np.where(np.isnan(flags), BLANK, flags)
        return Numbers(values, missing)

    def _modes_of(self, rows: Rows, value: ValueColumn, at: NDArray[np.int64]) -> FloatArray:
        return self._tally.modes.of_texts(_texts(rows, value)[at], self._places[value.index].tag, at + rows.first)

    def _refuse_modes(
        self,
        rows: Rows,
        group: TimedColumns,
        matrix: FloatArray,
        modes: list[int],
        kept: NDArray[np.bool_],
    ) -> None:
        for position in modes:
            value, of_mode = group.values[position], matrix[:, position]
            texts = _texts(rows, value)
            no_data = np.flatnonzero(~np.isfinite(of_mode) & kept)
            no_data = no_data[stand_for_no_data(texts[no_data])]
            unknown = np.flatnonzero((of_mode == UNKNOWN_MODE) & kept)
            for code, at in {"unknown_mode": unknown, "not_a_number": no_data}.items():
                self._log.add_many(code, rows.lines(at), (str(texts[int(row)]) for row in at), value.tag)

    def _refuse_odd_numbers(self, rows: Rows, group: TimedColumns, numbers: Numbers, kept: NDArray[np.bool_]) -> None:
        matrix = numbers.values
        unfinished = np.flatnonzero(~np.isfinite(matrix).all(axis=0))
        for position in unfinished:
            value = group.values[position]
            if self.is_mode(value):
                continue
            at = np.flatnonzero(kept & ~numbers.missing[:, position] & ~np.isfinite(matrix[:, position]))
            if len(at):
                self._log.add_many("not_finite", rows.lines(at), (f"{matrix[row, position]}" for row in at), value.tag)
                matrix[at, position] = np.nan
        self._refuse_codes(rows, group, matrix)

    def _refuse_codes(self, rows: Rows, group: TimedColumns, matrix: FloatArray) -> None:
        """Codes for no data, that stand apart from what their column has in these rows and had before."""
        lowest, highest = np.fmin.reduce(matrix, axis=0), np.fmax.reduce(matrix, axis=0)
        columns = self._columns_of(group).columns
        lines = np.arange(rows.first, rows.first + len(matrix))
        for position in np.flatnonzero(ends_are_codes(lowest, highest)):
            value = group.values[position]
            if self.is_mode(value):
                continue
            span = Span(self._lowest[value.index], self._highest[value.index])
            alone = self._places[value.index].signal == "PV"
            matrix[:, position] = self._tally.no_data.refused(
                matrix[:, position], lines, value.tag, self._log, span, alone
            )
            known = matrix[np.isfinite(matrix[:, position]), position]
            lowest[position], highest[position] = known.min(initial=np.inf), known.max(initial=-np.inf)
        self._lowest[columns] = np.fmin(self._lowest[columns], lowest)
        self._highest[columns] = np.fmax(self._highest[columns], highest)

    def _refuse_quality(
        self,
        rows: Rows,
        judged: list[tuple[int, ValueColumn]],
        matrix: FloatArray,
        reader: RowReader,
        kept: NDArray[np.bool_],
    ) -> None:
        qualities = {value.quality: _qualities(rows, value) for _, value in judged}
        for texts in qualities.values():
            if texts is not None:
                self._tally.quality.learn(texts)
        for position, value in judged:
            bad, code, words = np.zeros(len(matrix), dtype=bool), "", "off-line flag set"
            if value.off_line is not None:
                bad = np.nan_to_num(_flags(rows, value.off_line, reader)) != 0
                code = "off_line"
            texts = qualities[value.quality]
            if texts is not None:
                bad, code = self._tally.quality.bad(texts), "bad_quality"
                words = "quality is not good"
            at = np.flatnonzero(bad & kept & np.isfinite(matrix[:, position]))
            if len(at):
                self._log.add_many(code, rows.lines(at), (words for _ in at), value.tag)
                matrix[at, position] = np.nan

    def without_late_codes(self, whole: Grid) -> Grid:
        """Without codes for no data that were all that their chunks had, and stand apart from what came in others."""
        ends = np.flatnonzero(ends_are_codes(self._lowest[whole.codes], self._highest[whole.codes]))
        places = {row: self._places[int(whole.codes[row])] for row in ends.tolist()}
        places = {row: place for row, place in places.items() if place.signal != "MODE"}
        if not places:
            return whole
        values = whole.values.copy()
        for row, place in places.items():
            alone = place.signal == "PV"
            values[row] = self._tally.no_data.refused(values[row], whole.lines, place.tag, self._log, alone=alone)
        refused = np.isfinite(whole.values) & ~np.isfinite(values)
        self._tally.values_kept -= int(np.count_nonzero(refused))
        return replace(whole, values=values)

    def wordy(self) -> list[str]:
        """The tags that hold no number, when all rows were read: columns of words, and PV and OP without a value."""
        return [*self._wordy.settle(), *self._empty()]

    def _empty(self) -> list[str]:
        """The tags of PV and OP that had no value in any row."""
        each = self._places.items()
        return [at.tag for index, at in each if at.signal in AUDITED and self._highest[index] < self._lowest[index]]


def _flags(rows: Rows, column: int, reader: RowReader) -> FloatArray:
    """(n,) numbers, NaN where none stands."""
    flags = rows.numbers([column])
    if not flags.missing.any():
        return flags.values[:, 0]
    return np.where(flags.missing[:, 0], to_numbers(reader.texts(rows, [column]).to_series(0)), flags.values[:, 0])


def _qualities(rows: Rows, value: ValueColumn) -> pl.Series | None:
    """What says how good the values of a column are."""
    if value.quality is None:
        return None
    texts = rows.frame[name_of(value.quality)]
    return of_confidences(texts.cast(pl.String)) if value.in_percent else texts


def _texts(rows: Rows, value: ValueColumn) -> pl.Series:
    """A column as text; a table may hold times where modes are expected."""
    return rows.frame[name_of(value.index)].cast(pl.String)
