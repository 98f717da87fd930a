"""Rows of a long table in one pass over their bytes, compiled: most of what a row says stood in an earlier one."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.ingest.numbers.kind_kernel import COMMA_BYTE, COMPILED, MINUS, ZERO, Bytes, ends_field, is_digit, kind_of

Words = NDArray[np.uint64]  # the eight bytes from each byte on
Numbers = NDArray[np.int64]
Table = NDArray[np.int32]

TIME, QUALITY, TAG, VALUE, OTHER = 0, 1, 2, 3, 4  # what stands in a column
NEW = TAG  # of `counts`
NONE = -1
WORD = 8
LINE_FEED, RETURN, QUOTE = 10, 13, 34
MOST_DIGITS = 18  # so many fit in 64 bits
EXACT = 1 << 53  # a whole number up to here over a power of ten up to 10**22 is the double next to the decimal number
POWERS = np.array([10.0**digits for digits in range(MOST_DIGITS + 1)])


@njit(**COMPILED)
def _field_end(data: Bytes, at: int, delimiter: int) -> int:
    """Where the field that begins at `at` ends; NONE where it has a quote."""
    while not ends_field(data[at], delimiter):
        if data[at] == QUOTE:
            return NONE
        at += 1
    return at


@njit(**COMPILED)
def _stands_at(data: Bytes, words: Words, at: int, delimiter: int, text: Words, start: int, end: int) -> bool:
    """Whether the field at `at` is the text from `start` to `end`. A field of less than a word is never known at the
    very start of the data, where no whole word ends with it: who asks takes it for another one."""
    length = end - start
    stop = at + length
    same = stop < len(data) and stop >= WORD and end >= WORD and ends_field(data[stop], delimiter)
    i = 0
    while same and i + WORD < length:
        same = words[at + i] == text[start + i]
        i += WORD
    if same and length:
        before = np.uint64(8 * (WORD - length) if length < WORD else 0)
        same = (words[stop - WORD] ^ text[end - WORD]) >> before == 0
    return same


@njit(**COMPILED)
def _place(text: Bytes, start: int, end: int, places: int) -> int:
    """Where a tag is looked for first in a table of so many places, a power of two (FNV-1a)."""
    found = np.uint64(14695981039346656037)
    for i in range(start, end):
        found = (found ^ np.uint64(text[i])) * np.uint64(1099511628211)
    return np.int64((found ^ (found >> np.uint64(29))) & np.uint64(places - 1))  # type: ignore[return-value]  # compiled, it is int


@njit(**COMPILED)
def fill_table(texts: Bytes, bounds: Numbers, table: Table) -> None:
    """Puts the codes of tags into a table of NONE: tag i is texts[bounds[i]:bounds[i + 1]]."""
    for code in range(len(bounds) - 1):
        place = _place(texts, bounds[code], bounds[code + 1], len(table))
        while table[place] != NONE:
            place = (place + 1) & (len(table) - 1)
        table[place] = code


@njit(**COMPILED)
def _tag_end(
    data: Bytes, words: Words, at: int, delimiter: int, texts: Words, bounds: Numbers, fresh: Numbers, code: int
) -> int:
    """Where the tag ends if that of `code` stands at `at`, else NONE."""
    new = code - len(bounds) + 1
    text, start, end = (texts, bounds[code], bounds[code + 1]) if new < 0 else (words, fresh[new, 0], fresh[new, 1])
    return at + end - start if _stands_at(data, words, at, delimiter, text, start, end) else NONE


@njit(**COMPILED)
def _looked_up(
    data: Bytes,
    words: Words,
    at: int,
    end: int,
    delimiter: int,
    texts: Words,
    bounds: Numbers,
    table: Table,
    fresh: Numbers,
    counts: Numbers,
) -> int:
    """The code of the tag data[at:end]; a new one is put into the table and into `fresh`. NONE: there is no room."""
    place = _place(data, at, end, len(table))
    while table[place] != NONE:
        if _tag_end(data, words, at, delimiter, texts, bounds, fresh, table[place]) == end:
            return table[place]
        place = (place + 1) & (len(table) - 1)
    found = counts[NEW]
    if found == len(fresh):
        return NONE
    fresh[found, 0], fresh[found, 1] = at, end
    counts[NEW] += 1
    table[place] = len(bounds) - 1 + found
    return table[place]


@njit(**COMPILED)
def _run_end(
    data: Bytes, words: Words, at: int, delimiter: int, row: int, runs: Numbers, counts: Numbers, kind: int
) -> int:
    """Where the text at `at` ends; where it is not that of the row before, a new run begins. NONE: there is no room."""
    last = counts[kind] - 1
    if last >= 0:
        start, end = runs[kind, last, 1], runs[kind, last, 2]
        if _stands_at(data, words, at, delimiter, words, start, end):
            return at + end - start
    end = _field_end(data, at, delimiter)
    if end == NONE or last + 1 == runs.shape[1]:
        return NONE
    runs[kind, last + 1, 0], runs[kind, last + 1, 1], runs[kind, last + 1, 2] = row, at, end
    counts[kind] += 1
    return end


@njit(**COMPILED)
def _number_at(data: Bytes, at: int, decimal_mark: int) -> tuple[int, float, int]:
    """Where the decimal number at `at` ends, itself, NaN where none stands, and its kind, 0 there. NONE where it is
    written otherwise or too long to be exact."""
    negative = data[at] == MINUS
    at += negative
    start, first, whole, decimals = at, data[at], 0, 0
    while is_digit(data[at]) and at - start <= MOST_DIGITS:
        whole = 10 * whole + (data[at] - ZERO)
        at += 1
    digits = at - start
    if digits and data[at] == decimal_mark:
        at += 1
        start = at
        while is_digit(data[at]) and at - start <= MOST_DIGITS:
            whole = 10 * whole + (data[at] - ZERO)
            at += 1
        decimals = at - start
        if not decimals:
            at = NONE
    if digits + decimals > MOST_DIGITS or whole > EXACT or (negative and not digits):
        at, decimals = NONE, 0
    value = whole / POWERS[decimals] if digits else np.nan
    kind = kind_of(first, digits, decimals, decimal_mark == COMMA_BYTE) if digits else 0
    return at, -value if negative else value, kind


@njit(**COMPILED)
def read_rows(
    data: Bytes,
    words: Words,
    marks: tuple[int, int],
    columns: Numbers,
    texts: Words,
    bounds: Numbers,
    table: Table,
    codes: NDArray[np.uint32],
    values: NDArray[np.float64],
    kinds: NDArray[np.uint8],
    fresh: Numbers,
    runs: Numbers,
    counts: Numbers,
) -> bool:
    """Whether all lines of `data`, the last of them ended too, are plain rows; what stands in them.

    marks: delimiter and decimal mark. columns: what stands in each. texts, bounds, table: the known tags, as for
    `fill_table`; new ones come into the table. Written: codes, values (n,) of the rows, NaN where no value stands;
    kinds (known + m,) of each tag's values; fresh (m, 2): where new tags stand in the data, their codes follow the
    known ones; runs (2, k, 3): of rows one after the other with one time, and with one quality, the first row and
    where it stands; counts (3,) of both and of new tags.
    """
    delimiter, decimal_mark = marks
    counts[:] = 0
    row, at, code = 0, 0, len(bounds) - 2
    while at < len(data):
        kind_of_value = 0
        for column in range(len(columns)):
            kind, start = columns[column], at
            if kind == TAG:
                tags = len(bounds) - 1 + counts[NEW]
                code = code + 1 if code + 1 < tags else 0  # scans repeat their order
                at = _tag_end(data, words, start, delimiter, texts, bounds, fresh, code) if tags else NONE
                if at == NONE:
                    at = _field_end(data, start, delimiter)
                    if at <= start:
                        return False
                    code = _looked_up(data, words, start, at, delimiter, texts, bounds, table, fresh, counts)
                    at = NONE if code == NONE else at
                codes[row] = code
            elif kind in (TIME, QUALITY):
                at = _run_end(data, words, start, delimiter, row, runs, counts, kind)
            elif kind == VALUE:
                at, values[row], kind_of_value = _number_at(data, start, decimal_mark)
            else:
                at = _field_end(data, start, delimiter)
            if at == NONE:
                return False
            last = column == len(columns) - 1
            at += last and data[at] == RETURN and at + 1 < len(data)
            if data[at] != (LINE_FEED if last else delimiter):
                return False
            at += 1
        kinds[code] |= kind_of_value
        row += 1
    return True
