"""Signals in few bytes: most are decimal numbers of few digits, which double precision spreads over all its bits."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby, islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

AS_IT_IS, SINGLE = "d", "f"
DIGITS = "0123456"  # decimals after the point
POWERS = tuple(10.0**digits for digits in range(len(DIGITS)))
PROBED = 8
TOGETHER = 24  # signals of a day: their numbers stay near the processor
GREATEST = 2**31 - 1
MISSING = np.int32(-(2**31))


def coded(values: FloatArray) -> tuple[str, bytes]:
    """How the values are written and the bytes: whole numbers of a power of ten where that gives every value again
    (-0.0 as 0.0), else single precision where that does, else as they are."""
    missing = np.isnan(values)
    with np.errstate(over="ignore"):
        decimal = _decimal_with_gaps(values, missing) if missing.any() else _decimal(values)
        if decimal is not None:
            return str(decimal[0]), shuffled(decimal[1])
        single = values.astype("<f4")
    if np.array_equal(single, values, equal_nan=True):
        return SINGLE, shuffled(single)
    return AS_IT_IS, shuffled(np.ascontiguousarray(values, dtype="<f8"))


def coded_each(signals: Iterable[FloatArray]) -> Iterator[tuple[str, bytes]]:
    """What `coded` gives of each. Signals of one length, one behind the other, are coded together: for a day of
    samples the calls take longer than the numbers."""
    for _, alike in groupby(signals, len):
        while some := list(islice(alike, TOGETHER)):
            yield from _coded_together(some) if len(some) > 1 and len(some[0]) else map(coded, some)


def decoded(coding: str, raw: bytes) -> FloatArray:
    if coding == AS_IT_IS:
        return unshuffled(raw, "<f8")
    if coding == SINGLE:
        return unshuffled(raw, "<f4").astype(np.float64)
    whole = unshuffled(raw, "<i4")
    values = whole / 10.0 ** int(coding)
    values[whole == MISSING] = np.nan
    return values


def width(coding: str) -> int:
    """Bytes a value."""
    return 8 if coding == AS_IT_IS else 4


def shuffled(column: NDArray[np.generic]) -> bytes:
    """Bytes of equal weight side by side: what zstd presses best."""
    return np.ascontiguousarray(column).view(np.uint8).reshape(-1, column.itemsize).T.tobytes()


def unshuffled(raw: bytes, kind: str) -> NDArray[Any]:
    size = np.dtype(kind).itemsize
    return np.ascontiguousarray(np.frombuffer(raw, np.uint8).reshape(size, -1).T).reshape(-1).view(kind)


def _coded_together(signals: Sequence[FloatArray]) -> list[tuple[str, bytes]]:
    """The same for signals of one length; those that are no decimals, or need more of them than some of their values
    tell, are coded one by one."""
    matrix = np.array(signals)
    digits = _digits_of_each(matrix[:, :: max(1, matrix.shape[1] // PROBED)])
    powers = np.array(POWERS)[digits][:, None]
    with np.errstate(over="ignore", invalid="ignore"):
        whole = np.rint(matrix * powers)
        exact = (whole / powers == matrix).all(axis=1)
        exact &= np.maximum(whole.max(axis=1), -whole.min(axis=1)) <= GREATEST
        raw = _shuffled_rows(whole.astype("<i4"))
    return [
        (str(digit), row.tobytes()) if fits else coded(values)
        for values, digit, row, fits in zip(signals, digits.tolist(), raw, exact.tolist(), strict=True)
    ]


def _digits_of_each(probes: FloatArray) -> NDArray[np.intp]:
    """(k,) the fewest decimals that give all values of a row of `probes` again; 0 where none do."""
    powers = np.array(POWERS)[:, None, None]
    with np.errstate(over="ignore", invalid="ignore"):
        return (np.rint(probes * powers) / powers == probes).all(axis=2).argmax(axis=0)


def _shuffled_rows(whole: NDArray[np.int32]) -> NDArray[np.uint8]:
    """(k, 4, n): `shuffled` of each row."""
    raw = np.empty((len(whole), 4, whole.shape[1]), dtype=np.uint8)
    for place in range(4):
        np.right_shift(whole, 8 * place, out=raw[:, place], casting="unsafe")
    return raw


def _decimal(values: FloatArray) -> tuple[int, NDArray[np.int32]] | None:
    """The fewest decimals that give every value again, and the values in units of the last of them."""
    for digits in _likely(values[:: max(1, len(values) // PROBED)]):
        power = POWERS[digits]
        whole = np.rint(values * power)
        if (whole / power == values).all() and (not len(whole) or max(whole.max(), -whole.min()) <= GREATEST):
            return digits, whole.astype("<i4")
    return None


def _decimal_with_gaps(values: FloatArray, missing: NDArray[np.bool_]) -> tuple[int, NDArray[np.int32]] | None:
    found = _decimal(values[~missing])
    if found is None:
        return None
    placed = np.full(len(missing), MISSING, dtype="<i4")
    placed[~missing] = found[1]
    return found[0], placed


def _likely(probe: FloatArray) -> range:
    """Numbers of decimals that may give all values again, by some of them, the fewest first."""
    digits = 0
    for value in probe.tolist():
        while digits < len(DIGITS) and not _is_whole(value, POWERS[digits]):
            digits += 1
    return range(digits, len(DIGITS))


def _is_whole(value: float, power: float) -> bool:
    """Whether a value is a whole number of 1 / power."""
    return abs(value * power) <= GREATEST and round(value * power) / power == value
