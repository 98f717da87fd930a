"""Fewer digits of what enters a simulation, so that it is the same loop on every machine.

The last bits of an exponential, a sine or a matrix product are those of the machine's libraries. A valve that sticks
turns them into another moment at which it slips, and a simulated loop into another one.
"""

from typing import Any, TypeVar

import numpy as np

from app.engine.recording import FloatArray

_BITS = 37

Parts = TypeVar("Parts", bound=tuple[Any, ...])


def in_eleven_digits(parts: Parts) -> Parts:
    """The same named tuple with its arrays and floats to eleven digits, whole numbers as they are."""
    return type(parts)(*(_kept(part) for part in parts))


def _kept(part: Any) -> Any:
    if isinstance(part, np.ndarray):
        return _eleven_digits(part)
    return float(_eleven_digits(np.array(part))) if isinstance(part, float) else part


def _eleven_digits(x: FloatArray) -> FloatArray:
    """x (any shape) to the eleven digits that 37 bits of its mantissa hold."""
    mantissa, exponent = np.frexp(x)
    return np.ldexp(np.rint(np.ldexp(mantissa, _BITS)), exponent - _BITS)


def in_seven_digits(signal: FloatArray) -> FloatArray:
    """signal (N,) in single precision: long ones need a wider step, so that no sample of them lies at its edge."""
    return signal.astype(np.float32).astype(np.float64)
