"""Long tables as historians write them: plain rows, tags that come again. They are read without parting their text."""

from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.columns.plans import LongPlan
from app.ingest.files.opening import Lines
from app.ingest.model import FloatArray
from app.ingest.times.stamps import TimeForm

MOST_NEW = 1 << 16  # tags that a chunk may bring
LEAST_RUNS = 64  # from so many on, a run of rows with one text must have
ROWS_A_RUN = 4  # so many rows on average
PATIENCE = 3  # chunks that may turn out not to be plain, each one that is makes up for one
WORD = 8


@dataclass(frozen=True, eq=False)
class Runs:
    """Rows one after the other that have the same text: the first row of each, and its text."""

    first: NDArray[np.int64]
    texts: pl.Series
    rows: int

    @property
    def lengths(self) -> NDArray[np.int64]:
        return np.diff(self.first, append=self.rows)


@dataclass(frozen=True, eq=False)
class Scan:
    """Plain rows: codes (n,) of tags, the first `known` in the order in which they were learnt, behind them `new`;
    values (n,), NaN where none stands; kinds (known + new,) of each tag's values where marks are in doubt, else 0."""

    codes: NDArray[np.uint32]
    known: int
    new: list[str]
    values: FloatArray
    kinds: NDArray[np.uint8]
    times: Runs
    qualities: Runs


@dataclass(frozen=True, eq=False)
class _Known:
    """Tags one behind the other, tag i from bounds[i] to bounds[i + 1] of the text, and a table to find them by."""

    text: bytes
    bounds: NDArray[np.int64]
    table: NDArray[np.int32]


class Scanner:
    """Reads chunks of plain rows, several at a time: rows of full width without quotes, whose values are decimal
    numbers or missing, in which times and qualities stay the same over some rows."""

    def __init__(self, plan: LongPlan, delimiter: str, decimal_mark: str, in_doubt: bool) -> None:
        """in_doubt: the mark may part thousands as well."""
        self._plan, self._in_doubt = plan, in_doubt
        self._marks = (ord(delimiter), ord(decimal_mark))
        self._possible = len(plan.time) == 1 and max(self._marks) < 128 and delimiter != decimal_mark
        self._tags: list[str] = []
        self._known: _Known | None = None
        self._patience = PATIENCE

    def read(self, lines: Lines) -> Scan | None:
        """What stands in the rows; None where they are not plain, or reading others so has failed."""
        if not self._possible or self._patience <= 0:
            return None
        scan = self.scan(lines)
        self._patience = self._patience - 1 if scan is None else min(self._patience + 1, PATIENCE)
        return scan

    def refused(self) -> None:
        """A chunk had rows of which something could not be used, and is read again."""
        self._patience -= 2

    def learn(self, tags: list[str]) -> None:
        """Tags behind those known by now: they are found faster than new ones. One that stands in no field without
        quotes ends scanning, for what looks like it in plain text is another field.
        """
        self._possible = self._possible and all(map(self._stands_alone, tags))
        self._tags += tags

    def _stands_alone(self, tag: str) -> bool:
        return bool(tag) and not any(mark in tag for mark in (chr(self._marks[0]), '"', "\r", "\n"))

    def scan(self, lines: Lines) -> Scan | None:
        """What stands in the rows, however few they are; None where they are not plain."""
        from app.ingest.tables.scan_kernel import read_rows

        known = self._known_tags()
        n = lines.count
        codes, values = np.empty(n, dtype=np.uint32), np.empty(n)
        kinds = np.zeros(len(known.bounds) - 1 + MOST_NEW, dtype=np.uint8)
        fresh = np.empty((MOST_NEW, 2), dtype=np.int64)
        runs = np.empty((2, LEAST_RUNS + n // ROWS_A_RUN, 3), dtype=np.int64)
        counts = np.zeros(3, dtype=np.int64)
        plain = read_rows(
            np.frombuffer(lines.data, np.uint8),
            _words(lines.data),
            self._marks,
            self._columns(),
            _words(known.text),
            known.bounds,
            known.table.copy(),
            codes,
            values,
            kinds,
            fresh,
            runs,
            counts,
        )
        if not plain:
            return None
        try:
            new = _texts(lines.data, fresh[: counts[2]])
            times, qualities = (_runs(lines.data, found[:count], n) for found, count in zip(runs, counts, strict=False))
        except UnicodeDecodeError:
            return None
        tags = len(known.bounds) - 1
        kinds = kinds[: tags + len(new)] * self._in_doubt
        return Scan(codes, tags, new, values, kinds, times, qualities)

    def _known_tags(self) -> _Known:
        known = self._known
        if known is None or len(known.bounds) <= len(self._tags):
            known = self._known = _told(self._tags.copy())  # others may be learnt meanwhile
        return known

    def _columns(self) -> NDArray[np.int64]:
        from app.ingest.tables.scan_kernel import OTHER, QUALITY, TAG, TIME, VALUE

        plan = self._plan
        columns = np.full(plan.width, OTHER)
        for kind, index in ((QUALITY, plan.quality), (TIME, plan.time[0]), (TAG, plan.tag), (VALUE, plan.value)):
            if index is not None:
                columns[index] = kind
        return columns


def warm_up() -> None:
    """Compiles or loads what reads rows: the first large file otherwise waits for it."""
    from app.ingest.numbers.kind_kernel import column_kinds

    plan = LongPlan("long", 0, 3, (0,), TimeForm("text"), 1, 2)
    Scanner(plan, ",", ".", in_doubt=False).scan(Lines(b"noon,FIC101.PV,1.5\n", 1, 1))
    column_kinds(np.frombuffer(b"1.5\n", np.uint8), ord(";"), np.zeros(1, dtype=np.uint8))


def _told(tags: list[str]) -> _Known:
    from app.ingest.tables.scan_kernel import NONE, fill_table

    texts = [tag.encode() for tag in tags]
    text = b"".join((bytes(WORD), *texts))  # a word ends with the first one too
    bounds = np.cumsum([WORD, *map(len, texts)])
    table = np.full(1 << (2 * (len(tags) + MOST_NEW)).bit_length(), NONE, dtype=np.int32)
    fill_table(np.frombuffer(text, np.uint8), bounds, table)
    return _Known(text, bounds, table)


def _words(data: bytes) -> NDArray[np.uint64]:
    """The eight bytes from each byte on as a number."""
    return np.ndarray((len(data) - WORD + 1,), np.dtype("<u8"), data, strides=(1,))


def _texts(data: bytes, spans: NDArray[np.int64]) -> list[str]:
    return [data[start:end].decode() for start, end in spans.tolist()]


def _runs(data: bytes, found: NDArray[np.int64], rows: int) -> Runs:
    return Runs(found[:, 0].copy(), pl.Series(_texts(data, found[:, 1:]), dtype=pl.String), rows)
