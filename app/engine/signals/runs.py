"""Where a mask is True without a break."""

import numpy as np

from app.engine.recording import BoolArray, IntArray


def runs_of(mask: BoolArray) -> tuple[IntArray, IntArray]:
    """First samples (K,) of the runs of True in `mask` (N,), and those behind their last (K,)."""
    edges = np.diff(np.concatenate(([0], mask.astype(np.int8), [0])))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
