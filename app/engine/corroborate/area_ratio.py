"""Singhal and Salsbury's areas: under stiction the control error rises slowly and falls at once."""

import numpy as np
from numba import njit

from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.features import ShapeWindow
from app.engine.oscillation import Oscillation
from app.engine.recording import FloatArray

METHOD = Method("area_ratio", "10.1016/j.jprocont.2004.10.001", sticky_from=1.15, healthy_to=1.05)
_FEWEST_HALF_CYCLE = 6


def area_ratio(windows: list[ShapeWindow], oscillation: Oscillation, integrating: bool | None) -> Corroboration:
    """Area before the peak of a half cycle over the area behind it, median; for self-regulating, regular loops.

    PV less its drift stands for the control error.
    """
    if not oscillation.regular:
        return METHOD.refuse("the loop does not oscillate regularly")
    if integrating:
        return METHOD.refuse("the areas of an integrating process are alike with and without stiction")
    ratios = np.concatenate([_ratios(window.pv_smooth) for window in windows])
    if len(ratios) == 0:
        return METHOD.refuse("no half cycle is long enough")
    return METHOD.answer(float(np.median(ratios)), "area before the peak of the error over the area behind it")


@njit(cache=True, nogil=True)
def _ratios(x: FloatArray) -> FloatArray:
    out = np.empty(len(x))
    count, start = 0, -1
    for i in range(1, len(x)):
        if (x[i] >= 0.0) == (x[i - 1] >= 0.0):
            continue
        if start >= 0 and i - start >= _FEWEST_HALF_CYCLE:
            half = np.abs(x[start:i])
            peak = np.argmax(half)
            before, behind = half[:peak].sum() + 0.5 * half[peak], half[peak + 1 :].sum() + 0.5 * half[peak]
            out[count] = before / behind
            count += 1
        start = i
    return out[:count]
