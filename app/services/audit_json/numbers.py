"""Numbers as JSON can hold them, and as short as charts need them."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

STORED_DIGITS = 5
LARGEST_EXPONENT = 16  # beyond it powers of ten are no longer exact


def scalars(values: dict[str, Any]) -> dict[str, Any]:
    """Numbers of Python that are known, which most are, as they stand."""
    return {
        name: value if type(value) is float and math.isfinite(value) else _or_none(value)
        for name, value in values.items()
    }


def _or_none(value: Any) -> Any:
    return or_none(value) if isinstance(value, float) else value


def or_none(value: float | None, digits: int | None = None) -> float | None:
    """A number that JSON can hold, or None. digits: significant ones that are left (None: all)."""
    if value is None or not math.isfinite(value):
        return None
    return float(value) if digits is None else float(f"{value:.{digits}g}")


def listed(values: Iterable[float], digits: int | None = None) -> list[float | None]:
    """The same of many."""
    array = np.asarray(values, dtype=np.float64)
    known = np.isfinite(array)
    told = array if digits is None else _rounded(np.where(known, array, 0.0), digits)
    shown: list[float | None] = told.tolist()
    if not known.all():
        for place in np.flatnonzero(~known):
            shown[place] = None
    return shown


def short(values: Iterable[float]) -> list[float | None]:
    """Five significant digits are more than any chart shows, and a third of the bytes."""
    return listed(values, STORED_DIGITS)


def short_together(**series: NDArray[np.floating[Any]]) -> dict[str, list[float | None]]:
    """The same of several, by name: rounded in one go, which costs what it costs for one."""
    ends = np.cumsum([len(values) for values in series.values()])
    told = short(np.concatenate(list(series.values())))
    return {name: told[end - len(values) : end] for (name, values), end in zip(series.items(), ends, strict=True)}


def _rounded(array: np.ndarray, digits: int) -> np.ndarray:
    """(n,) to so many significant digits, all at once: as texts they would take longer than the rest."""
    size = np.abs(array)
    exponent = np.floor(np.log10(size, out=np.zeros_like(size), where=size > 0.0))
    if np.any(np.abs(exponent) > LARGEST_EXPONENT):
        return np.array([float(f"{value:.{digits - 1}e}") for value in array])
    scale = 10.0 ** np.abs(digits - 1 - exponent)
    return np.where(exponent < digits, np.rint(array * scale) / scale, np.rint(array / scale) * scale)
