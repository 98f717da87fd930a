"""Which column, of those that are no signals, has another word or number in rows than in those that they contradict."""

import re
from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.columns.names import QUALITY_NAMES, SKIPPED_NAMES
from app.ingest.columns.of_words import OF_THE_PROCESS, states_among
from app.ingest.columns.plain_names import plain
from app.ingest.columns.plans import LongPlan, Plan, ValueColumn
from app.ingest.columns.time_names import TIME_NAMES
from app.ingest.files.head import Head
from app.ingest.numbers.units import is_unit
from app.ingest.tags.grouping import place

_ALL = 0.98  # of the rows that contradict others, at least
_MOST_PLACES, _MOST_NUMBERS = 64, 20  # words, or whole numbers, that tell rows apart; remarks and counts are more
_MOST_ASKED = 100  # columns of numbers of no signal
_WHOLE = r"^[+-]?\d+([.]0*)?$"
_NUMBER = r"^[+-]?\d+([.,]\d*)?([eE][+-]?\d+)?$"
_OF_THE_VALUE = re.compile(
    "qualit|status|flag|valid|version|revision|descri|beschreib|comment|komment|remark|bemerk|note|reason|annotat|"
    "user|operator|author|shift|schicht|export|import|load|edit|modif|correct|archiv|batch|charge|grade|recipe|created"
)
"""In names of columns of what is said of a value, or of who said it: corrected ones have others."""
_OF_THE_TIME = re.compile(
    "time|zeit|zone|dst|season|daylight|offset|milli|micro|nano|msec|fraction|hour|minute|second|sequence|seqno"
)
"""In names of columns that tell more of a time than its stamp."""
_OF_CORRECTIONS = frozenset(("original", "corrected", "correction", "raw", "validated", "edited", "manual", "archive"))
_SHORT_OF_THE_TIME = frozenset(("ms", "us", "ns", "tz", "seq", "rev", "no", "nr"))


def asked_columns(plan: Plan, head: Head) -> dict[int, str]:
    """Those that may tell rows apart, with their names: not read, or read beside the signals as further ones."""
    beside = [column.index for column in _beside(plan) if place(column.tag, "").signal == "OTHER"][:_MOST_ASKED]
    unread = [index for index in range(plan.width) if index not in plan.read]
    names = {at: _name_above(head, plan.first_row, at) for at in sorted({*unread, *beside})}
    return {at: name for at, name in names.items() if _may_tell(name)}


def _name_above(head: Head, first_row: int, column: int) -> str:
    return next((row[column] for row in head.rows[:first_row][::-1] if column < len(row) and row[column]), "")


def _beside(plan: Plan) -> Sequence[ValueColumn]:
    return plan.others if isinstance(plan, LongPlan) else plan.groups[0].values


def _may_tell(name: str) -> bool:
    known = plain(name)
    if known in QUALITY_NAMES or known in TIME_NAMES or known in SKIPPED_NAMES - {""} or known in _SHORT_OF_THE_TIME:
        return False
    return not _OF_THE_VALUE.search(known) and not _OF_THE_TIME.search(known)


def parts_rows(texts: pl.Series, earlier: NDArray[np.int64], later: NDArray[np.int64]) -> bool:
    """Whether a column has other words, of few, in rows than in those that they contradict. earlier, later (k,): the
    rows of `texts`."""
    texts = texts.cast(pl.String).str.strip_chars()
    one, other = texts[earlier], texts[later]
    given = (one.str.len_bytes() > 0) & (other.str.len_bytes() > 0)
    if (given & (one != other)).fill_null(False).mean() < _ALL:  # type: ignore[operator]  # of booleans, not empty
        return False
    words = texts.drop_nulls().unique()
    return 2 * len(words) <= len(earlier) and len(words) <= _MOST_PLACES and _are_places(words)


def _are_places(words: pl.Series) -> bool:
    """Words, or whole numbers, as plants are called; states, qualities and units change with the values beside them."""
    if words.str.contains(_NUMBER).any():
        return len(words) <= _MOST_NUMBERS and bool(words.str.contains(_WHOLE).all())
    different = set(words)
    are_states = states_among(different) == different and max(map(len, different)) > 1  # plants A and M are none
    of_values = are_states or {word.lower() for word in different} <= OF_THE_PROCESS | _OF_CORRECTIONS
    return not of_values and not all(map(is_unit, words))
