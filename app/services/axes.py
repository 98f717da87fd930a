"""Where the axes of our own pictures have their marks."""

import math


def ticks(low: float, high: float, parts: int = 4) -> list[float]:
    """Round numbers from low to high, low below high, 1, 2 or 5 times a power of ten apart. parts: so many, at most."""
    wanted = (high - low) / parts
    power = 10.0 ** math.floor(math.log10(wanted))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= wanted)
    # The ends themselves are marked, whatever rounding does to them.
    return [k * step for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]
