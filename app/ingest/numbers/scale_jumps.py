"""Values that jump by a power of ten and go on so, as where a unit or a range changes inside of a record, and shares
beside values in per cent."""

from dataclasses import dataclass

import numpy as np

from app.ingest.model import FloatArray, SignalBlock
from app.ingest.telling import first_of

LEAST_DECADES, TOLERANCE_DECADES = 2, 0.2
"""Of what is told, and how far level and noise may each be from whole ones."""
WINDOW, FEWEST = 100, 20  # samples before and behind a jump that are asked
LEAST = 10.0 ** (LEAST_DECADES - 2 * TOLERANCE_DECADES)  # from one sample to the next
MOST_JUMPS = 4  # of a tag: what jumps more often does so by itself
FEWEST_SHARES = 3  # without a % behind them
LEAST_RATIO = 30.0  # of values in per cent to shares
_SHOWN = 5


@dataclass(frozen=True)
class ScaleJump:
    """At `time_ns` values become `decades` powers of ten as large."""

    time_ns: int
    decades: int


def scale_jump(block: SignalBlock) -> ScaleJump | None:
    """The first one of a signal: its level and the size of its steps from sample to sample change alike and at once.
    A process that starts changes one of them, or both in other ratios."""
    sizes = np.abs(block.value)
    if len(sizes) < 2 * FEWEST:
        return None
    least, greatest = sizes.min(), sizes.max()
    if np.isnan(greatest):  # which takes longer
        least, greatest = np.fmin.reduce(sizes), np.fmax.reduce(sizes)
    if greatest < LEAST * least:
        return None  # most signals
    at = np.flatnonzero(sizes > 0.0)
    values, sizes = block.value[at], sizes[at]
    jumps = 1 + np.flatnonzero((sizes[1:] > LEAST * sizes[:-1]) | (sizes[:-1] > LEAST * sizes[1:]))
    if len(jumps) > MOST_JUMPS:
        return None
    bounds = [0, *jumps.tolist(), len(values)]
    for first, jump, end in zip(bounds, bounds[1:], bounds[2:], strict=False):
        if min(jump - first, end - jump) < FEWEST:
            continue
        decades = _decades(values[max(first, jump - WINDOW) : jump], values[jump : min(end, jump + WINDOW)])
        if abs(decades) >= LEAST_DECADES:
            return ScaleJump(int(block.time_ns[at[jump]]), decades)
    return None


def _decades(before: FloatArray, after: FloatArray) -> int:
    """0 where level and steps do not change alike, or nothing moves."""
    levels, steps = ([of(part) for part in (before, after)] for of in (np.median, _mean_step))
    if levels[0] * levels[1] <= 0.0 or min(steps) == 0.0:
        return 0
    ratios = np.log10([levels[1] / levels[0], steps[1] / steps[0]])
    decades = round(ratios[0])
    return decades if np.all(np.abs(ratios - decades) <= TOLERANCE_DECADES) else 0


def _mean_step(values: FloatArray) -> float:
    return float(np.mean(np.abs(np.diff(values)))) if len(values) > 1 else 0.0


def has_shares(values: FloatArray, in_per_cent: int) -> bool:
    """Whether values (n,) of which so many have a % behind them are shares where they have none, as 0.41 beside 41 %.
    Where one of those without is greater than 1, they are per cent as well."""
    sizes = np.abs(values[np.isfinite(values)])
    small, others = sizes[sizes <= 1.0], sizes[sizes > 1.0]
    bare = len(sizes) - in_per_cent
    if not FEWEST_SHARES <= bare <= len(small) or not len(others):
        return False
    return float(np.median(others)) >= LEAST_RATIO * float(np.median(small))


class ScaleJumps:
    """Takes the signals of a file as they are read."""

    def __init__(self) -> None:
        self._found: dict[str, ScaleJump] = {}
        self._shares: list[str] = []

    def look(self, block: SignalBlock, in_per_cent: int = 0) -> None:
        """in_per_cent: how many of its values have a % behind them."""
        if in_per_cent and has_shares(block.value, in_per_cent):
            self._shares.append(block.tag)
        if block.signal in ("PV", "OP", "SP") and block.tag not in self._found:
            jump = scale_jump(block)
            if jump is not None:
                self._found[block.tag] = jump

    def notes(self) -> list[str]:
        notes = []
        if self._found:
            shown = first_of([f"{tag} ({_told(jump)})" for tag, jump in self._found.items()], _SHOWN)
            notes.append(
                f"check the units, values and their noise become many times as large or small at once: {shown}"
            )
        if self._shares:
            notes.append(
                "check this first, shares such as 0.41 stand beside values with % behind them, and were read as they "
                f"stand: {first_of(self._shares, _SHOWN)}"
            )
        return notes


def _told(jump: ScaleJump) -> str:
    factor = f"{10 ** abs(jump.decades):,}"
    at = np.datetime_as_string(np.datetime64(jump.time_ns, "ns"), unit="s").replace("T", " ")
    return f"{factor if jump.decades > 0 else f'1/{factor}'} times from {at} UTC on"
