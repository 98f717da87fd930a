"""The regular levels of a signal that was rounded."""

import numpy as np

from app.engine.recording import FloatArray

ROUNDED = 0.55  # of a level: as far as rounding moves a value, and a little more


def level_spacing(pv: FloatArray) -> float:
    """The spacing of the levels that PV takes, or 0 where it takes no regular levels."""
    levels = np.unique(pv)
    if not 3 <= len(levels) < 0.5 * len(pv):
        return 0.0
    gaps = _gaps(levels)
    step = float(np.min(gaps))
    regular = gaps[gaps < 1.6 * np.quantile(gaps, 0.3)]
    if step < 0.6 * float(np.median(regular)):
        step = float(np.median(regular))
    else:
        step = float(np.mean(regular[np.abs(regular / step - 1.0) < 0.2]))
    return step if _whole_steps_apart(pv, step) else 0.0


def decimals_of(signal: FloatArray) -> float:
    """The least step of a signal (N,) where all its values are whole steps apart, or 0: what it was rounded to, however
    few of the levels it takes.
    """
    gaps = _gaps(np.unique(signal))
    step = float(np.min(gaps)) if len(gaps) else 0.0
    return step if step > 0.0 and _whole_steps_apart(signal, step) else 0.0


def _gaps(levels: FloatArray) -> FloatArray:
    """Between neighbouring levels (M,), increasing; what is less is one level, twice by rounding."""
    gaps = np.diff(levels)
    return gaps[gaps > 1e-9 * (levels[-1] - levels[0])]


def _whole_steps_apart(signal: FloatArray, step: float) -> bool:
    places = (signal - np.min(signal)) / step
    return bool(np.mean(np.abs(places - np.round(places)) < 0.15) > 0.97)


def rounded_off(signal: FloatArray, left: FloatArray) -> bool:
    """Whether what a model leaves (N,) of a signal (N,) is no more than the signal's rounding to levels."""
    return bool(np.quantile(np.abs(left), 0.98) <= ROUNDED * level_spacing(signal))
