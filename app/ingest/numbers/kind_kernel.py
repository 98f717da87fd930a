"""What the fields of columns look like, in one pass over their bytes, compiled."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.ingest.numbers.kind_codes import COMMA, DOUBTFUL_COMMA, DOUBTFUL_POINT, OTHER, POINT, WHOLE, WORD

Bytes = NDArray[np.uint8]

# Nothing is made here, so nothing is counted either: counting arrays at each call took two thirds of the time.
COMPILED: dict[str, Any] = {"cache": True, "nogil": True, "_nrt": False}
LINE_FEED, RETURN, PLUS, COMMA_BYTE, MINUS, POINT_BYTE, ZERO, NINE, ASCII = 10, 13, 43, 44, 45, 46, 48, 57, 128


@njit(**COMPILED)
def ends_field(byte: int, delimiter: int) -> bool:
    return byte in (delimiter, LINE_FEED, RETURN)


@njit(**COMPILED)
def is_digit(byte: int) -> bool:
    return ZERO <= byte <= NINE


@njit(**COMPILED)
def kind_of(first: int, digits: int, decimals: int, comma: bool) -> int:
    """The kind of a number of so many digits, its first one and its mark, as `marks.before_decimals` and
    `marks.DOUBTFUL` tell them apart."""
    if not decimals:
        return WHOLE
    if decimals != 3 or digits > 3 or (digits == 1 and first == ZERO):
        return COMMA if comma else POINT
    if first == ZERO:
        return OTHER
    return DOUBTFUL_COMMA if comma else DOUBTFUL_POINT


@njit(**COMPILED)
def _past_digits(data: Bytes, at: int) -> int:
    while is_digit(data[at]):
        at += 1
    return at


@njit(**COMPILED)
def _of_text(data: Bytes, at: int, delimiter: int) -> tuple[int, int]:
    """Where the field that begins at `at` ends, and its kind, which is no number."""
    kind = WORD
    while not ends_field(data[at], delimiter):
        if is_digit(data[at]) or data[at] in (COMMA_BYTE, POINT_BYTE) or data[at] >= ASCII:
            kind = OTHER
        at += 1
    return at, kind


@njit(**COMPILED)
def _of_field(data: Bytes, start: int, delimiter: int) -> tuple[int, int]:
    """Where the field that begins at `start` ends, and its kind."""
    whole = start + (data[start] == MINUS or data[start] == PLUS)
    at = _past_digits(data, whole)
    digits, decimals, comma = at - whole, 0, data[at] == COMMA_BYTE
    if data[at] != delimiter and (comma or data[at] == POINT_BYTE):
        at = _past_digits(data, at + 1)
        decimals = at - whole - digits - 1
        if not decimals:
            return _of_text(data, start, delimiter)
    if not digits or not ends_field(data[at], delimiter):
        return _of_text(data, start, delimiter)
    return at, kind_of(data[whole], digits, decimals, comma)


@njit(**COMPILED)
def column_kinds(data: Bytes, delimiter: int, kinds: NDArray[np.uint8]) -> bool:
    """Whether no line of `data`, the last of them ended too, has more fields than there are `kinds`; these get what
    stands in the fields that are not empty."""
    at, column = 0, 0
    while at < len(data):
        if column == len(kinds):
            return False
        if not ends_field(data[at], delimiter):
            at, kind = _of_field(data, at, delimiter)
            kinds[column] |= kind
        column += 1
        if data[at] == RETURN:
            at += 1
            if at == len(data) or data[at] != LINE_FEED:
                return False
        if data[at] == LINE_FEED:
            column = 0
        at += 1
    return True
