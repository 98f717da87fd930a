"""How well a record tells the size of a stem that sticks: 95 % intervals by trying other sizes, because the simulation
jumps with them.
"""

import numpy as np
from scipy.ndimage import binary_dilation

from app.engine.mismatch.fit.fitting import Fit, orthonormal, projected_cost, residual_rows, slopes, task_of
from app.engine.mismatch.fit.task import Task, clipped
from app.engine.mismatch.judge.intervals import CHI2_95
from app.engine.mismatch.judge.result import Estimate
from app.engine.mismatch.loop.block import Context
from app.engine.mismatch.physics.stem import NAME as STEM_START
from app.engine.mismatch.physics.valve_stiction import reach, start_slipping_as
from app.engine.recording import BoolArray, FloatArray

_WEAKENED = 24.0
"""By how much less the cost of other sizes of stiction counts than if the model were the truth: the least cost is the
best of many narrow ones, one for each sample at which a stem could have slipped. Measured: docs/PROOF.md."""
_S_MOVES = np.geomspace(2e-4, 0.7, 22)  # of ln S
_SHARE_MOVES = np.array([0.01, 0.03, 0.07, 0.15, 0.3, 0.6])  # of J / S
_STARTS = np.linspace(-1.0, 1.0, 41)  # share of the band to either side
_MOST_MOMENTS = 1000
_LEAST_SHARE = 0.02  # of J / S, below which the gain does not fall with it


def size_of_stiction(found: Fit, part: int) -> tuple[Estimate, ...]:
    """S and J of a stem that sticks (which of the parts), unit of OP, over the sizes that explain the record nearly as
    well, and its first position; of one that sticks from a time on that moment instead, s. Slopes say nothing of them:
    between two sizes at which a slip falls into another sample nothing changes, and there everything does.

    Sizes are tried on a grid around the fitted one, each from where it first slips as the fitted one does too, and all
    other numbers following along their slopes; the interval reaches to the next sizes of the grid beyond those that
    pass, because it may end anywhere before them.
    """
    names, own = [f.name for f in found.free], found.parts[part].block.parameters(Context(found.record, found.plant))
    tried = [names.index(f"{part}.{parameter.name}") for parameter in own]
    begins = own[2].name == STEM_START
    task = task_of(found)
    places = [
        _around(task, found.x, tried, names.index("K"), side) for side in ((0.0, 1.0, -1.0) if begins else (0.0,))
    ]
    passed = _passing(found, task, places, tried[:2])
    reached = binary_dilation(np.any(passed, axis=0), np.ones((3, 3)))
    kept = [places[0][reached], *(grid[mask] for grid, mask in zip(places[1:], passed[1:], strict=True))]
    others = _STARTS if begins else _moments(found, tried[2])
    kept.append(_others_passing(found, task, tried if begins else tried[2:], tried[2], others))
    sizes = np.array([_size_at(found, x, tried, begins) for x in (found.x, *np.concatenate(kept))])
    low, high = np.min(sizes, axis=0), np.max(sizes, axis=0)
    third = (STEM_START, found.record.op[0], "OP") if begins else ("start", 0.0, "s")
    return tuple(
        Estimate(name, float(sizes[0, k] + zero), float(low[k] + zero), float(high[k] + zero), unit)
        for k, (name, zero, unit) in enumerate((("S", 0.0, "OP"), ("J", 0.0, "OP"), third))
    )


def _moments(found: Fit, k: int) -> FloatArray:
    """(M,) coordinates k of the moments at which a stem may have begun to stick, evenly over the record: which of two
    samples it was decides where it stands until it slips, and the likelihood has a valley for each.
    """
    record = found.record
    at = record.time_s[:: -(-record.samples // _MOST_MOMENTS)]
    return at / found.free[k].scale


def _others_passing(found: Fit, task: Task, held: list[int], k: int, others: FloatArray) -> FloatArray:
    """(M, P) coordinates of the fitted size with another coordinate k: those of `others` (L,) that pass, and the next
    ones.
    """
    places = np.tile(found.x, (len(others), 1, 1))
    places[:, 0, k] = others
    passed = _passing(found, task, [places], held)[0]
    return places[binary_dilation(passed, np.ones((3, 1)))]


def _passing(found: Fit, task: Task, places: list[FloatArray], held: list[int]) -> BoolArray:
    """(G, A, B) at which coordinates of G grids (A, B, P) the record is explained nearly as well as at the fitted ones,
    all numbers but those held following.

    The slopes of the fitted stem would stand for a stem that stands still, and any size beyond OP's travel passed: what
    passes with them has to pass with the slopes at its own size as well.
    """
    others = [k for k in range(len(found.x)) if k not in held]
    at = residual_rows(task, found.x, found.noise)
    basis = orthonormal(slopes(task, found.x, found.noise, at, others))
    allowed = projected_cost(at.rows, basis) + CHI2_95 * _WEAKENED
    passed = np.zeros((len(places), *places[0].shape[:2]), dtype=np.bool_)
    for k in np.ndindex(passed.shape):
        x = places[k[0]][k[1:]]
        there = residual_rows(task, x, found.noise)
        if projected_cost(there.rows, basis) <= allowed:
            own = orthonormal(slopes(task, x, found.noise, there, others))
            passed[k] = projected_cost(there.rows, own) <= allowed
    return passed


def _size_at(found: Fit, x: FloatArray, tried: list[int], begins: bool) -> tuple[float, float, float]:
    """S, J and how far the stem stood from OP at first, or from when on it sticks, at coordinates x (P,)."""
    S, share, start = (found.free[k].value(float(x[k])) for k in tried)
    return S, S * share, start * reach(S, S * share) if begins else start


def _around(task: Task, fitted: FloatArray, tried: list[int], gain: int, side: float) -> FloatArray:
    """(A, B, P) coordinates about the fitted ones (P,): other ln S and J / S; where `side` is 1 or -1 the stem first
    slips down or up where the fitted one does, and the gain falls as J grows.
    """
    grids = [np.concatenate((-moves[::-1], [0.0], moves)) for moves in (_S_MOVES, _SHARE_MOVES)]
    moves = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1)
    places = np.tile(fitted, (*moves.shape[:2], 1))
    places[..., tried[:2]] += moves
    places = clipped(task, places)
    if side == 0.0:
        return places
    share, start = tried[1:]
    share_there = places[..., share]
    places[..., start] = start_slipping_as(fitted[start], fitted[share], share_there, side)
    places[..., gain] *= (fitted[share] + _LEAST_SHARE) / (share_there + _LEAST_SHARE)
    return clipped(task, places)
