"""Which columns have the names of loops, in tables with several signals of a loop, or the word of one, in each row."""

import re
from collections.abc import Sequence
from itertools import pairwise

import polars as pl

from app.ingest.columns.clocks import MOST
from app.ingest.columns.joined_stamps import stamps_of_rows
from app.ingest.columns.names import ONE_WAY, TAG_NAMES
from app.ingest.columns.of_words import lie_among, states_among, take_turns, times_by_word
from app.ingest.columns.plain_names import plain
from app.ingest.files.head import Head, is_number
from app.ingest.model import NO_TIME, IngestOptions
from app.ingest.times.stamps import TimeForm
from app.ingest.times.time_reader import TimeReader

LOOP_NAMES = frozenset(("loop", "loopname", "loopid", "looptag"))
_OF_TAGS = TAG_NAMES | {"controller", "controllername", "block", "blockname"}
_PLACES = frozenset(
    (
        *("element", "elementname", "elementpath", "asset", "assetname", "object", "objectname"),
        *("device", "deviceid", "devicename"),
    )
)
"""Names of columns that may have the place of many loops, or of all of them, as well."""
_RANKS = (LOOP_NAMES, _OF_TAGS, _PLACES)
OF_ANYTHING = frozenset(("series", "item", "itemid", "name", "variable", "varname"))
"""Names of columns that may have batches as well."""
_CONTROLLER = re.compile(r"(?i)[A-Z]*C[A-Z]?[-_. ]?\d|loop")  # FIC101, 10-PDC-12, Loop 3


def columns_of_loops(
    head: Head, names: tuple[str, ...], first_row: int, columns: Sequence[int], in_words: bool
) -> list[int]:
    """Of some columns those that may be of loops. in_words: beside a column of the words of signals, where what stands
    under the name of a tag is a loop without a digit in it too, or one called as a mode."""
    filled = MOST * sum(any(row) for row in head.rows[first_row:])
    fields = {index: head.column(index, first_row) for index in columns}
    return [
        index
        for index, own in fields.items()
        if own and len(own) >= filled and _names_loops(head, plain(names[index]), own, in_words)
    ]


def _names_loops(head: Head, name: str, fields: list[str], in_words: bool) -> bool:
    """Numbers are names of loops where they are called so alone, and repeat. Under another name most words have a
    digit, and hardly a row has a mode or a quality: it may be of operators, products or remarks."""
    if not any(name in ranked for ranked in _RANKS):
        return False
    if all(is_number(text, head.decimal_mark) for text in fields):
        return name in LOOP_NAMES and 2 * len(set(fields)) <= len(fields)
    if name in LOOP_NAMES or in_words:
        return True
    words, states = set(fields), states_among(fields)
    if 2 * sum(field in states for field in fields) > len(fields):
        return False
    return 2 * sum(any(map(str.isdigit, word)) for word in words) > len(words)


class Rows:
    """The first rows of a table, with the times that tell what their words part."""

    def __init__(
        self,
        head: Head,
        names: tuple[str, ...],
        first_row: int,
        times: tuple[tuple[int, ...], TimeForm],
        options: IngestOptions,
        word: int | None = None,
    ) -> None:
        """word: the column of the words of signals."""
        self._names = names
        time, form = times
        of_all = (*time, word) if word is not None else time
        self._rows = [row for row in head.rows[first_row:] if len(row) > max(of_all) and any(row[at] for at in time)]
        stamps = stamps_of_rows(self._rows, time)
        self._time_ns = TimeReader(form, options).read(pl.Series(stamps, dtype=pl.String))
        self._keys = [(stamp, "" if word is None else row[word]) for stamp, row in zip(stamps, self._rows, strict=True)]

    def loops(self, columns: Sequence[int], one_place: bool = False) -> list[int]:
        """Of columns of loops those that have some, the one that is asked first: first those that are called so, and
        places last. Of equal ones the one that leaves each loop one row of a time. one_place: one of all rows is
        a loop as well."""
        found = [index for index in columns if self._has_loops(index, one_place)]
        return sorted(found, key=lambda index: (self._rank(index), not self._parts_all(index)))

    def _rank(self, column: int) -> int:
        return next(rank for rank, ranked in enumerate(_RANKS) if plain(self._names[column]) in ranked)

    def _has_loops(self, column: int, one_place: bool) -> bool:
        if plain(self._names[column]) in OF_ANYTHING:
            return not self._has_batches(column)
        return one_place or self._rank(column) < _RANKS.index(_PLACES) or self._parts(column)

    def _cells(self, column: int) -> list[str]:
        return [row[column] if column < len(row) else "" for row in self._rows]

    def _parts_all(self, column: int) -> bool:
        different = set(zip(self._keys, self._cells(column), strict=True))
        return len(different) >= ONE_WAY * len(self._keys)

    def _has_batches(self, column: int) -> bool:
        """Whether its words follow each other in time, and not most of them are called as controllers are."""
        timed = [(word, at) for word, at in self._timed(column) if word]
        words = [word for word, _ in timed]
        if 2 * sum(bool(_CONTROLLER.search(word)) for word in set(words)) > len(set(words)):
            return False
        return _follow_each_other(timed)

    def _timed(self, column: int) -> list[tuple[str, int]]:
        return list(zip(self._cells(column), self._time_ns.tolist(), strict=True))

    def _parts(self, column: int) -> bool:
        """Whether its words tell rows of one time apart: of most rows, or where times go back with them; or take turns,
        as where each place is asked at times of its own."""
        words: dict[tuple[str, str], set[str]] = {}
        for key, word in zip(self._keys, self._cells(column), strict=True):
            words.setdefault(key, set()).add(word)
        if 2 * sum(len(words[key]) > 1 for key in self._keys) >= len(self._keys) or take_turns(self._cells(column)):
            return True
        rows = [(word, at) for word, at in self._timed(column) if word and at != NO_TIME]
        times = times_by_word(rows)
        changes = [(one, other) for one, other in pairwise(rows) if one[0] != other[0]]
        back = dict.fromkeys((one[0], other[0]) for one, other in changes if one[1] > other[1])
        return any(lie_among(times[one], times[other]) for one, other in back)


def _follow_each_other(rows: list[tuple[str, int]]) -> bool:
    """Whether several words with some rows each have times of their own."""
    spans: dict[str, tuple[int, int]] = {}
    for word, at in rows:
        if at != NO_TIME:
            first, last = spans.get(word, (at, at))
            spans[word] = min(first, at), max(last, at)
    in_order = sorted(spans.values())
    apart = all(earlier[1] < later[0] for earlier, later in pairwise(in_order))
    return 1 < len(spans) <= len(rows) / 2 and apart
