"""Numbers as JSON can hold them, and as short as charts need them."""

from collections.abc import Iterable
from typing import Any

import numpy as np

STORED_DIGITS = 5
LARGEST_EXPONENT = 16  # beyond it powers of ten are no longer exact


def scalars(values: dict[str, Any]) -> dict[str, Any]:
    return {name: number(value) if isinstance(value, float) else value for name, value in values.items()}


def number(value: float | None) -> float | None:
    """A number that JSON can hold, or None."""
    return None if value is None or not np.isfinite(value) else float(value)


def numbers(values: Iterable[float]) -> list[float | None]:
    """Five significant digits are more than any chart shows, and a third of the bytes."""
    array = np.asarray(values, dtype=np.float64)
    known = np.isfinite(array)
    rounded: list[float | None] = _rounded(np.where(known, array, 0.0)).tolist()
    if not known.all():
        for place in np.flatnonzero(~known):
            rounded[place] = None
    return rounded


def _rounded(array: np.ndarray) -> np.ndarray:
    """(n,) to `STORED_DIGITS` significant digits, all at once: as texts they would take longer than the rest."""
    size = np.abs(array)
    exponent = np.floor(np.log10(size, out=np.zeros_like(size), where=size > 0.0))
    if np.any(np.abs(exponent) > LARGEST_EXPONENT):
        return np.array([float(f"{value:.{STORED_DIGITS - 1}e}") for value in array])
    scale = 10.0 ** np.abs(STORED_DIGITS - 1 - exponent)
    return np.where(exponent < STORED_DIGITS, np.rint(array * scale) / scale, np.rint(array / scale) * scale)
