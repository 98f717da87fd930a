"""Two effects at once, looked for together: what one of them leaves may hide the other, and what it bends may name it
wrongly.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.engine.mismatch.compete.competition import Contender, Scanned, descended, finalists
from app.engine.mismatch.compete.worth import nearer
from app.engine.mismatch.fit.fitting import Fit, finish, fit, quiet_noise, task_of
from app.engine.mismatch.fit.free_run import free_run_error
from app.engine.mismatch.fit.scan import Beside, Ground, Start, ground, moves, scan, task_with
from app.engine.mismatch.fit.task import Task, make_task, start_at
from app.engine.mismatch.loop.block import Block, Context, Part, values_in
from app.engine.mismatch.loop.plant import Plant
from app.engine.recording import FloatArray

_LEAST_SHARE, _MOST_SHARE = 0.0, 2.0
_FROM_EACH, _PURSUED, _WITHIN, _AGAIN = (3, 6), 2, 25.0, 2
_WILDEST = 1e60
"""A simulation that runs away moves the residual by so much and more: the products of its products have no number."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A point of a block's grid. row: (N,) by how much it moves the whitened residual, the linear model following."""

    part: Part
    row: FloatArray


@dataclass(frozen=True, eq=False)
class Couple:
    """Two points that explain most together. score: log-likelihood (nat) gained, noise held, less both penalties."""

    parts: tuple[Part, Part]
    score: float


def couples(found: Fit, surveyed: tuple[Scanned, ...], apart: tuple[frozenset[str], ...]) -> tuple[Couple, ...]:
    """The best couples of blocks under the noise of the fit so far and under quiet noise, as if their differences added
    up.

    apart: groups of codes of which only one is taken.
    """
    kept: dict[tuple[str, ...], Couple] = {}
    for k, noise in enumerate((found.noise, quiet_noise(found.record, found.given))):
        under = ground(found, noise)
        candidates = [c for scanned in surveyed for c in candidates_of(scanned.block, scanned.points[k], under)]
        for couple in _best_couples(candidates, under, apart, _FROM_EACH[k]):
            kept.setdefault(tuple(sorted(part.block.name for part in couple.parts)), couple)
    return tuple(kept.values())


def candidates_of(block: Block, starts: tuple[Start, ...], under: Ground) -> list[Candidate]:
    found, beside = [], Beside(block, under.fit)
    for start in starts:
        moved = moves(under, beside.simulated(start.values)[None, :])[0]
        found.append(Candidate(Part(block, start.values), moved - under.basis @ (under.basis.T @ moved)))
    return found


def _best_couples(
    candidates: list[Candidate], under: Ground, apart: tuple[frozenset[str], ...], most: int
) -> tuple[Couple, ...]:
    if len(candidates) < 2:
        return ()
    scores = joint_scores(candidates, under)
    codes: list[frozenset[str]] = []
    best: list[Couple] = []
    for at in np.argsort(-scores, axis=None):
        i, j = divmod(int(at), len(candidates))
        if not scores[i, j] > 0.0 or len(best) == most:
            break
        together = frozenset({candidates[i].part.block.code, candidates[j].part.block.code})
        if len(together) < 2 or together in codes or any(together <= group for group in apart):
            continue
        codes.append(together)
        best.append(Couple((candidates[i].part, candidates[j].part), float(scores[i, j])))
    return tuple(best)


