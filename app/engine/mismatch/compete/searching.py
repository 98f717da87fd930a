"""An effect alone, as well as it can be: looked for again beside the linear loop that was found with it. The first scan
was beside a loop without it, and a step of its grid passes over what jumps.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from app.engine.mismatch.compete.competition import Contender, descended
from app.engine.mismatch.compete.pairing import alone_as, fit_again, placed, without
from app.engine.mismatch.compete.worth import makes_sense
from app.engine.mismatch.fit.fitting import Fit, fit
from app.engine.mismatch.fit.scan import Start, ground, scan
from app.engine.mismatch.fit.unlike import unlike_better_ones
from app.engine.mismatch.loop.block import Block, Context, Parameter, Part
from app.engine.mismatch.physics.oscillation import WAVE
from app.engine.recording import FloatArray

# Where a valve jumps hangs on thousandths of its band, and the likelihood has an optimum for each such band: in which
# of them a descent ends hangs on the last bits of where it began.
_WIDTH, _POINTS, _MOMENTS = 0.3, 121, 241
_TURN_POINTS, _ENDS_MOVED = 60, 4
_LEAST_MOVED = 0.1  # nat
_PURSUED, _NEAR, _NEAR_OTHERWISE = 3, 0.01, 0.15
_STEPS = 6


@dataclass(frozen=True, eq=False)
class Begun:
    """A point of the fine grid of one form of an effect."""

    form: Block
    start: Start


def searched(contender: Contender, blocks: tuple[Block, ...]) -> Contender:
    """An effect in the best of its forms among `blocks`, on a fine grid about where it stands; the contender itself
    where nothing jumps and where nothing better is there.
    """
    found, context = contender.fit, Context(contender.fit.record, contender.fit.plant)
    if contender.block.code == WAVE.code:
        return _between_its_ends(contender)
    if not _jumps(contender.block, context):
        return contender
    forms = [block for block in blocks if block.code == contender.block.code and _jumps(block, context)]
    under = ground(without(found, -1), found.noise)
    points = [Begun(form, start) for form in forms for start in scan(_finely(form, found), (under,))[0]]
    fits = (_begun_from(found, point) for point in foremost(points, context))
    best = max((found, *fits), key=score_of)
    if best is found:
        return contender
    return _as_sensible(max((best, fit_again(best)), key=score_of), contender)


def _as_sensible(found: Fit, contender: Contender) -> Contender:
    """A contender in this fit; as it was where it makes sense and this fit does not."""
    again = Contender(found, contender.over)
    return again if makes_sense(again) or not makes_sense(contender) else contender


def _between_its_ends(contender: Contender) -> Contender:
    """A wave between the best of all beginnings and ends within a turn of where it stands: each turn has a valley of
    its own, and each sample too where the wave begins away from zero.
    """
    found = contender.fit
    for _ in range(_ENDS_MOVED):
        moved = _from_other_ends(found)
        if not moved.score > found.score + _LEAST_MOVED:
            break
        found = moved
    return contender if found is contender.fit else _as_sensible(found, contender)


def _from_other_ends(found: Fit) -> Fit:
    """The last part of a fit, a wave, fitted from the ends that suit it best: with all its other numbers as they are,
    and with the sizes of the scan, which are those beside a loop without it.
    """
    part = found.parts[-1]
    start = scan(_about_its_ends(part), (ground(without(found, -1), found.noise),))[0][0]
    values = np.concatenate((start.values[:2], part.values[2:]))
    kept = fit(*placed(found, (*found.parts[:-1], Part(part.block, values))), found.noise, 2, _STEPS)
    return max((kept, fit_again(_begun_from(found, Begun(part.block, start)))), key=score_of)


def _about_its_ends(part: Part) -> Block:
    """A wave's block with a grid about where it begins and ends, one of the two moved by up to a turn."""

    def starts(context: Context, _: FloatArray) -> FloatArray:
        ts, duration = context.record.sampling_interval_s, context.record.duration_s
        period = float(part.values[2])
        by = max(ts, period / _TURN_POINTS) * np.arange(-_TURN_POINTS, _TURN_POINTS + 1)
        by = by[np.abs(by) <= period]
        grid = np.tile(part.values, (2, len(by), 1))
        for end in (0, 1):
            grid[end, :, end] = np.clip(part.values[end] + by, 0.0, duration)
        points = grid.reshape(-1, len(part.values))
        return points[points[:, 1] > points[:, 0]]

    return replace(part.block, starts=starts)


