"""Singhal and Salsbury's areas: after a stuck valve has slipped, the control error rises and falls differently."""

import numpy as np

from app.engine.corroborate.case import FEWEST_HALF_CYCLES, Case
from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.corroborate.half_cycles import PHASE, POINTS
from app.engine.recording import FloatArray
from app.engine.signals.sampled import ROUNDING

METHOD = Method(
    "area_ratio",
    threshold=1.1,
    source="Singhal, Salsbury 2005, J. Process Control 15, 371-382",
)


def area_ratio(case: Case) -> Corroboration:
    """R = area of the control error before the peak of its half cycle over the area behind it.

    For loops with a self-regulating process that oscillate regularly: R = 1 under aggressive tuning, R > 1 under
    stiction. The source leaves the margin above 1 open (here 0.1), and how half cycles are joined (here the sums of
    the areas over all of them). PV less its drift stands for the control error. Misleads on noisy records, where the
    peak wanders, and on processes with a long dead time.
    """
    if case.why_not_self_regulating:
        return METHOD.refuse(case.why_not_self_regulating)
    halves = case.pv_halves
    if len(halves) < FEWEST_HALF_CYCLES:
        return METHOD.refuse(f"{len(halves)} whole half cycles in PV, needed {FEWEST_HALF_CYCLES}")
    return METHOD.answer(_ratio(halves), f"area before the peak of the error over the area after it{case.assumed}")


def _ratio(halves: FloatArray) -> float:
    # Equal heights (a coarse transmitter) are told apart by rounding only: the peak is in their middle.
    highest = halves >= halves.max(axis=1, keepdims=True) - ROUNDING
    peak = (np.sum(highest * PHASE, axis=1) / np.sum(highest, axis=1))[:, None]
    # The sample in which the peak falls belongs to both sides by halves, so that a sine gives 1.
    before = np.clip((peak - PHASE) * POINTS + 0.5, 0.0, 1.0)
    area = np.maximum(halves, 0.0)
    return float(np.sum(area * before) / (np.sum(area * (1.0 - before)) + 1e-12))
