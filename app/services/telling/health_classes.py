"""Where the health of a loop is told apart at a glance: by the bars of the pages, the treemap and the table."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple, get_args

HEALTH_LIMITS = (60.0, 80.0)
"""A class reaches up to its limit, and the next one begins there."""

HealthClass = Literal["low", "middle", "high", "not_evaluated"]


class Bounds(NamedTuple):
    """From where on and below where; None: no bound on that side. Both None: not evaluated."""

    least: float | None
    below: float | None


def health_words(least: float | None, below: float | None) -> str:
    if below is None:
        return "not evaluated" if least is None else f"{least:g} or more"
    return f"below {below:g}" if least is None else f"{least:g} to {below:g}"


_LOW, _HIGH = HEALTH_LIMITS
_BOUNDS = (Bounds(None, _LOW), Bounds(_LOW, _HIGH), Bounds(_HIGH, None), Bounds(None, None))
BOUNDS: Mapping[str, Bounds] = MappingProxyType(dict(zip(get_args(HealthClass), _BOUNDS, strict=True)))
HEALTH_WORDS: Mapping[str, str] = MappingProxyType({name: health_words(*bounds) for name, bounds in BOUNDS.items()})
