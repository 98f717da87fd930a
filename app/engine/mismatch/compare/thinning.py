"""Long records made shorter for the competition: block means, as far as the process is slow enough to allow it, and
not beside a given simulation where OP follows PV.
"""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.evidence import Reason
from app.engine.mismatch.compete.competition import Contender
from app.engine.mismatch.compete.selection import Selection
from app.engine.mismatch.compete.worth import no_worse, swing_between
from app.engine.mismatch.fit.fitting import Fit, fit, fit_linear
from app.engine.mismatch.fit.free_run import free_run_error
from app.engine.mismatch.fit.task import make_task, start_at
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.physics import named
from app.engine.recording import BoolArray, FloatArray

WANTED_SAMPLES = 4000
_MOST_SAMPLES = 8000
_INTERVALS_A_TIME = 2.0


@dataclass(frozen=True, eq=False)
class Coarse:
    """A fit of a shorter record, and by which factor it is shorter (1: it is the record itself). stems: that it shows,
    each beside a loop of its own.
    """

    fit: Fit
    factor: int
    stems: tuple[Contender, ...] = ()


def factor_for(base: Fit) -> int:
    """By how much a record is thinned: to WANTED_SAMPLES where the process spans two coarse intervals at least, to
    MOST_SAMPLES whatever it does. Not beside a given simulation where OP follows PV: OP's mean over a block holds
    answers to what moved PV within it, and a model that copies those copies PV, or is one of the controller. A loop of
    our own is found from the same OP, and has its share of that.
    """
    record, plant = base.record, base.plant
    if record.fed_back and not base.given.own:
        return 1
    own = plant.tau if plant.leak > 0.0 else 10.0 * record.sampling_interval_s
    slowest = own + plant.tau2 + plant.theta
    allowed = max(int(slowest / (_INTERVALS_A_TIME * record.sampling_interval_s)), 1)
    factor = min(-(-record.samples // WANTED_SAMPLES), allowed)
    return max(factor, -(-record.samples // _MOST_SAMPLES))


def _thinned_op_ahead_pv_centred(record: Experiment, factor: int) -> Experiment:
    """The record (N,) at `factor` times its interval, (N // factor,).

    OP and measured causes are means over the coarse interval that a sample begins, for they act through it; PV is the
    mean around its instant, so that nothing is shifted in time.
    """
    op, pv = held_means(record.op, factor), centred_means(record.pv, factor)
    return replace(
        record.referring(record),
        sampling_interval_s=record.sampling_interval_s * factor,
        op=op,
        pv=pv,
        usable=centred_all(record.usable, factor),
        op_deviation=op - record.op_mid,
        pv_deviation=pv - record.pv_mid,
        sp=None if record.sp is None else centred_means(record.sp, factor),
        measured=tuple((name, held_means(signal, factor)) for name, signal in record.measured),
        rest=centred_means(record.rest, factor),
        finer=None,
        told_share=min(factor * record.told_share, 1.0),
    )


def held_means(signal: FloatArray, factor: int) -> FloatArray:
    """Means (N // factor,) over [k factor, (k + 1) factor)."""
    count = len(signal) // factor
    return signal[: count * factor].reshape(count, factor).mean(axis=1)


def centred_means(signal: FloatArray, factor: int) -> FloatArray:
    """Means (N // factor,) around k factor; the first and the last over what there is."""
    sums = np.concatenate(([0.0], np.cumsum(signal - signal[0])))
    at = np.arange(len(signal) // factor) * factor
    low, high = np.maximum(at - factor // 2, 0), np.minimum(at + factor // 2 + 1, len(signal))
    return signal[0] + (sums[high] - sums[low]) / (high - low)


def centred_all(mask: BoolArray, factor: int) -> BoolArray:
    return centred_means(mask.astype(np.float64), factor) > 1.0 - 1e-9


def coarse_of(base: Fit, factor: int) -> Coarse:
    """The linear refit of the thinned record, from the same given model."""
    if factor == 1:
        return Coarse(base, 1)
    return Coarse(fit_linear(_thinned_op_ahead_pv_centred(base.record, factor), base.given), factor)


@dataclass(frozen=True, eq=False)
class Refined:
    """A selection as the whole record bears it, and why names are lost that a shorter one suggested."""

    selection: Selection
    lost: tuple[Reason, ...] = ()


def refined(base: Fit, selection: Selection) -> Refined:
    """A selection made on a shorter record, its numbers fitted again on the whole one. Where that does not pay there,
    what would be said without the second of two effects, or nothing, is left of it.
    """
    if not selection.effects:
        return Refined(replace(selection, fit=base))
    parts = selection.fit.parts
    known = named(base.record, (part.block.name for part in parts))
    task = make_task(base.record, selection.fit.given, tuple(known[part.block.name] for part in parts))
    x = start_at(task, selection.fit.plant, np.concatenate([part.values for part in parts]))
    fine = fit(task, x, None, 2, 6)
    alone = None if selection.alone is None else refined(base, selection.alone)
    if fine.score > base.score and no_worse(fine, base):
        return Refined(replace(selection, fit=fine, alone=None if alone is None else alone.selection))
    lost = (_lost_in_words(base, fine, selection),)
    if alone is None:
        return Refined(Selection(base, (), selection.ranking), lost)
    return Refined(alone.selection, (*lost, *alone.lost))


def _lost_in_words(base: Fit, fine: Fit, selection: Selection) -> Reason:
    """Why names do not stand on the whole record."""
    names = ", ".join(" or ".join((effect.code, *effect.alternatives)) for effect in selection.effects)
    asked, gained = base.score - base.likelihood, fine.likelihood - base.likelihood
    asked += fine.likelihood - fine.score
    left = free_run_error(fine, swing_between(fine, base)), free_run_error(base, swing_between(fine, base))
    text = (
        f"{names} would explain the shortened record on which candidates compete ({selection.fit.record.samples:,} "
        f"samples), but over all {base.record.samples:,} samples it adds {gained:.1f} points of log-likelihood, where "
        f"{asked:.1f} are required, and the free run's error goes from {left[1]:.4g} to {left[0]:.4g}"
    )
    return Reason("whole_disagrees", text)
