"""Fewer digits of what libraries compute for a simulation, so that it is the same loop on other machines.

The last bits of an exponential, a sine or a matrix product are those of the machine's libraries. A valve that sticks
turns them into another moment at which it slips, and a simulated loop into another one. What lies at the edge of a
rounding may still fall to either side: a few loops in ten thousand do.
"""

from typing import Any, TypeVar

import numpy as np

from app.engine.recording import FloatArray

_ELEVEN_DIGITS, _SEVEN_DIGITS = 37, 24

Parts = TypeVar("Parts", bound=tuple[Any, ...])


def in_eleven_digits(parts: Parts) -> Parts:
    """The same named tuple with its arrays and floats to eleven digits, whole numbers as they are."""
    return type(parts)(*(_kept(part) for part in parts))


def _kept(part: Any) -> Any:
    if isinstance(part, np.ndarray):
        return _to_bits(part, _ELEVEN_DIGITS)
    return float(_to_bits(np.array(part), _ELEVEN_DIGITS)) if isinstance(part, float) else part


def in_seven_digits(signal: FloatArray) -> FloatArray:
    """signal (N,) to seven digits: in a long one a finer step would have samples at its edge, that fall to either
    side.
    """
    return _to_bits(signal, _SEVEN_DIGITS)


def _to_bits(x: FloatArray, bits: int) -> FloatArray:
    """x (any shape) with `bits` of its mantissa, whatever its size."""
    mantissa, exponent = np.frexp(x)
    return np.ldexp(np.rint(np.ldexp(mantissa, bits)), exponent - bits)
