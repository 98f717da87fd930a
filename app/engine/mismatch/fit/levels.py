"""The regular levels of a signal that was rounded."""

import numpy as np

from app.engine.recording import FloatArray

ROUNDED = 0.55  # of a level: as far as rounding moves a value, and a little more


def level_spacing(pv: FloatArray) -> float:
    """The spacing of the levels that PV takes, or 0 where it takes no regular levels."""
    levels = np.unique(pv)
    if not 3 <= len(levels) < 0.5 * len(pv):
        return 0.0
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9 * (levels[-1] - levels[0])]  # less is one level, twice by rounding
    step = float(np.min(gaps))
    regular = gaps[gaps < 1.6 * np.quantile(gaps, 0.3)]
    if step < 0.6 * float(np.median(regular)):
        step = float(np.median(regular))
    else:
        step = float(np.mean(regular[np.abs(regular / step - 1.0) < 0.2]))
    places = (pv - levels[0]) / step
    fits = np.abs(places - np.round(places)) < 0.15
    return step if np.mean(fits) > 0.97 else 0.0


def resolution(signal: FloatArray) -> float:
    """The least step of a signal (N,) where all its values are whole steps apart, or 0: what it was rounded to, however
    few of the levels it takes.
    """
    levels = np.unique(signal)
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9 * (levels[-1] - levels[0])]
    if len(gaps) == 0:
        return 0.0
    step = float(np.min(gaps))
    places = (signal - levels[0]) / step
    return step if np.mean(np.abs(places - np.round(places)) < 0.15) > 0.97 else 0.0


def rounded_off(signal: FloatArray, left: FloatArray) -> bool:
    """Whether what a model leaves (N,) of a signal (N,) is no more than the signal's rounding to levels."""
    return bool(np.quantile(np.abs(left), 0.98) <= ROUNDED * level_spacing(signal))
