"""The competition: every block of the library fitted beside what was found so far, and the best taken while it pays."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.mismatch.fit.fitting import Fit, descend, finish, fit, noise_left, polish, quiet_noise, task_of
from app.engine.mismatch.fit.scan import Start, at_given, ground, scan, task_with
from app.engine.mismatch.fit.task import Task, start_at
from app.engine.mismatch.fit.unlike import unlike_better_ones
from app.engine.mismatch.loop.block import Block, Context, Part, values_in
from app.engine.recording import FloatArray

_ADMITTED, _SECOND_ADMITTED = (9, 5), (6, 3)
_HOPELESS = 0.35
_POINTS = 6
_NEIGHBOURS = 0.08  # of a parameter's range
_PURSUED_SHARE, _PURSUED_WITHIN = 0.35, 25.0


@dataclass(frozen=True, eq=False)
class Contender:
    """A fit whose last part competes for a place beside what was found so far (over)."""

    fit: Fit
    over: Fit

    @property
    def block(self) -> Block:
        return self.fit.parts[-1].block

    @property
    def gain(self) -> float:
        """Log-likelihood (nat) over what was found so far, without penalty."""
        return self.fit.likelihood - self.over.likelihood

    @property
    def score(self) -> float:
        return self.gain - self.block.penalty


@dataclass(frozen=True, eq=False)
class Scanned:
    """A block's best starting points under the noise of the fit so far and under quiet noise, with their gains
    (nat).
    """

    block: Block
    starts: tuple[Start, ...]
    gain: float
    quiet_gain: float
    points: tuple[tuple[Start, ...], tuple[Start, ...]] = ((), ())


def contenders(
    found: Fit,
    blocks: tuple[Block, ...],
    carried: tuple[Part, ...] = (),
    surveyed: tuple[Scanned, ...] | None = None,
) -> tuple[Contender, ...]:
    """The blocks that a scan finds promising, fitted beside the fit so far, best score first; those `carried` from
    another fit as well, from the values that they had there too.
    """
    surveyed = survey(found, blocks) if surveyed is None else surveyed
    admitted = {scanned.block.name: scanned for scanned in promising(surveyed, found)}
    scans = {scanned.block.name: scanned for scanned in surveyed}
    context = Context(found.record, found.given.plant)
    for part in carried:
        scanned = scans.get(part.block.name)
        if scanned is not None:
            begun_there = Start(values_in(part, context), 0.0)
            starts = (*scanned.starts, begun_there) if part.block.name in admitted else (begun_there,)
            admitted[part.block.name] = replace(scanned, starts=starts)
    begun = [(scanned.block, begin(scanned, found)) for scanned in admitted.values()]
    scores = [fits[0].likelihood - block.penalty for block, fits in begun]
    sensible = [score for score, (_, fits) in zip(scores, begun, strict=True) if _says_what_it_is(fits[0])]
    asked = _pursued_from(max(sensible, default=0.0) - found.likelihood) + found.likelihood
    entered = []
    for (block, fits), score in zip(begun, scores, strict=True):
        hard = block.rough or (block.distant and score > found.likelihood)
        best = pursue(block, fits) if score > asked or hard else fits[0]
        entered.append(Contender(best, found))
    return tuple(sorted(entered, key=lambda contender: -contender.score))


def _says_what_it_is(found: Fit) -> bool:
    """Whether the values of a fit's last part are what its block says."""
    return found.parts[-1].makes_sense(Context(found.record, found.plant))


def _pursued_from(best: float) -> float:
    """The score (nat, after the first descents) from which a smooth block is worth more of them, where this is the
    best. The first descents of a rough one say little.
    """
    return min(_PURSUED_SHARE * best, best - _PURSUED_WITHIN)


def survey(found: Fit, blocks: tuple[Block, ...]) -> tuple[Scanned, ...]:
    """Every block scanned beside the fit so far."""
    own, quiet = ground(found, found.noise), ground(found, quiet_noise(found.record, found.given))
    context = Context(found.record, found.plant)
    surveyed = []
    for block in (b for b in blocks if b.suits is None or b.suits(context)):
        first, second = (solved_sensibly(starts, block, context) for starts in scan(block, (own, quiet)))
        starts = (*finalists(first, block, context), *finalists(second, block, context))
        if block.distant:
            starts += finalists(at_given(block, found), block, context)
        points = (finalists(first, block, context, _POINTS), finalists(second, block, context, _POINTS))
        surveyed.append(Scanned(block, starts, _best_gain(first), _best_gain(second), points))
    return tuple(surveyed)


