"""Where things stand in our own pictures, and where their axes have their marks."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Plane:
    """A rectangle of a picture, in px from its left upper corner, and what its axes span, from (left, lower) to (right,
    upper)."""

    left: float
    top: float
    wide: float
    tall: float
    x_span: tuple[float, float]
    y_span: tuple[float, float]

    def x(self, value: float) -> float:
        low, high = self.x_span
        return self.left + self.wide * (value - low) / ((high - low) or 1.0)

    def y(self, value: float) -> float:
        low, high = self.y_span
        return self.top + self.tall * (high - value) / ((high - low) or 1.0)

    @property
    def right(self) -> float:
        return self.left + self.wide

    @property
    def bottom(self) -> float:
        return self.top + self.tall


def ticks(low: float, high: float, parts: int = 4) -> list[float]:
    """Round numbers from low to high, low below high, 1, 2 or 5 times a power of ten apart. parts: so many, at most."""
    wanted = (high - low) / parts
    power = 10.0 ** math.floor(math.log10(wanted))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= wanted)
    # The ends themselves are marked, whatever rounding does to them.
    return [k * step for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]
