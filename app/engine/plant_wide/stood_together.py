"""Loops whose PV came to stand at the same time: one thing that they share is likelier than a failure of each."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import bdtrc

from app.engine.recording import FloatArray, IntArray

FEWEST = 3

SHUT_DOWN_S = 1800.0
"""Within so long a shutdown has mostly reached the loops of a unit, in s."""

FOLLOWS_S, LONGEST_S = 600.0, 3600.0
"""One that takes longer goes on where the next loop follows within FOLLOWS_S, up to LONGEST_S in all."""

SCANS = 2.0
"""Sampling intervals within which all that one card or gateway reads comes to stand."""

MOST = 0.75
"""Share of the loops of a group that came to stand in one scan, from which it points to what reads them: a PV that
moves in coarse steps may have held its value for a while before."""

CHANCE = 0.01
"""A group is told of where chance would bring so many loops together with less than this probability."""

_WIDTHS_TRIED = 2


@dataclass(frozen=True)
class Stand:
    """A loop whose PV came to stand, and stands.

    since_s: when, in s on a clock that the compared loops share. reach_s: how long the record is in which that was
    seen, s. interval_s: its sampling interval. unit: plant unit, or None.
    """

    tag: str
    since_s: float
    reach_s: float
    interval_s: float
    unit: str | None = None


@dataclass(frozen=True)
class StoodTogether:
    """Loops that came to stand together, in the order of time, then of tag.

    chance_probability: an upper bound for the probability that chance brings so many of all that stand together, 0..1.
    """

    stands: tuple[Stand, ...]
    chance_probability: float = 0.0

    @property
    def since_s(self) -> float:
        """When the first of them came to stand."""
        return self.stands[0].since_s

    @property
    def span_s(self) -> float:
        return self.stands[-1].since_s - self.stands[0].since_s

    @cached_property
    def in_one_scan(self) -> int:
        """How many of them, the most, came to stand within SCANS of the usual sampling interval."""
        since = np.array([stand.since_s for stand in self.stands])
        return int(np.max(_counts(since, SCANS * _usual_interval_s(self.stands))))

    @property
    def at_once(self) -> bool:
        """Whether MOST of them came to stand in one scan, as behind a card or a gateway that fails; else one after the
        other, as in a unit that is shut down."""
        return self.in_one_scan >= MOST * len(self.stands)

    @cached_property
    def unit(self) -> str | None:
        """The unit of all of them; None where they are of several, or one names none."""
        units = {stand.unit for stand in self.stands}
        return units.pop() if len(units) == 1 else None


def stood_together(stands: Sequence[Stand]) -> tuple[StoodTogether, ...]:
    """The groups of FEWEST loops or more that came to stand within so short a time that it is no chance, in the order
    of time; a loop is in one group at most.

    stands: those of a plant whose PV stands and of which it is known since when, each loop once.
    Looked for within SHUT_DOWN_S, and within SCANS sampling intervals of what is left, by the scan statistic (Naus
    1965): where n loops come to stand each by itself, anywhere within their records alike, k or more of them come
    within a time w somewhere with a probability of at most n P(B >= k - 1), B binomial of n - 1 loops and the mean of
    w / reach_s (one of the k is the first, and the others follow it; of unequal probabilities the mean bounds the tail:
    Hoeffding 1956), twice that for two widths. n: those that came to stand within one record's length of the group:
    a transmitter that died last year says nothing of today.
    Misleads where failures by themselves crowd, as those that are found at the beginning of a shift; and a loop that
    failed by itself within the same half an hour is taken for one of the group.

    J. I. Naus, J. Am. Stat. Assoc. 1965, 60, 532-538, doi 10.1080/01621459.1965.10480810; W. Hoeffding, Ann. Math.
    Stat. 1956, 27, 713-721, doi 10.1214/aoms/1177728178.
    """
    left = sorted(stands, key=lambda stand: (stand.since_s, stand.tag))
    found: list[StoodTogether] = []
    for least_s, follows_s in ((SHUT_DOWN_S, FOLLOWS_S), (0.0, 0.0)):
        while len(left) >= FEWEST and (group := _least_by_chance(left, least_s, follows_s)) is not None:
            found.append(group)
            told = {stand.tag for stand in group.stands}
            left = [stand for stand in left if stand.tag not in told]
    return tuple(sorted(found, key=lambda group: group.stands[0].since_s))


def _least_by_chance(stands: Sequence[Stand], least_s: float, follows_s: float) -> StoodTogether | None:
    """Of stands in the order of time those within a time that chance brings together least; None where it may."""
    since = np.array([stand.since_s for stand in stands])
    interval_s = _usual_interval_s(stands)
    width_s = max(least_s, SCANS * interval_s)
    counts = _counts(since, width_s)
    # Times are told to a sample: as many fall within the width as within one that is longer by that.
    chance = _chance(counts, since, np.array([stand.reach_s for stand in stands]), width_s + interval_s)
    first = int(np.argmin(np.where(counts >= FEWEST, chance, 1.0)))
    if counts[first] < FEWEST or chance[first] >= CHANCE:
        return None
    last = first + int(counts[first])
    while last < len(stands) and _goes_on(since, first, last, follows_s):
        last += 1
    return StoodTogether(tuple(stands[first:last]), float(chance[first]))


def _goes_on(since: FloatArray, first: int, following: int, follows_s: float) -> bool:
    return bool(since[following] - since[following - 1] <= follows_s and since[following] - since[first] <= LONGEST_S)


def _counts(since: FloatArray, width_s: float) -> IntArray:
    """(N,) how many of these times, which increase, lie within `width_s` from each on."""
    return np.searchsorted(since, since + width_s, side="right") - np.arange(len(since))


def _chance(counts: IntArray, since: FloatArray, reach_s: FloatArray, width_s: float) -> FloatArray:
    """(N,) the bound of `stood_together` for so many from each time on."""
    around_s = max(float(np.median(reach_s)), width_s)  # of all that are counted
    low, high = np.searchsorted(since, since - around_s), np.searchsorted(since, since + around_s, side="right")
    shares = np.concatenate(([0.0], np.cumsum(np.minimum(width_s / np.maximum(reach_s, width_s), 1.0))))
    n = high - low
    p = (shares[high] - shares[low]) / n
    others = np.where(counts > 1, bdtrc(np.maximum(counts - 2, 0), n - 1, p), 1.0)  # P(B >= counts - 1)
    return np.minimum(_WIDTHS_TRIED * n * others, 1.0)


def _usual_interval_s(stands: Sequence[Stand]) -> float:
    return float(np.median([stand.interval_s for stand in stands]))