def solved_sensibly(starts: tuple[Start, ...], block: Block, context: Context) -> tuple[Start, ...]:
    """The points of a scan; of a strict block those at which it is what its code says."""
    return tuple(start for start in starts if not block.strict or Part(block, start.values).makes_sense(context))


def _best_gain(starts: tuple[Start, ...]) -> float:
    """The gain (nat) of the first point; -inf where there is none."""
    return starts[0].gain if starts else -np.inf


def glance(found: Fit, blocks: tuple[Block, ...]) -> tuple[Scanned, ...]:
    """Every block scanned once, under the noise of the fit so far: half the work of a survey, for a first answer."""
    own, context = ground(found, found.noise), Context(found.record, found.plant)
    scanned = []
    for block in (b for b in blocks if b.suits is None or b.suits(context)):
        if starts := solved_sensibly(scan(block, (own,))[0], block, context):
            scanned.append(Scanned(block, starts, starts[0].gain, 0.0))
    return tuple(scanned)


def promising(surveyed: tuple[Scanned, ...], found: Fit) -> tuple[Scanned, ...]:
    """The blocks worth a fit: those near the best under either noise; fewer beside an effect that was found."""
    admitted, admitted_quiet = _SECOND_ADMITTED if found.parts else _ADMITTED
    own = sorted(surveyed, key=lambda s: -(s.gain - s.block.penalty))
    quiet = sorted(surveyed, key=lambda s: -(s.quiet_gain - s.block.penalty))
    kept = [s for s in own[:admitted] if s.gain > _HOPELESS * s.block.penalty]
    kept += [s for s in quiet[:admitted_quiet] if s.quiet_gain > s.block.penalty]
    kept += [s for s in surveyed if s.block.distant]
    # One that stands for several effects is asked once, beside none.
    kept += [s for s in surveyed if s.block.brings and not found.parts]
    return tuple(dict.fromkeys(kept))


def begin(scanned: Scanned, found: Fit) -> list[Fit]:
    """First descents of one block beside what was found, from its best starting points, the best first."""
    task = task_with(found, scanned.block)
    known = [part.values for part in found.parts]
    places = [
        start_at(task, start.plant or found.plant, np.concatenate((*known, start.values))) for start in scanned.starts
    ]
    # Both noises of a scan may begin at the same place.
    begun = {key: descended(task, x, scanned.block.steps) for key, x in {x.tobytes(): x for x in places}.items()}
    return sorted((begun[x.tobytes()] for x in places), key=lambda fitted: -fitted.likelihood)


def descended(task: Task, x: FloatArray, steps: int) -> Fit:
    """A first descent from coordinates x, under the noise that is left there."""
    noise = noise_left(task, x)
    x = descend(task, polish(task, x, noise), noise, steps)
    return finish(task, x, noise_left(task, x, noise))


def pursue(block: Block, begun: list[Fit]) -> Fit:
    """The best of the first descents fitted to their end; as it began where the way on led to another valley."""
    first = begun[0]
    task = task_of(first)
    fits = [fit(task, fitted.x, fitted.noise, 1, 6) for fitted in dict.fromkeys(begun[: block.finalists])]
    best = max((first, *fits), key=lambda fitted: fitted.likelihood)
    return max(best, fit(task, best.x, None, 3, block.steps), key=lambda fitted: fitted.likelihood)


def finalists(starts: tuple[Start, ...], block: Block, context: Context, most: int | None = None) -> tuple[Start, ...]:
    """The best points of a scan that are not neighbours, as many as the block has finalists."""
    most = block.finalists if most is None else most
    ranges = [p.high - p.low + 1e-300 for p in block.parameters(context)]
    places = ((start, start.values.tolist()) for start in starts)

    def neighbours(one: tuple[Start, list[float]], other: tuple[Start, list[float]]) -> bool:
        return not any(abs(a - b) / reach > _NEIGHBOURS for a, b, reach in zip(one[1], other[1], ranges, strict=True))

    return tuple(start for start, _ in unlike_better_ones(places, neighbours, most))
