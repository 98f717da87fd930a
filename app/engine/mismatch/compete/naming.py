"""A contender that is believed, with the names that this record cannot tell from it."""

from dataclasses import dataclass

import numpy as np

from app.engine.evidence import Reason
from app.engine.mismatch.compete.competition import Contender
from app.engine.mismatch.compete.worth import worth
from app.engine.mismatch.fit.refitting import CODE as PARAMETERS
from app.engine.mismatch.loop.block import Context
from app.engine.mismatch.physics import CLOSE, NEAR, NEAR_SHARE, TWINS
from app.engine.mismatch.physics.additive import LEVELLING, LOAD_DRIFT, LOAD_STEP, SENSOR_DRIFT
from app.engine.mismatch.physics.generic import CODE as UNNAMED
from app.engine.mismatch.physics.process_dynamics import EXTRA_LAG, INVERSE_RESPONSE
from app.engine.mismatch.physics.scales import slowness
from app.engine.mismatch.physics.valve_deadband import DEADBAND
from app.engine.mismatch.physics.valve_stiction import CODE as STICTION

_INDISTINCT = 5.0
_MOST_ALTERNATIVES = 2
_SMALL_SLIP = 0.35
_AT_BOUND = 1.01  # times the least that a ramp may last
_SMALL_ZERO = 0.45  # of the lag beside it
_OWN_SHARE = 0.35
_RAMPS = (SENSOR_DRIFT.name, LOAD_DRIFT.name, LEVELLING.name)
_ANSWERED = 3.0  # times the process' slowest time: by then a step has come through it
# What is no physics is no alternative to any: it only makes a name less sure.
_UNSAID = (UNNAMED, PARAMETERS)


@dataclass(frozen=True, eq=False)
class Believed:
    """An effect that is believed. gain: log-likelihood (nat) over the fit without it; margin: over the best other
    name. most: what its probability is at most, for what it leaves unexplained (left).
    """

    code: str
    alternatives: tuple[str, ...]
    gain: float
    margin: float
    contender: Contender
    most: float = 1.0
    left: tuple[Reason, ...] = ()


def believed(best: Contender, names: tuple[Contender, ...], standing: float | None = None) -> Believed:
    """The best contender with the names that this record cannot tell from it. standing: what it is worth, where that is
    known from elsewhere.
    """
    standing = worth(best) if standing is None else standing
    twins = list(twins_of(best))
    others = [r for r in names if r.block.code != best.block.code and r.block.code not in twins]
    doubt = own_doubt(best)
    margins = {r.block.code: (standing - worth(r)) / doubt for r in others}
    limits = {r.block.code: max(_INDISTINCT, NEAR_SHARE * standing * _near(best, r)) for r in others}
    told = [r for r in others if r.block.code not in _UNSAID and (worth(r) > 0.0 or _near(best, r))]
    close = [r.block.code for r in told if margins[r.block.code] < limits[r.block.code]]
    alternatives = tuple((twins + close)[:_MOST_ALTERNATIVES])
    unsaid = [margin for code, margin in margins.items() if code not in alternatives]
    return Believed(best.block.code, alternatives, best.gain, min(unsaid, default=float(np.inf)), best)


def own_doubt(best: Contender) -> float:
    """By how much a margin (nat) is to be divided: where no simulation was given the linear model came from the same
    record, its structure is a guess, and names that come within a third of each other are not told apart by it.
    """
    if not best.fit.given.own:
        return 1.0
    return max(_OWN_SHARE * worth(best) / _INDISTINCT, 1.0)


def _hardly_slips(contender: Contender) -> bool:
    """Stiction whose slip jump is a small share of its band, which an uneven backlash looks like as well."""
    return contender.block.code == STICTION and float(contender.fit.parts[-1].values[1]) < _SMALL_SLIP


def _hardly_lasts(contender: Contender) -> bool:
    """A ramp that is over before the process has answered, or as soon as one may be, which a step that comes through a
    lag looks like as well. Of a drift that levels out its time constant is asked.
    """
    part, context = contender.fit.parts[-1], Context(contender.fit.record, contender.fit.plant)
    if part.block.name not in _RAMPS:
        return False
    shortest = part.block.parameters(context)[1].low
    return bool(part.values[1] < max(_ANSWERED * slowness(context), _AT_BOUND * shortest))


def _hardly_turns_back(contender: Contender) -> bool:
    """An inverse response whose zero is a small share of its lag, which lags in a row look like as well: n equal ones
    have the mean delay and the spread of one lag with a zero of (n - 1) / (n + 1) of it, two those of a third.
    """
    values = contender.fit.parts[-1].values
    return contender.block.code == INVERSE_RESPONSE.code and bool(values[0] < _SMALL_ZERO * values[1])


def twins_of(contender: Contender) -> tuple[str, ...]:
    """Names that no record of OP and PV tells from this one, or not from one with such values."""
    code = contender.block.code
    return (
        *TWINS.get(code, ()),
        *CLOSE.get(code, ()),
        *((DEADBAND.code,) if _hardly_slips(contender) else ()),
        *((EXTRA_LAG.code,) if _hardly_turns_back(contender) else ()),
        *((LOAD_STEP.code,) if _hardly_lasts(contender) else ()),
    )


def _near(one: Contender, other: Contender) -> bool:
    """Whether two names have nearly the same form."""
    return any({one.block.code, other.block.code} <= family for family in NEAR)
