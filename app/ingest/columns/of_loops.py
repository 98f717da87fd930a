"""Which columns have the names of loops, in tables with several signals of a loop, or the word of one, in each row."""

import re
from collections.abc import Sequence
from itertools import pairwise

import polars as pl

from app.ingest.columns.clocks import MOST, joined_stamp
from app.ingest.columns.names import TAG_NAMES, plain
from app.ingest.columns.of_words import are_states
from app.ingest.files.head import Head, is_number
from app.ingest.model import IngestOptions, TimeArray
from app.ingest.times.stamps import NO_TIME, TimeForm, TimeReader

LOOP_NAMES = frozenset(("loop", "loopname", "loopid", "looptag"))
_NAMES = (
    LOOP_NAMES
    | TAG_NAMES
    | {"controller", "controllername", "block", "blockname"}
    | {"element", "elementname", "elementpath", "asset", "assetname", "device", "deviceid", "devicename"}
)
_OF_ANYTHING = frozenset(("series", "item", "itemid", "name", "variable", "varname"))
"""Names of columns that may have batches as well."""
_CONTROLLER = re.compile(r"(?i)[A-Z]*C[A-Z]?[-_. ]?\d|loop")  # FIC101, 10-PDC-12, Loop 3


def columns_of_loops(
    head: Head, names: tuple[str, ...], first_row: int, columns: Sequence[int], in_words: bool
) -> list[int]:
    """Of some columns those of loops, first those that are called so. in_words: beside a column of the words of
    signals, where what stands under the name of a tag is a loop without a digit in it too."""
    filled = MOST * sum(any(row) for row in head.rows[first_row:])
    fields = {index: head.column(index, first_row) for index in columns}
    found = [
        index
        for index, own in fields.items()
        if own and len(own) >= filled and _names_loops(head, plain(names[index]), own, in_words)
    ]
    return sorted(found, key=lambda index: plain(names[index]) not in LOOP_NAMES)


def _names_loops(head: Head, name: str, fields: list[str], in_words: bool) -> bool:
    """Numbers are names of loops where they are called so alone, and repeat. Under another name most words have a
    digit, and none is a mode or a quality: it may be of operators, products or remarks."""
    if name not in _NAMES:
        return False
    if all(is_number(text, head.decimal_mark) for text in fields):
        return name in LOOP_NAMES and 2 * len(set(fields)) <= len(fields)
    words = set(fields)
    if name in LOOP_NAMES or are_states(words):
        return name in LOOP_NAMES
    return in_words or 2 * sum(any(map(str.isdigit, word)) for word in words) > len(words)


def without_batches(
    head: Head,
    names: tuple[str, ...],
    first_row: int,
    loops: Sequence[int],
    times: tuple[tuple[int, ...], TimeForm],
    options: IngestOptions,
) -> list[int]:
    """The columns of loops but those whose words follow each other in time, as batches do: under a name that may be of
    anything, and where not most of them are called as controllers are."""
    asked = [index for index in loops if plain(names[index]) in _OF_ANYTHING]
    return [index for index in loops if index not in asked or not _are_batches(head, first_row, index, times, options)]


def _are_batches(
    head: Head, first_row: int, column: int, times: tuple[tuple[int, ...], TimeForm], options: IngestOptions
) -> bool:
    time, form = times
    rows = [row for row in head.rows[first_row:] if len(row) > max(column, *time) and row[column]]
    words = [row[column] for row in rows]
    if 2 * sum(bool(_CONTROLLER.search(word)) for word in set(words)) > len(set(words)):
        return False
    stamps = pl.Series([joined_stamp([row[index] for index in time]) for row in rows], dtype=pl.String)
    return _follow_each_other(words, TimeReader(form, options).read(stamps))


def _follow_each_other(words: list[str], time_ns: TimeArray) -> bool:
    """Whether several words with some rows each have times of their own."""
    spans: dict[str, tuple[int, int]] = {}
    for word, at in zip(words, time_ns.tolist(), strict=True):
        if at != NO_TIME:
            first, last = spans.get(word, (at, at))
            spans[word] = min(first, at), max(last, at)
    in_order = sorted(spans.values())
    apart = all(earlier[1] < later[0] for earlier, later in pairwise(in_order))
    return 1 < len(spans) <= len(words) / 2 and apart
