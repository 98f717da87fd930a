"""Columns of which the first rows do not tell whether they say how good values are: what stands in them in all rows."""

from collections import Counter
from collections.abc import Collection, Iterable

import numpy as np
import polars as pl

from app.ingest.columns.quality import MOST_QUALITIES, may_be_qualities
from app.ingest.tables.odd_fields import ChunkColumns
from app.ingest.tags.fault_words import tell_faults
from app.ingest.tags.quality import Quality, tell_quality_for_sure

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
                seen.update(_fields(chunk, position))
                if not may_be_qualities([*seen]) and not _tell(seen):
                    del self._seen[value.index]

    def found(self) -> frozenset[int]:
        """The columns that hold qualities, by all rows so far."""
        return frozenset(column for column, seen in self._seen.items() if _tell(seen))

    def unknown(self) -> frozenset[int]:
        """The columns of which different numbers may be qualities, and nothing tells which of them are good."""
        return frozenset(column for column, seen in self._seen.items() if len(seen) > 1 and not _tell(seen))

    def teach(self, quality: Quality) -> None:
        """What stands in the columns that were found, and how often."""
        for column in self.found():
            texts, times = zip(*self._seen[column].items(), strict=True)
            quality.learn(pl.Series(texts, dtype=pl.String), np.array(times))


def _fields(chunk: ChunkColumns, position: int) -> dict[str, int]:
    """The different ones with how often they stand, no more of them than tell that they are too many."""
    if position in chunk.texts:
        counts = chunk.texts[position].str.strip_chars(' "').drop_nulls().value_counts(sort=True).head(_ENOUGH)
        return {text: times for text, times in counts.iter_rows() if text}
    values = chunk.numbers.values[:, position]
    numbers, times = np.unique(values[np.isfinite(values)], return_counts=True)
    return {f"{number:g}": count for number, count in zip(numbers[:_ENOUGH], times.tolist(), strict=False)}


def _tell(seen: Collection[str]) -> bool:
    """Whether a word among the fields is one of qualities, and the others are words of faults or numbers that may be
    qualities."""
    if len(seen) > MOST_QUALITIES:
        return False
    if tell_quality_for_sure([*seen]):
        return True
    others = [text for text in seen if not tell_quality_for_sure([text])]
    words = pl.Series([text for text in others if not may_be_qualities([text])], dtype=pl.String)
    numbers_alone = len(others) == len(seen) and not len(words)
    return not numbers_alone and bool(tell_faults(words).all())
