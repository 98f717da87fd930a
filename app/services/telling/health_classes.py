"""Where the health of a loop is told apart at a glance: by the bars of the pages, the treemap and the table."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, get_args

from app.storage.asked_rows import HealthRange

HEALTH_LIMITS = (60.0, 80.0)
"""A class reaches up to its limit, and the next one begins there."""

HealthClass = Literal["low", "middle", "high", "not_evaluated"]


def health_words(least: float | None, below: float | None) -> str:
    if below is None:
        return "not evaluated" if least is None else f"{least:g} or more"
    return f"below {below:g}" if least is None else f"{least:g} to {below:g}"


_LOW, _HIGH = HEALTH_LIMITS
_BOUNDS = (HealthRange(None, _LOW), HealthRange(_LOW, _HIGH), HealthRange(_HIGH, None), HealthRange(None, None))
BOUNDS: Mapping[str, HealthRange] = MappingProxyType(dict(zip(get_args(HealthClass), _BOUNDS, strict=True)))
HEALTH_WORDS: Mapping[str, str] = MappingProxyType({name: health_words(*bounds) for name, bounds in BOUNDS.items()})
