"""A sensor that measures once an interval and shows its last result until the next: an analyser, or a historian that
holds what it scanned.

Its pattern is found in PV alone (`mismatch.compare.sampling`). Between its instants PV says nothing, so the comparison
is made at these; what is simulated at a shorter interval is sampled and held alike.
Source: the sampler with a zero-order hold of Ragazzini, Zadeh 1952, doi 10.1109/TAI.1952.6371274.
"""

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, no_scan
from app.engine.recording import FloatArray


def _hold_time(context: Context) -> tuple[Parameter, ...]:
    ts = context.record.sampling_interval_s
    return (Parameter("interval", "s", ts, context.record.duration_s, ts),)


def _sampled_and_held(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """The signal (N,) at multiples of the interval from the record's start, each shown until the next."""
    every = max(float(values[0]) / context.record.sampling_interval_s, 1.0)
    taken = np.round(every * np.arange(int((len(signal) - 1) / every) + 1)).astype(np.int64)
    return signal[taken[np.searchsorted(taken, np.arange(len(signal)), side="right") - 1]]


SAMPLE_HOLD = Block(
    "sensor.sample_hold", "sensor", "sensor", "always", _hold_time, no_scan, apply=_sampled_and_held, form="pattern"
)