def _jumps(block: Block, context: Context) -> bool:
    """Whether the simulation jumps with a size: a band, a force, a speed."""
    parameters = block.parameters(context)
    return block.rough and len(parameters) > 0 and parameters[0].log


def _finely(form: Block, found: Fit) -> Block:
    """A form with a grid that is fine in its first parameter about where a fit stands, its own in the others; and in
    the moment from which on it acts, where it has one as the fit has.
    """
    part = found.parts[-1]
    sizes = part.values[0] * np.exp(np.linspace(-_WIDTH, _WIDTH, _POINTS))

    def starts(context: Context, residual: FloatArray) -> FloatArray:
        others = {tuple(row[1:]) for row in form.starts(context, residual)}
        if len(part.values) == len(form.parameters(context)):
            others.add(tuple(part.values[1:]))
        points = np.array([(size, *other) for other in sorted(others) for size in sizes])
        alike = [p.name for p in form.parameters(context)] == [p.name for p in part.block.parameters(context)]
        return np.concatenate((points, _at_other_moments(part, context))) if alike else points

    return replace(form, starts=starts)


def _at_other_moments(part: Part, context: Context) -> FloatArray:
    """(M, P) the values of a part with each other moment from which on it may act; none of what acts always."""
    names = [parameter.name for parameter in part.block.parameters(context)]
    if "start" not in names:
        return np.zeros((0, len(part.values)))
    points = np.tile(part.values, (_MOMENTS, 1))
    points[:, names.index("start")] = np.linspace(0.0, context.record.duration_s, _MOMENTS)
    return points


def foremost(points: list[Begun], context: Context) -> list[Begun]:
    """The best points that are not neighbours."""
    best_first = sorted(points, key=lambda point: point.form.penalty - point.start.gain)
    return unlike_better_ones(best_first, partial(_neighbours, context), _PURSUED)


def _neighbours(context: Context, one: Begun, other: Begun) -> bool:
    """Whether two points are nearly one: in the logarithm of the size, and in the range that each other parameter has,
    which depends on no unit.
    """
    a, b = one.start.values, other.start.values
    if one.form is not other.form or abs(np.log(a[0] / b[0])) > _NEAR:
        return False
    others = one.form.parameters(context)[1 : len(a)]
    return all(_within_range(p, *pair) < _NEAR_OTHERWISE for p, *pair in zip(others, a[1:], b[1:], strict=True))


def _within_range(parameter: Parameter, a: float, b: float) -> float:
    """How far apart two values of a parameter are, as a share of its range, by logarithms where it is fitted so."""
    low, high = parameter.low, parameter.high
    if parameter.log:
        a, b, low, high = (float(np.log(value)) for value in (a, b, low, high))
    return abs(a - b) / (high - low + 1e-300)


def _begun_from(found: Fit, point: Begun) -> Fit:
    return descended(*placed(found, (*found.parts[:-1], Part(point.form, point.start.values))), _STEPS)


def best_alone(part: Part, both: Fit, base: Fit, known: Contender | None, blocks: tuple[Block, ...]) -> Contender:
    """A part of a pair alone, as well as is known: as it competed, or begun where the pair stands, and looked for again
    from there.

    Begun beside other linear loops as well: beside what stands for the whole process the pair's own is nobody's.
    """
    others = () if known is None else (known,)
    plants = (both.plant, base.plant, *(contender.fit.plant for contender in others))
    begun = (alone_as(part, base, plant) for plant in plants)
    return searched(max((*others, *begun), key=lambda contender: contender.score), blocks)


def score_of(found: Fit | Contender) -> float:
    return found.score
