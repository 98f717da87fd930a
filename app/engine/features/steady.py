"""The stretch of a record over which the set point rests."""

import numpy as np

from app.engine.recording import UniformRecord

# A record that mostly follows its set point shows the following, not the valve: where this much of PV comes from SP...
_FOLLOWS = 0.5
# ...the longest rest of SP is looked at beside the whole, if it is long enough to show an oscillation.
_FEWEST_SAMPLES, _LEAST_SHARE = 150, 0.3
_SAME = 1e-3


def at_rest(record: UniformRecord) -> UniformRecord | None:
    """The longest stretch with SP at rest, where PV mostly follows SP over the whole record; else None."""
    if record.sp is None or not np.all(np.isfinite(record.sp)):
        return None
    span = float(np.ptp(record.sp))
    if span <= 0.0 or np.corrcoef(record.pv, record.sp)[0, 1] ** 2 < _FOLLOWS:
        return None
    moves = np.flatnonzero(np.abs(np.diff(record.sp)) > _SAME * span) + 1
    edges = np.concatenate(([0], moves, [record.samples]))
    longest = int(np.argmax(np.diff(edges)))
    first, last = int(edges[longest]), int(edges[longest + 1])
    if last - first < max(_FEWEST_SAMPLES, _LEAST_SHARE * record.samples):
        return None
    return record.part(slice(first, last))
