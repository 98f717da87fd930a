"""The stretch of a record over which the set point rests."""

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.sampled import correlation, medians_of_five

# A record that mostly follows its set point shows the following, not the valve: where this much of PV comes from SP...
_FOLLOWS = 0.5
# ...the longest rest of SP is looked at beside the whole, if it is long enough to show an oscillation.
_FEWEST_SAMPLES, _LEAST_SHARE = 150, 0.3
# A set point rests where it stays within this share of its whole range, but for single samples.
_STANDS = 0.01


def at_rest(record: UniformRecord) -> UniformRecord | None:
    """The longest stretch with SP at rest, where PV mostly follows SP over the whole record; else None."""
    if record.sp is None or not np.all(np.isfinite(record.sp)):
        return None
    steady = medians_of_five(record.sp)
    span = float(np.ptp(steady))
    if span <= 0.0 or correlation(record.pv, steady) ** 2 < _FOLLOWS:
        return None
    fewest = int(np.ceil(max(_FEWEST_SAMPLES, _LEAST_SHARE * record.samples)))
    part = _longest_within(steady, _STANDS * span, fewest)
    return None if part is None else record.part(part)


def _longest_within(x: FloatArray, band: float, fewest: int) -> slice | None:
    """The longest part of x (n,) that stays within `band`; None where none of `fewest` values does."""
    part = _first_within(x, band, fewest)
    shortest, too_long = fewest, len(x) + 1
    while part is not None and too_long - shortest > 1:
        length = (shortest + too_long) // 2
        longer = _first_within(x, band, length)
        shortest, too_long, part = (length, too_long, longer) if longer else (shortest, length, part)
    return part


def _first_within(x: FloatArray, band: float, length: int) -> slice | None:
    """The first part of `length` values of x (n,) that stays within `band`."""
    if length > len(x):
        return None
    ranges = maximum_filter1d(x, length) - minimum_filter1d(x, length)
    middle = length // 2
    starts = np.flatnonzero(ranges[middle : middle + len(x) - length + 1] <= band)
    return slice(int(starts[0]), int(starts[0]) + length) if len(starts) else None
