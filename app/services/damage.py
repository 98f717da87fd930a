"""Stored samples that cannot be read, told where somebody looks at what is left."""

from collections.abc import Sequence

from app.counting import counted
from app.services.moments import PlantClock, iso_utc, moment_of

TOLD = 3


def damage_in_words(damaged: Sequence[tuple[int, int]], clock: PlantClock) -> str:
    """From when to when (ns) what was stored cannot be read, and what to do; empty where nothing is damaged."""
    if not damaged:
        return ""
    spans = [f"{_short(clock, first)} to {_short(clock, last)}" for first, last in damaged[:TOLD]]
    more = f" and {counted(len(damaged) - TOLD, 'stretch', 'stretches')} more" if len(damaged) > TOLD else ""
    return (
        f"What was stored from {', from '.join(spans)}{more} cannot be read (the stored samples are damaged) and is "
        "left out; send its export again."
    )


def _short(clock: PlantClock, time_ns: int) -> str:
    return clock.short(iso_utc(moment_of(time_ns)))
