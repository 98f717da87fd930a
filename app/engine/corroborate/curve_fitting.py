"""He's curve fitting: behind the valve the first integrator makes a triangle of a stuck valve's square wave."""

import numpy as np

from app.engine.corroborate.case import FEWEST_HALF_CYCLES, Case
from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.corroborate.half_cycles import SINE, misfit, triangles

METHOD = Method(
    "curve_fitting",
    threshold=0.6,
    lower=0.4,
    source="He, Wang, Pottmann, Qin 2007, Ind. Eng. Chem. Res. 46, 4549-4560",
    doi="10.1021/ie061219a",
)
_TRIANGLES = triangles(np.linspace(0.1, 0.9, 17))


def curve_fitting(case: Case) -> Corroboration:
    """SI = MSE_sine / (MSE_sine + MSE_triangle) on OP, or on PV of an integrating process.

    For loops that oscillate regularly under a controller with integral action. Above 0.6 stiction, below 0.4 not,
    undecided between. The source fits half cycle by half cycle between zero crossings, the peak of the triangle being
    free. It leaves the filter open: here zero crossings are taken from the smoothed signal, and the fit from the signal
    as it is. Misleads where half cycles are askew or noisy: the triangle, whose peak is free, follows them better than
    the sine does.
    """
    if case.why_not:
        return METHOD.refuse(case.why_not)
    signal, halves = ("PV", case.pv_halves) if case.integrating else ("OP", case.op_halves)
    if len(halves) < FEWEST_HALF_CYCLES:
        return METHOD.refuse(f"{len(halves)} whole half cycles in {signal}, needed {FEWEST_HALF_CYCLES}")
    sine, triangle = misfit(halves, SINE), misfit(halves, _TRIANGLES)
    index = sine / (sine + triangle + 1e-12)
    return METHOD.answer(index, f"triangle against sine on {signal}{case.assumed}")