def joint_scores(candidates: list[Candidate], under: Ground) -> FloatArray:
    """(M, M) scores (nat) of every couple, each of the two in the size that suits both, by inner products alone; -inf
    on and below the diagonal.
    """
    rows = np.stack([candidate.row for candidate in candidates])
    wild = ~(np.abs(rows).max(axis=1) < _WILDEST)
    rows[wild] = 0.0
    gram, slope = rows @ rows.T, rows @ under.rows
    own = np.diag(gram) + 1e-12 * np.trace(gram) + 1e-300
    det = np.maximum(own[:, None] * own[None, :] - gram**2, 1e-9 * own[:, None] * own[None, :])
    first = (-slope[:, None] * own[None, :] + slope[None, :] * gram) / det
    a = np.clip(first, _LEAST_SHARE, _MOST_SHARE)
    b = np.clip(-(slope[None, :] + a * gram) / own[None, :], _LEAST_SHARE, _MOST_SHARE)
    change = 2.0 * (a * slope[:, None] + b * slope[None, :] + a * b * gram) + a**2 * own[:, None] + b**2 * own[None, :]
    left = np.maximum(under.energy + change, 1e-9 * under.energy)
    penalties = np.array([candidate.part.block.penalty for candidate in candidates])
    scores = 0.5 * under.count * np.log(under.energy / left) - penalties[:, None] - penalties[None, :]
    scores[wild] = scores[:, wild] = -np.inf
    scores[np.tril_indices(len(candidates))] = -np.inf
    return scores


def coupled(found: Fit, promising: tuple[Couple, ...], single: Fit) -> tuple[Fit, ...]:
    """The best of some couples fitted beside what was found, the best score first: of the first descents those by
    likelihood and those by free run are pursued, as far as they come near the score of the best `single` effect or run
    much nearer to PV.
    """
    begun = [_begin_couple(found, couple) for couple in promising]
    begun = [both for both in begun if both.score > single.score - _WITHIN or nearer(both, single)]
    by_score = sorted(begun, key=lambda fitted: -fitted.score)[:_PURSUED]
    by_run = sorted(begun, key=free_run_error)[:_PURSUED]
    ended = (fit_again(searched_again(first)) for first in dict.fromkeys((*by_score, *by_run)))
    return tuple(sorted(ended, key=lambda fitted: -fitted.score))


def fit_again(found: Fit) -> Fit:
    return fit(task_of(found), found.x, None, 3, 6)


def searched_again(found: Fit) -> Fit:
    """A couple with each of the two looked for again beside the other, under the noise that both leave."""
    for k in (-2, -1):
        block = found.parts[k].block
        beside = without(found, k)
        starts = scan(block, (ground(beside, found.noise),))[0]
        for start in finalists(starts, block, Context(beside.record, beside.plant), _AGAIN):
            parts = list(found.parts)
            parts[k] = Part(block, start.values)
            again = descended(*placed(found, parts), 6)
            found = again if again.likelihood > found.likelihood else found
    return found


def without(found: Fit, k: int) -> Fit:
    """The same fit with one of its parts left out, nothing fitted again."""
    parts = [part for part in found.parts if part is not found.parts[k]]
    return finish(*placed(found, parts), found.noise)


def _begin_couple(found: Fit, couple: Couple) -> Fit:
    return descended(*placed(found, (*found.parts, *couple.parts)), 6)


def alone_as(part: Part, base: Fit, plant: Plant) -> Contender:
    """A part of a couple fitted alone from where it stands beside the other."""
    task = task_with(base, part.block)
    values = [*(known.values for known in base.parts), values_in(part, Context(base.record, base.given.plant))]
    alone = fit(task, start_at(task, plant, np.concatenate(values)), None, 2, 6)
    return Contender(alone, base)


def reordered(found: Fit, order: tuple[int, int]) -> Fit:
    """The same fit with its last two parts in this order (0: the last but one)."""
    parts = (*found.parts[:-2], *(found.parts[-2:][k] for k in order))
    return finish(*placed(found, parts), found.noise)


def placed(found: Fit, parts: Sequence[Part]) -> tuple[Task, FloatArray]:
    """The task of a fit with other parts, and the coordinates of its linear plant with their values."""
    task = make_task(found.record, found.given, tuple(part.block for part in parts))
    return task, start_at(task, found.plant, np.concatenate([np.zeros(0), *(part.values for part in parts)]))
