"""Fields of a wide table that are no numbers to the fast reader, or not for sure: read again as text, only in the
columns that have any."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from itertools import islice

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.columns.plans import ValueColumn, name_of
from app.ingest.numbers.kind_codes import WORD
from app.ingest.numbers.kinds import IN_DOUBT, WITH, tells_nothing
from app.ingest.numbers.marks import all_doubtful, marked
from app.ingest.numbers.values import refuse_texts, says_something, tagged
from app.ingest.numbers.writing import MARKED, Writing
from app.ingest.tables.blank_cells import BLANK
from app.ingest.tables.frames import Numbers, RowReader, Rows
from app.ingest.tables.wordy_columns import WordyColumns

Where = NDArray[np.bool_]


@dataclass(eq=False)
class ChunkColumns:
    """Columns of numbers of a chunk, by their position in `numbers`; kept (n,): the rows that count."""

    rows: Rows
    columns: Mapping[int, ValueColumn]
    numbers: Numbers
    kept: Where
    reader: RowReader
    texts: dict[int, pl.Series] = field(default_factory=dict)  # of the columns that hold any

    def take(self, positions: Collection[int]) -> None:
        """The texts of columns, of those that were not taken before."""
        wanted = sorted(set(positions) - self.texts.keys())
        if not wanted:
            return
        texts = self.reader.texts(self.rows, [self.columns[p].index for p in wanted])
        for position, empty in zip(wanted, texts.null_count().row(0), strict=True):
            if empty < texts.height:
                self.texts[position] = texts[name_of(self.columns[position].index)]

    def kinds(self, position: int) -> int:
        """Of a column's fields; 0 where they were not seen."""
        return 0 if self.rows.kinds is None else int(self.rows.kinds[self.columns[position].index])

    def all_kinds(self) -> int:
        """Of the fields of all columns; 0 where they were not seen, or are in rows that do not count."""
        if self.rows.kinds is None or np.isfinite(self.numbers.values[~self.kept]).any():
            return 0
        indices = [value.index for value in self.columns.values()]
        return int(np.bitwise_or.reduce(self.rows.kinds[indices], initial=0))

    def left(self, position: int, with_marks: bool) -> Where:
        """Where a column has text that the fast reader left; with_marks: numbers whose mark is in doubt count as
        missing."""
        texts, missing = self.texts[position], self.numbers.missing[:, position]
        if with_marks and self.kinds(position) & IN_DOUBT:
            missing |= marked(texts)
        return np.asarray(missing & texts.is_not_null().to_numpy() & self.kept)

    def mark_blank(self) -> None:
        """When all numbers were read: fields in which nothing stands."""
        values, missing = self.numbers.values, self.numbers.missing
        for position in np.flatnonzero(missing.any(axis=0)).tolist():
            at = np.flatnonzero(missing[:, position] & np.isnan(values[:, position]))
            if position in self.texts:
                at = at[~says_something(self.texts[position][at])]
            values[at, position] = BLANK

    def holds(self, position: int, mark: str) -> bool:
        if position in self.texts:
            return bool(self.texts[position].str.contains(mark, literal=True).any())
        return bool(self.kinds(position) & WITH[mark])


class OddFields:
    """Reads them, chunk by chunk, and refuses those that are none."""

    def __init__(self, writing: Writing, wordy: WordyColumns, largest: Callable[[int], float]) -> None:
        """largest: by column, of the numbers of the chunks before."""
        self._writing, self._wordy, self._largest = writing, wordy, largest
        self._begun: set[int] = set()  # columns of which a chunk was read

    def read(self, chunk: ChunkColumns) -> None:
        """Puts into its numbers what is one; the others become NaN. Columns of which nothing tells how they are
        written are read as they were parsed, but for what is no number."""
        self._writing.learn_from(chunk.all_kinds())
        tags = self._writing.own
        own = {p for p, value in chunk.columns.items() if value.tag in tags} if tags else set()
        silent = self._silent(chunk, own)
        odd = own | (set() if chunk.rows.kinds is None else {p for p in chunk.columns if chunk.kinds(p) & IN_DOUBT})
        odd |= set(np.flatnonzero(chunk.numbers.missing.any(axis=0)).tolist())
        chunk.take(odd - {p for p in silent if not chunk.kinds(p) & WORD})
        left = {p: chunk.left(p, with_marks=p not in silent) for p in sorted(chunk.texts)}
        left = {p: at for p, at in left.items() if p in own or at.any()}
        silent |= {p for p in left.keys() - own - silent if all_doubtful(chunk.texts[p])}
        self._learn(chunk, {p: at for p, at in left.items() if p not in silent})
        stand = {p for p in sorted(silent) if self._are_decimals(chunk, p)}
        late = sorted(silent - stand)
        chunk.take(late)
        left |= {p: chunk.left(p, with_marks=True) for p in late}
        self._learn(chunk, {p: left[p] for p in late})
        for position in sorted(left):
            self._read_again(chunk, position, left[position], position in stand)
        chunk.mark_blank()
        kept = chunk.numbers.values if chunk.kept.all() else chunk.numbers.values[chunk.kept]
        self._wordy.look(kept, chunk.columns)
        if any(value.index not in self._begun for value in islice(chunk.columns.values(), 1)):  # they come together
            self._begun.update(value.index for value in chunk.columns.values())

    def _silent(self, chunk: ChunkColumns, own: Collection[int]) -> set[int]:
        """The columns whose marks are in doubt and, as the kinds of their fields show, tell nothing."""
        if chunk.rows.kinds is None:
            return set()
        found = {p for p in chunk.columns.keys() - own if chunk.kinds(p) & IN_DOUBT}
        found = {p for p in found if tells_nothing(chunk.kinds(p), self._writing.thousands)}
        return {p for p in found if (chunk.kept & np.isfinite(chunk.numbers.values[:, p])).any()}

    def _are_decimals(self, chunk: ChunkColumns, position: int) -> bool:
        thousands = self._writing.thousands
        if thousands and chunk.holds(position, thousands):
            return False
        return self._writing.are_decimals(chunk.columns[position].tag)

    def _learn(self, chunk: ChunkColumns, left: Mapping[int, Where]) -> None:
        if not left:
            return

        def of(found: bool) -> pl.DataFrame:
            each = ((chunk.columns[p].tag, chunk.texts[p].filter(pl.Series(at == found))) for p, at in left.items())
            return tagged(each)

        columns = {chunk.columns[p].tag: chunk.columns[p].index for p in left}

        def before(tag: str) -> float | None:
            return self._largest(columns[tag]) if columns[tag] in self._begun else None

        odd = of(True)
        self._writing.learn(odd["text"], odd["tag"], lambda: of(False), before)

    def _read_again(self, chunk: ChunkColumns, position: int, left: Where, stands: bool) -> None:
        tag, texts, values = chunk.columns[position].tag, chunk.texts[position], chunk.numbers.values
        if stands:
            left = left & np.isnan(values[:, position])
        elif tag in self._writing.own:
            left = left | (texts.str.contains(MARKED).fill_null(False).to_numpy() & chunk.kept)
        at = np.flatnonzero(left)
        if len(at):
            values[at, position] = refuse_texts(
                texts[at], chunk.rows.lines(at), tag, self._writing, self._wordy.log_of(tag)
            )
            chunk.numbers.missing[at, position] = True  # what is refused here is not refused once more for what is left
