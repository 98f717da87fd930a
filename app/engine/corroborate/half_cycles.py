"""Half cycles between zero crossings, and how badly given wave forms fit them."""

import numpy as np

from app.engine.features.window import PER_CYCLE
from app.engine.recording import FloatArray

POINTS = 25
PHASE: FloatArray = (np.arange(POINTS) + 0.5) / POINTS
SINE: FloatArray = np.sin(np.pi * PHASE)[None, :]
_SHORTEST, _LONGEST = PER_CYCLE / 4, PER_CYCLE


def half_cycles(x: FloatArray, smooth: FloatArray) -> FloatArray:
    """(H, POINTS): the half cycles of x (n,), all turned upwards, at the phases PHASE between two zero crossings.

    smooth: (n,) x smoothed; its zero crossings are taken. Pieces shorter than a quarter of a cycle or longer than a
    whole one are no half cycles and are left out.
    """
    before = np.flatnonzero((smooth[1:] >= 0.0) != (smooth[:-1] >= 0.0))
    crossings = before + smooth[before] / (smooth[before] - smooth[before + 1])
    lengths = np.diff(crossings)
    whole = (lengths >= _SHORTEST) & (lengths <= _LONGEST)
    starts, lengths = crossings[:-1][whole], lengths[whole]
    upwards = np.where(smooth[before[:-1][whole] + 1] >= 0.0, 1.0, -1.0)
    at = starts[:, None] + lengths[:, None] * PHASE
    return upwards[:, None] * np.interp(at, np.arange(len(x)), x)


def misfit(halves: FloatArray, forms: FloatArray) -> float:
    """Sum of squares that the best of the forms (M, POINTS), at its best height, leaves of half cycles (H, POINTS)."""
    unit = forms / np.linalg.norm(forms, axis=1, keepdims=True)
    explained = np.max(np.maximum(halves @ unit.T, 0.0), axis=1) ** 2
    return float(np.sum(halves**2) - np.sum(explained))


def triangles(peaks: FloatArray) -> FloatArray:
    """(M, POINTS) triangles with their peaks at these phases (M,)."""
    peak = peaks[:, None]
    return np.minimum(PHASE / peak, (1.0 - PHASE) / (1.0 - peak))
