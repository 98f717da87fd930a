"""Thresholds that turn calibrated evidence into a verdict. None of them is fitted to single loops."""

from dataclasses import dataclass, field

from app.engine.rivals import BEHIND_ALL
from app.engine.verdict.parameters import VERSION


@dataclass(frozen=True)
class VerdictConfig:
    """undecided_within: a probability this near to 0.5 is inconclusive.

    reliable_stiction_from: probability that reliable stiction needs, if linear surrogates of the record do not look as
    sticky (`look_alikes`). They are computed up to unlike_linear_from. sure_stiction_from: from this probability on,
    stems are tested only in long records. reliable_own_cycle_from: probability that is enough if PV shows that the
    valve makes the cycle (`own_cycle`); from it on, a long record that does not show this raises a doubt.
    reliable_no_stiction_to: highest probability of a reliable clearing, chosen on leave-one-valve-out scores for 97 %
    right.
    min_cycles: fewest cycles of the oscillation in the record for a reliable verdict. min_samples: fewest samples,
    because noise that ripples has many cycles in few samples. Of excerpts of the real recordings with 130 to 300
    samples, 88 to 89 % of the verdicts that were otherwise reliable are right; of those with 400 and 600, 92 and 94 %.
    max_strangers_chance: a reliable verdict needs PV and OP so alike that two unrelated signals are as alike with less
    than this probability.
    min_difference: smallest share of the variance of PV that a straight line over OP leaves, for a reliable verdict.
    max_following, max_followed, max_wave: for reliable stiction, the strength of the rival that PV and OP follow the
    set point, the share of PV that it explains, and the share of both that is one sine with a constant phase are at
    most this.
    min_jitter, min_jitter_of_unlike: for reliable stiction, the standard deviation of the cycle length is at least one
    of these: as a share of that length, or as a share of what differs from cycle to cycle. What swings more evenly is
    driven by a clock. Of the 15 real recordings of valves that stick with enough cycles, none is below 0.049 and 0.084.
    max_window_spread: largest standard deviation of the log-odds between windows for a reliable verdict, divided by the
    log-odds of the shapes; from one on, windows reach the other side.
    max_filled_share: largest share of filled samples for a reliable verdict. min_automatic_share: smallest share in
    automatic.
    parameters_version: version of the fitted numbers, so that a stored verdict says which ones it came from.
    """

    undecided_within: float = 0.02
    reliable_stiction_from: float = 0.65
    sure_stiction_from: float = 0.97
    unlike_linear_from: float = 1.0
    reliable_own_cycle_from: float = 0.6
    reliable_no_stiction_to: float = 0.25
    min_cycles: float = 5.0
    min_samples: int = 500
    max_window_spread: float = 1.0
    max_filled_share: float = 0.1
    min_automatic_share: float = 0.5
    max_strangers_chance: float = 1e-3
    min_difference: float = 1e-5
    max_following: float = BEHIND_ALL
    max_followed: float = 0.95
    max_wave: float = 0.955
    min_jitter: float = 0.015
    min_jitter_of_unlike: float = 0.035
    parameters_version: str = field(default=VERSION, init=False)

    def __post_init__(self) -> None:
        clear, own = self.reliable_no_stiction_to, self.reliable_own_cycle_from
        sticks, sure = self.reliable_stiction_from, self.sure_stiction_from
        if not 0.0 <= clear < 0.5 < own <= sticks <= sure:
            raise ValueError(
                "needed is 0 <= reliable_no_stiction_to < 0.5 < reliable_own_cycle_from <= reliable_stiction_from <= "
                f"sure_stiction_from; got {clear:g}, {own:g}, {sticks:g} and {sure:g}"
            )
