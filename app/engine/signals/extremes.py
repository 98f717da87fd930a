"""Which samples a line through few of many must have, so that no peak of it is lost."""

from collections.abc import Sequence

import numpy as np

from app.engine.recording import FloatArray, IntArray


def extremes(signals: Sequence[FloatArray], n: int, points: int) -> IntArray:
    """Where each signal is least and greatest in each of the stretches into which the samples are cut; in order, each
    once, with the first and the last sample. Where `points` has no room for all signals, of the first ones alone.

    signals: (n,) each, n at least 1, NaN where a value is missing. points: so many samples in all at most, at least 2.
    """
    pairs = (points - 2) // 2
    signals = signals[:pairs]
    buckets = max(1, pairs // max(1, len(signals)))
    edges = np.linspace(0, n, buckets + 1).astype(np.int64)
    width = int(np.max(np.diff(edges)))
    # The last column repeats samples of the next stretch where a stretch is one shorter; repeated places fall away.
    places = np.minimum(edges[:-1, None] + np.arange(width)[None, :], n - 1)
    rows = np.arange(buckets)
    found = [np.zeros(1, np.int64), np.full(1, n - 1)]
    for signal in signals:
        values = signal[places]
        found.append(places[rows, np.argmin(np.where(np.isnan(values), np.inf, values), axis=1)])
        found.append(places[rows, np.argmax(np.where(np.isnan(values), -np.inf, values), axis=1)])
    return np.unique(np.concatenate(found))
