"""Hägglund's shape analysis: PV of a sticky self-regulating loop is nearer to a square wave than to a sine."""

import numpy as np

from app.engine.corroborate.case import FEWEST_HALF_CYCLES, Case
from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.corroborate.half_cycles import POINTS, SINE, misfit

METHOD = Method(
    "shape_analysis",
    threshold=0.0,
    source="Hägglund 2011, Control Engineering Practice 19, 782-789",
)
_SQUARE = np.ones((1, POINTS))


def shape_analysis(case: Case) -> Corroboration:
    """(V_sine - V_square) / (V_sine + V_square) on half cycles of PV, V the sums of squares of the misfits.

    For loops with a self-regulating process that oscillate regularly. Above 0 stiction, else not. The level about
    which half cycles are counted is the set point in the source, and PV less its drift here. Misleads where the process
    is slow against the oscillation and rounds the square off.
    """
    if case.why_not_self_regulating:
        return METHOD.refuse(case.why_not_self_regulating)
    halves = case.pv_halves
    if len(halves) < FEWEST_HALF_CYCLES:
        return METHOD.refuse(f"{len(halves)} whole half cycles in PV, needed {FEWEST_HALF_CYCLES}")
    sine, square = misfit(halves, SINE), misfit(halves, _SQUARE)
    return METHOD.answer((sine - square) / (sine + square + 1e-12), f"square against sine on PV{case.assumed}")
