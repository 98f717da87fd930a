"""A band in which the valve sticks, where the loop hardly cycles for it: PV shows it, though no shape does.

What noise and load make of OP moves the stem of such a valve too, a part of each movement less, and PV goes by the
stem. Over thousands of samples that can be told from a valve which follows: the stem that a valve of the right size
would have foretells PV beyond what the past of PV, OP and SP does.
"""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.causality.stem_search import PARTS, asked_of, moving_part
from app.engine.recording import UniformRecord
from app.engine.signals.turning import stems, usual_range

SIZES = np.geomspace(0.03, 0.6, 8)
"""S over the range of OP. A valve that is called healthy has a band too: what is below is none to ask for."""

JUMP = 0.2
"""J over S: what the stem slips little shows of valves that jump as well, and better than a large one of the others."""


@dataclass(frozen=True)
class HiddenBand:
    """S: of the valve whose stem foretells PV best, unit of OP; one of eight sizes, each half as large again as the one
    before. nats: what it is worth by likelihood. needed: what as many terms and valves as were tried are worth by
    chance.
    """

    S: float
    nats: float
    needed: float


def hidden_band(record: UniformRecord) -> HiddenBand | None:
    """The band that PV shows; None where it shows none, or too little is recorded.

    On each stride the stems of valves of many sizes, moved by OP, are tried beside the past of PV, OP and SP. The best
    one has to be worth more than its terms and than the number of those tried, and worth its share of that in each
    third of the record: a band is the valve's and stays, an upset is over.

    Misleads: loads that switch to and fro show as a band (a pump, a batch), and so may what else a linear model lacks
    all the time. It says that a valve may have a band; that a loop cycles for it is asked in `own_cycle`.
    Source: the valves are Kano's (Kano et al. 2004, Practical model and detection algorithm for valve stiction).
    """
    moving = moving_part(record)
    if moving is None:
        return None
    moved, shown = stems(moving.op, SIZES, JUMP), []
    for asked in asked_of(moving):
        best, nats = asked.most_worth(moved)
        needed = asked.needed(len(moved))
        if PARTS * nats.min() > needed:
            shown.append(HiddenBand(float(SIZES[best]), float(nats.sum()), needed))
    best_one = max(shown, key=lambda band: band.nats - band.needed, default=None)
    return None if best_one is None else replace(best_one, S=usual_range(moving.op) * best_one.S)
