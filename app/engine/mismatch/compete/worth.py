"""What a contender is worth beyond its penalty: by its likelihood, its free run, the spikes of the noise, and as a
second effect by what slow noise hid of it.
"""

import numpy as np

from app.engine.mismatch.compete.competition import Contender
from app.engine.mismatch.compete.limits import limit_bonus, limits_always
from app.engine.mismatch.compete.richer_noise import taken_by_noise
from app.engine.mismatch.compete.spikes import steady_gain, tail_penalty
from app.engine.mismatch.fit.fitting import Fit, descend, residual_rows, task_of
from app.engine.mismatch.fit.free_run import runs_nearer, stem_swing
from app.engine.mismatch.fit.noise import compared_count
from app.engine.mismatch.loop.block import Block, Context
from app.engine.mismatch.physics.generic import CODE as UNNAMED

_STEADY_SHARE = 0.4
_NO_WORSE, _NEARER = 1.03, 0.8
LEAST_OF_PENALTY, _HIDDEN_PART = 0.6, 0.5
SECOND_MUST_GAIN = 4.0
_SECOND_SHARE, _SECOND_ENOUGH, _SMALL_SHARE = 0.06, 30.0, 0.15
_STEPS = 6
_TIMED = ("after a time", "within a time")


def worth(contender: Contender) -> float:
    """A contender's score: what it gains beyond its penalty, spikes aside, and what the quiet of its limited stretches
    says; below 0 where richer noise, or what a historian filled in, would have taken as much.
    """
    part = contender.fit.parts[-1]
    if not makes_sense(contender):
        return -np.inf
    if part.block.abrupt:
        own = contender.score - tail_penalty(contender.fit)
    else:
        own = min(contender.score, steady_gain(contender) - _STEADY_SHARE * contender.block.penalty)
        own += limit_bonus(contender.fit, part) if own > 0.0 else 0.0
    own = min(own, _of_what_was_stored(contender)) if own > 0.0 else own
    return own if own <= 0.0 or own > (taken := taken_by_noise(contender)) else own - taken


def _of_what_was_stored(contender: Contender) -> float:
    """A contender's score by the samples that a historian stored alone; no bound where it stored all, or where the
    free run is much nearer. What lies on a line between two of them tells nothing more, and a line's corners are news
    that any block may take. Measured: docs/PROOF.md.
    """
    share = contender.fit.record.told_share
    if share >= 1.0 or nearer(contender.fit, contender.over):
        return float(np.inf)
    return share * contender.gain - contender.block.penalty


def makes_sense(contender: Contender) -> bool:
    """Whether the fitted values still are what the codes say, those of what it stands beside as well, and the free run
    is no worse: noise must not take its place.
    """
    fit, context = contender.fit, Context(contender.fit.record, contender.fit.plant)
    if not all(part.makes_sense(context) for part in fit.parts):
        return False
    return no_worse(fit, contender.over) and not limits_always(fit, fit.parts[-1])


def no_worse(fit: Fit, over: Fit) -> bool:
    """Whether the free run of one fit is no worse than that of another."""
    return runs_nearer(fit, over, swing_between(fit, over), _NO_WORSE)


def nearer(fit: Fit, over: Fit) -> bool:
    """Whether the free run of one fit is much nearer to PV than that of another."""
    return runs_nearer(fit, over, swing_between(fit, over), _NEARER)


def swing_between(fit: Fit, over: Fit) -> int | None:
    """The swing of the stem where one of two fits stands beside the linear loop that was found behind it, and the other
    beside the one that was found from OP, with as much of the load as OP could take: a load says nothing of which is
    right. None where both stand beside one loop.
    """
    one, other = stem_swing(fit), stem_swing(over)
    return None if one is not None and other is not None else one or other


def pays_beside(second: Contender, first: Contender) -> bool:
    """Whether a second effect is worth having beside a first. What says little beside the first (a first that describes
    its effect only nearly leaves a misfit in proportion), and what has no name, must bring the free run much nearer.
    """
    hidden = hidden_gain(second)
    gain = second.gain + hidden
    small = second.block.code == UNNAMED or gain < _SMALL_SHARE * first.gain
    if small and not nearer(second.fit, second.over):
        return False
    return gain >= min(_SECOND_SHARE * first.gain, _SECOND_ENOUGH) and worth(second) + hidden >= SECOND_MUST_GAIN


def worth_beside(second: Contender) -> float:
    """What a second effect is worth, with what slow noise hid of it."""
    return worth(second) + hidden_gain(second)


def hidden_gain(second: Contender) -> float:
    """What slow noise hid of a second effect (nat): the noise beside the first alone was fitted to what the second
    leaves as well, so that a likelihood with it has little to gain.

    Half of what the gain would be more under the noise that both leave: the mean of both noises' verdicts. 0 where the
    free run is hardly nearer, where the gain itself is far from the penalty, and for what time alone brings: a drift or
    a step is what slow noise looks like, and takes its place in any record.
    """
    if timed(second.block) or second.gain < LEAST_OF_PENALTY * second.block.penalty or not makes_sense(second):
        return 0.0
    return hidden_from(second.fit, second.over)


def hidden_from(fit: Fit, over: Fit) -> float:
    """What the noise of one fit hid of another that runs much nearer to PV (nat, not below 0)."""
    if not nearer(fit, over):
        return 0.0
    return max(_HIDDEN_PART * (gain_under(fit, over) - (fit.likelihood - over.likelihood)), 0.0)


def timed(block: Block) -> bool:
    """Whether a block acts by time alone, whatever OP and PV do."""
    return block.condition in _TIMED


def gain_under(fit: Fit, over: Fit) -> float:
    """The gain in log-likelihood (nat) of one fit over another under the noise of the first, the other's numbers
    fitted again.
    """
    task = task_of(over)
    x = descend(task, over.x, fit.noise, _STEPS)
    without = residual_rows(task, x, fit.noise).cost
    both = residual_rows(task_of(fit), fit.x, fit.noise).cost
    return 0.5 * compared_count(fit.record.usable) * float(np.log(without / both))
