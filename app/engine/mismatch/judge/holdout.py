"""What no fit has seen: a stretch is kept out, the believed model is fitted on the rest, and its free run is judged
there.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.engine.mismatch.compete.competition import descended
from app.engine.mismatch.fit.fitting import Fit, descend, fit, fit_linear, noise_left
from app.engine.mismatch.fit.free_run import beside_load, settle, stem_swing
from app.engine.mismatch.fit.given import own_again
from app.engine.mismatch.fit.noise import compared_samples, whiten
from app.engine.mismatch.fit.task import Given, make_task, start_at
from app.engine.mismatch.fit.windows import active_mask
from app.engine.mismatch.judge.residuals import ResidualTests
from app.engine.mismatch.loop.block import Part
from app.engine.recording import BoolArray, FloatArray

_SHARE = 0.3
_WORSE_UNSEEN, _MUCH_WORSE = 1.05, 1.3
_SEEN_AT_LEAST = 0.35
_STANDS = 1e-12
_ROUNDS, _STEPS = 2, 6
_LOST = 20.0
"""Nats by which the samples that are left say that a way downhill ended in another valley."""

_PLACES = (0.7, 0.0, 0.35, 0.5, 0.2)


@dataclass(frozen=True, eq=False)
class FitMeasures:
    """How well a free run follows PV over some samples. rmse: unit of PV; fit_pct: 100 (1 - rmse / deviation of PV),
    NaN where PV stands. tests: of what it leaves there, where they were made.
    """

    rmse: float
    fit_pct: float
    tests: ResidualTests | None = None


def judge(pv: FloatArray, simulated: FloatArray, where: BoolArray) -> FitMeasures:
    """RMSE and fit per cent of a simulation (N,) against PV (N,) over the samples `where`."""
    recorded = pv[where]
    if len(recorded) == 0:
        return FitMeasures(float("nan"), float("nan"))
    rmse = _rms(pv - simulated, where)
    spread = float(np.std(recorded))
    # The deviation of equal values from their mean is rounding.
    moves = spread > _STANDS * float(np.max(np.abs(recorded)))
    return FitMeasures(rmse, 100.0 * (1.0 - rmse / spread) if moves else float("nan"))


def _rms(error: FloatArray, where: BoolArray) -> float:
    """Root mean square of an error (N,) over the samples `where`; NaN where there are none."""
    return float(np.sqrt(np.mean(error[where] ** 2))) if where.any() else float("nan")


@dataclass(frozen=True, eq=False)
class FreeRuns:
    """The bare refit and the explained model (N,), in the unit of PV, fitted without the samples `held` (N,). gain: by
    how much (nat) the explained model predicts those better. model: the explained one. sensors: what shows it so.
    """

    refitted: FloatArray
    explained: FloatArray
    held: BoolArray
    gain: float
    model: Fit
    sensors: tuple[Part, ...]


def stretches(usable: BoolArray) -> list[BoolArray]:
    """The stretches of a record that may be kept out: masks (N,) of about 30 % of its usable samples, True where kept
    out; the rest is left to fit, however few samples a fault of PV leaves.
    """
    at = np.flatnonzero(usable)
    found = []
    for place in _PLACES:
        held = np.zeros(len(usable), dtype=np.bool_)
        held[at[int(place * len(at)) : int(min(place + _SHARE, 1.0) * len(at))]] = True
        found.append(held)
    return found


@dataclass(frozen=True)
class Unseen:
    """RMSE of both free runs over the samples kept out, unit of PV; beside_load: less what a load does to them, because
    the explained model's loop was found behind a stem that slips.
    """

    refitted: float
    explained: float
    beside_load: bool = False


def unseen_errors(pv: FloatArray, run: FreeRuns) -> Unseen:
    seen, swing = run.model.record.usable | run.held, stem_swing(run.model)
    refitted, explained = (beside_load(pv - simulated, seen, swing) for simulated in (run.refitted, run.explained))
    return Unseen(_rms(refitted, run.held), _rms(explained, run.held), swing is not None)


def worse(errors: Unseen, gain: float, *, integrating: bool) -> bool:
    """Whether an explained model runs worse over samples that it has not seen than the bare refit, and predicts them no
    better beside its noise either (`gain`, nat): under slow noise a free run stands high or low by chance, though not
    as far as _MUCH_WORSE, unless the process integrates what the noise brings.
    """
    far = np.inf if integrating else _MUCH_WORSE
    return errors.explained > (_WORSE_UNSEEN if gain <= 0.0 else far) * errors.refitted


def mostly_worse(pv: FloatArray, runs: Sequence[FreeRuns]) -> bool:
    """Whether the explained model runs worse than the refit over most of the stretches that have samples: where OP
    goes, over one of them, as it does nowhere else, a true name may run astray there.
    """
    seen = [r for r in runs if r.held.any()]
    return 2 * sum(ran_worse(pv, run) for run in seen) > len(seen)


def ran_worse(pv: FloatArray, run: FreeRuns) -> bool:
    return worse(unseen_errors(pv, run), run.gain, integrating=run.model.given.integrating)


def kept_out(found: Fit, usable: BoolArray) -> BoolArray:
    """A stretch of about 30 % of the record, the last where possible, such that what acts in time is seen outside it
    too.
    """
    masks = [active_mask(found, part) for part in found.parts if part.block.active is not None]
    offered = stretches(usable)
    for held in offered:
        if held.any() and all(_seen_outside(mask & usable, held) for mask in masks):
            return held
    return max(offered, key=lambda held: min([_outside_share(mask & usable, held) for mask in masks], default=1.0))


def _outside_share(mask: BoolArray, held: BoolArray) -> float:
    total = int(mask.sum())
    return float((mask & ~held).sum()) / total if total else 1.0


def _seen_outside(mask: BoolArray, held: BoolArray) -> bool:
    """Enough of the stretches where a part acts lies outside, and none of their edges within."""
    if _outside_share(mask, held) < _SEEN_AT_LEAST:
        return False
    few = np.flatnonzero(np.diff(mask.astype(np.int8)))
    return len(few) > 6 or not held[few].any()


def unseen_gain(before: Fit, after: Fit, held: BoolArray) -> float:
    """By how much (nat) one model predicts the samples `held` (N,) better than another, either under its own noise.

    A free run under noise as slow as the stretch is long stands high or low in it by chance; its innovations do not.
    """
    return unseen_likelihood(after, held) - unseen_likelihood(before, held)


def unseen_likelihood(found: Fit, held: BoolArray) -> float:
    seen = found.record.usable | held
    e = whiten(found.residual, seen, found.noise)[held & compared_samples(seen)] / found.noise.deviation
    return -len(e) * float(np.log(found.noise.deviation)) - 0.5 * float(e @ e)


def refit_without(found: Fit, held: BoolArray, given: Given | None = None) -> Fit:
    """The same model with all its numbers fitted again, the held-out samples not compared. given: the linear model to
    begin with, where it is known already.

    A fit that gains nothing stays where it began, and that must not be what has seen the held-out samples: a linear
    model is fitted from the given one again. One with blocks first goes downhill, under the noise of the other samples,
    from where the fit of all ended: without the numbers along which the simulation jumps, because their slopes mislead
    and a descent of all at once may not move. Where that leaves the valley, as the samples that are left say, it is
    fitted from where the fit of all ended: what was held out tells in which valley it lies, as it does which blocks it
    has. What is known of a linear loop of our own beforehand is read off the other samples too.
    """
    record = found.record.comparing(found.record.usable & ~held)
    given = own_again(record, found.given) if given is None else given
    if not found.parts:
        return fit_linear(record, given)
    task = make_task(record, given, tuple(part.block for part in found.parts))
    known = [part.values for part in found.parts]
    x = found.x if given is found.given else start_at(task, found.plant, np.concatenate(known))
    noise = noise_left(task, x, found.noise)
    smooth = [k for k, free in enumerate(task.free) if "." not in free.name or free.linear]
    begun = descended(task, descend(task, x, noise, _STEPS, smooth), _STEPS)
    blind = settle(fit(task, begun.x, begun.noise, _ROUNDS, _STEPS))
    near = settle(fit(task, x, found.noise, _ROUNDS, _STEPS))
    return near if near.likelihood > blind.likelihood + _LOST else blind
