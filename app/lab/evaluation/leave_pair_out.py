"""Leave one pair out: how often a sticky valve scores above a healthy one, by a model that has seen neither."""

from collections.abc import Callable
from itertools import product

import numpy as np

from app.engine.recording import IntArray
from app.lab.evaluation.fitting import TextArray

Compared = Callable[[str, str], tuple[float, float]]


def area_by_pairs(valves: TextArray, sticky: IntArray, compared: Compared) -> float:
    """The area under the ROC curve over all pairs of a sticky and a healthy valve; ties count half.

    valves, sticky: (V,). compared: the scores of a sticky and of a healthy valve, both by one model fitted without
    either. Leaving out one valve pools the scores of as many models as there are valves. Each leans away from the
    label that it has lost, which takes from the area; within a pair both scores come from one model. Source: Airola,
    Pahikkala, Waegeman, De Baets, Salakoski 2011, doi 10.1016/j.csda.2010.11.018.
    """
    pairs = product(valves[sticky == 1], valves[sticky == 0])
    scores = np.array([compared(str(positive), str(negative)) for positive, negative in pairs])
    difference = scores[:, 0] - scores[:, 1]
    return float(np.mean((difference > 0.0) + 0.5 * (difference == 0.0)))
