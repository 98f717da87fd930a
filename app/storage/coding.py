"""Signals in few bytes: most are decimal numbers of few digits, which double precision spreads over all its bits."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

AS_IT_IS, SINGLE = "d", "f"
DIGITS = "0123456"  # decimals after the point
POWERS = 10.0 ** np.arange(len(DIGITS))[:, None]
PROBED = 16
GREATEST = 2**31 - 1
MISSING = np.int32(-(2**31))


def coded(values: FloatArray) -> tuple[str, bytes]:
    """How the values are written and the bytes: whole numbers of a power of ten where that gives every value again
    (-0.0 as 0.0), else single precision where that does, else as they are."""
    missing = np.isnan(values)
    some = bool(missing.any())
    known = values[~missing] if some else values
    for digits in _likely(known[:: max(1, len(known) // PROBED)]):
        power = 10.0**digits
        whole = np.rint(known * power)
        if (whole / power == known).all() and (not len(whole) or max(whole.max(), -whole.min()) <= GREATEST):
            return str(digits), shuffled(_placed(whole, missing) if some else whole.astype("<i4"))
    with np.errstate(over="ignore"):
        single = values.astype("<f4")
    if np.array_equal(single, values, equal_nan=True):
        return SINGLE, shuffled(single)
    return AS_IT_IS, shuffled(np.ascontiguousarray(values, dtype="<f8"))


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


def unshuffled(raw: bytes, kind: str) -> NDArray[np.generic]:
    size = np.dtype(kind).itemsize
    return np.ascontiguousarray(np.frombuffer(raw, np.uint8).reshape(size, -1).T).reshape(-1).view(kind)


def _placed(whole: FloatArray, missing: NDArray[np.bool_]) -> NDArray[np.int32]:
    placed = np.full(len(missing), MISSING, dtype="<i4")
    placed[~missing] = whole
    return placed


def _likely(probe: FloatArray) -> range:
    """Numbers of decimals that some of the values allow, the fewest first."""
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = np.rint(probe * POWERS)
        fits = np.all((scaled / POWERS == probe) & (np.abs(scaled) <= GREATEST), axis=1)
    return range(int(np.argmax(fits)), len(DIGITS)) if np.any(fits) else range(0)
