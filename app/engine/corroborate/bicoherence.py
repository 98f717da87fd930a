"""Choudhury's higher-order statistics: phase coupling in PV, a nonlinearity somewhere in the loop."""

from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.features import Features

METHOD = Method("bicoherence", "10.1016/j.automatica.2004.03.022", sticky_from=0.1, healthy_to=0.03)


def bicoherence(features: Features, windows: int) -> Corroboration:
    """Mean squared bicoherence of PV above that of noise. It finds a nonlinearity, not which one.

    Stands for NGI and NLI: the excess is what NGI tests, and it is 0 for Gaussian noise and for linear loops.
    """
    statistic = features.named("pv_bicoherence")
    if windows == 0 or statistic == 0.0:
        return METHOD.refuse("the record is too short to average over segments")
    return METHOD.answer(statistic, "squared bicoherence of PV above that of noise")
