"""Columns of which the first rows do not tell whether they say how good values are: what stands in them in all rows."""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping

import numpy as np
import polars as pl

from app.ingest.columns.quality import MOST_QUALITIES
from app.ingest.tables.odd_fields import ChunkColumns
from app.ingest.tags.fault_words import tell_faults
from app.ingest.tags.quality import Quality, holds_good, is_number, may_be_quality, numbers_tell_quality

_ZERO = "0"
_ENOUGH = MOST_QUALITIES + 2  # one of them may be the empty one


class LateQualities:
    """judging: such columns. One that holds what no quality does is not looked at any longer."""

    def __init__(self, judging: Iterable[int]) -> None:
        self._seen: dict[int, Counter[str]] = {column: Counter() for column in judging}

    def see(self, chunk: ChunkColumns) -> None:
        """After its fields were read, so that the texts of those that are no numbers are there."""
        if not self._seen:
            return
        for position, value in chunk.columns.items():
            seen = self._seen.get(value.index)
            if seen is not None:
                known = len(seen)
                seen.update(_fields(chunk, position))
                if len(seen) > known and not _may_tell(seen):
                    del self._seen[value.index]

    def found(self) -> frozenset[int]:
        """The columns that hold qualities, by all rows so far."""
        return frozenset(column for column, seen in self._seen.items() if _tell(seen))

    def unknown(self, others_judge: bool) -> frozenset[int]:
        """The columns of which different numbers may be qualities, and nothing tells which of them are good.
        others_judge: other columns are qualities: one that is 0 in all rows may be one, too, of values that are all
        bad."""
        at_rest = [{_ZERO}] if others_judge else []
        untold = {column: seen for column, seen in self._seen.items() if not _tell(seen)}
        return frozenset(column for column, seen in untold.items() if len(seen) > 1 or set(seen) in at_rest)

    def teach(self, quality: Quality) -> None:
        """What stands in the columns that were found, and how often."""
        for column in self.found():
            texts, times = zip(*self._seen[column].items(), strict=True)
            quality.learn(pl.Series(texts, dtype=pl.String), np.array(times))


def _fields(chunk: ChunkColumns, position: int) -> dict[str, int]:
    """The different ones of rows that count with how often they stand, no more of them than tell that they are too
    many."""
    if position in chunk.texts:
        texts = chunk.texts[position].filter(pl.Series(chunk.kept))
        counts = texts.str.strip_chars(' "').drop_nulls().value_counts(sort=True).head(_ENOUGH)
        return {text: times for text, times in counts.iter_rows() if text}
    values = chunk.numbers.values[:, position]
    values = values[chunk.kept & np.isfinite(values)]
    if len(values) and values.min() == values.max():
        return {f"{values[0]:g}": len(values)}
    numbers, times = np.unique(values, return_counts=True)
    return {f"{number:g}": count for number, count in zip(numbers[:_ENOUGH], times.tolist(), strict=False)}


def _may_tell(seen: Collection[str]) -> bool:
    """Whether fields are none but qualities, words of faults and numbers that may be qualities: further rows tell."""
    if len(seen) > MOST_QUALITIES:
        return False
    words = [text for text in seen if not may_be_quality(text)]
    return not words or bool(tell_faults(pl.Series(words, dtype=pl.String)).all())


def _tell(seen: Mapping[str, int]) -> bool:
    """Whether they are qualities: words alone, or numbers and one that says that a value is good. Words of faults stand
    in the place of any number."""
    if not seen or not _may_tell(seen):
        return False
    words = [text for text in seen if not is_number(text)]
    return len(words) == len(seen) or holds_good(words) or numbers_tell_quality(seen)
