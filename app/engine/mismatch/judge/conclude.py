"""The verdict: missing physics, nothing missing, or that this record does not tell, and why."""

from dataclasses import dataclass, replace

import numpy as np

from app.counting import counted
from app.engine.evidence import Reason
from app.engine.mismatch.compete.richer_noise import ANSWERING
from app.engine.mismatch.compete.selection import Selection
from app.engine.mismatch.fit.fitting import Fit, fit, fit_linear, task_of
from app.engine.mismatch.fit.given import TraceModel
from app.engine.mismatch.fit.levels import ROUNDED, decimals_of
from app.engine.mismatch.fit.noise import compared_samples
from app.engine.mismatch.judge.holdout import Unseen, worse
from app.engine.mismatch.judge.result import Effect, Improvement, Verdict
from app.engine.mismatch.loop.experiment import Experiment

_LEAST_ANSWER = 10.0
_LEAST_TIMES = 4.0
SHIFTS, _MAY_FIT = (0.5, 0.31, 0.77, 0.19, 0.63), 1  # of the record; one may be a whole number of OP's periods
_LEAST_COMPARED = 100
ROUNDING = 1e-9
_FINE = 0.003  # of PV's span: wider levels are a pattern of PV
_FARTHEST = 2.0  # levels: rounding beside a little noise; what acts for a few samples goes farther
_UNRELATED = 0.7
_ASTRAY_SHARE = 0.5
_ASTRAY_PCT = -300.0  # fit of a free run that is four times as far from PV as PV's own mean is


@dataclass(frozen=True)
class _Conclusion:
    """The verdict, the effects that stand, and the reasons where the record does not tell."""

    verdict: Verdict
    effects: tuple[Effect, ...]
    reasons: tuple[Reason, ...] = ()


def conclude(
    base: Fit, shown: tuple[Effect, ...], fitted: tuple[Effect, ...], refused: tuple[Reason, ...], seen: Improvement
) -> _Conclusion:
    """shown: effects that PV shows by itself. fitted: those that a competition named. refused: why those that it named
    first do not stand. seen: the free runs over the stretch kept out.
    """
    effects = (*shown, *fitted)
    if effects:
        return _Conclusion("missing_physics", effects, refused)
    doubts = (*refused, *_too_little_told(base)) or free_run_astray(seen, float(np.ptp(base.record.pv)))
    return _Conclusion("inconclusive" if doubts else "consistent", (), doubts)


def op_moves_nothing(final: Fit) -> tuple[Reason, ...]:
    """Why nothing is named where OP does not move PV, with all that was named: the valve does not move, the loop was
    not at work, or they do not belong to one loop.

    Where PV moves OP by a controller's law, only names of valve and process are asked: they say how PV answers OP. What
    else moves PV moves OP with it, and cannot be told from OP's answer.
    """
    if not final.parts:
        return ()
    if final.record.op_follows_pv:
        return _stands_still(final) if all(part.block.place in ANSWERING for part in final.parts) else ()
    by_chance = sum(part.block.penalty for part in final.parts if part.block.place in ANSWERING)
    least = _LEAST_ANSWER + by_chance  # a search among names that answer OP finds as much in any OP
    told = told_by_op(final, least)
    if told >= least:
        return ()
    names = ", ".join(part.block.code for part in final.parts)
    text = (
        f"{names} would explain PV, but OP then adds only {told:.1f} points of log-likelihood over an OP at rest or at "
        f"other times; at least {least:.0f} are needed, and no controller's law explains OP: do they belong to one "
        "loop?"
    )
    return (Reason("op_moves_nothing", text),)


def told_by_op(final: Fit, enough: float) -> float:
    """By how much (nat) OP explains PV better than one that stands still does, and than the same OP at other times: a
    stem that only walks towards OP at a rate of its own walks towards that one too. enough: with less over an OP at
    rest no other is asked.
    """
    told = _told_more(final, _at_rest(final.record))
    if told < enough:
        return told
    elsewhere = sorted(_told_more(final, _op_moved(final.record, share)) for share in SHIFTS)
    return min(told, elsewhere[_MAY_FIT])


def _told_more(final: Fit, other: Experiment) -> float:
    """By how much (nat) a fit explains its own record better than another one with the same parts, fitted anew."""
    return final.likelihood - fit(task_of(replace(final, record=other)), final.x, None, 3).likelihood


def _stands_still(final: Fit) -> tuple[Reason, ...]:
    """That PV does not answer an OP by which a controller wants to move it; nothing where it does."""
    told = _answer_to_op(final)
    if told >= _LEAST_ANSWER:
        return ()
    names = ", ".join(part.block.code for part in final.parts)
    text = (
        f"PV does not answer OP: with {names}, OP adds {told:.1f} points of log-likelihood over noise alone; at least "
        f"{_LEAST_ANSWER:.0f} are needed: a valve that does not move, one that is blocked off, or a PV of another loop?"
    )
    return (Reason("op_moves_nothing", text),)


def unseen_data_refuse(selection: Selection, errors: Unseen, gain: float) -> tuple[Reason, ...]:
    """Names whose model follows the kept-out stretch worse than the bare refit does are no explanation: by its free
    run, and by what it gains there beside the noise (`gain`, nat).
    """
    integrating = selection.fit.given.integrating
    if not selection.effects or not worse(errors, gain, integrating=integrating):
        return ()
    names = ", ".join(" or ".join((effect.code, *effect.alternatives)) for effect in selection.effects)
    text = (
        f"{names} would explain what was fitted, but on the held-out stretch the error{_less_load(errors)} grows from "
        f"{errors.refitted:.4g} to {errors.explained:.4g}"
    )
    return (Reason("held_out_disagrees", text),)


def held_out_worse(
    effects: tuple[Effect, ...], fit: Improvement, errors: Unseen, gain: float, ran_worse: list[bool]
) -> tuple[Reason, ...]:
    """That names stand although the free run of the kept-out stretch is worse with them, by how much, and why they do.

    errors: over that stretch beside a load. gain: by how much (nat) they predict it better beside its noise. ran_worse:
    of the stretches that were looked at, that one first, whether the free run is worse there by more than chance.
    """
    if not effects or not fit.explained.rmse > fit.refitted.rmse:
        return ()
    names = ", ".join(" or ".join((effect.code, *effect.alternatives)) for effect in effects)
    if ran_worse[0]:
        why = f"it is worse over {sum(ran_worse)} of {len(ran_worse)} stretches held out in turn, not over most"
    elif errors.beside_load:
        why = (
            f"an unrecorded load offsets both: the error{_less_load(errors)} is {errors.explained:.4g} there, and "
            f"{errors.refitted:.4g} without them"
        )
    elif gain > 0.0:
        why = f"with the noise model included that stretch is predicted better, by {gain:.1f} points of log-likelihood"
    else:
        why = "the increase is within the noise"
    text = (
        f"with {names} the free run's error on the held-out stretch grows from {fit.refitted.rmse:.4g} to "
        f"{fit.explained.rmse:.4g}; they are kept, because {why}"
    )
    return (Reason("held_out_worse", text),)


def _less_load(errors: Unseen) -> str:
    return ", less its median over a cycle of the stem," if errors.beside_load else ""


def _too_little_told(base: Fit) -> tuple[Reason, ...]:
    """What keeps a record from clearing a simulation: few samples, little time, or a PV that does not answer OP."""
    record, plant = base.record, base.plant
    if few := too_few(record):
        return few
    slowest = (plant.tau if plant.leak > 0.0 else 0.0) + plant.tau2 + plant.tau3 + plant.theta
    if record.duration_s < _LEAST_TIMES * slowest:
        text = (
            f"the record lasts {record.duration_s:.4g} s, less than {_LEAST_TIMES:.0f} times the {slowest:.4g} s of "
            "the process"
        )
        return (Reason("too_few_data", text),)
    told = _answer_to_op(base)
    if told < _LEAST_ANSWER:
        text = (
            f"OP adds {told:.1f} points of log-likelihood over PV's own noise; at least {_LEAST_ANSWER:.0f} are needed "
            "to judge a simulation"
        )
        return (Reason("too_little_excitation", text),)
    return ()


def free_run_astray(seen: Improvement, pv_range: float) -> tuple[Reason, ...]:
    """Why a free run that is far from PV clears no simulation, although noise that wanders would explain it: what
    acts as slowly as that noise cannot be told from it. An integrating process adds up the least load.

    pv_range: from the lowest to the highest PV of the record, not zero. Where PV rests over the stretch kept out, far
    may be little of it: half of it is asked as well.
    """
    far = seen.refitted.fit_pct
    if not (far < _ASTRAY_PCT and seen.refitted.rmse > _ASTRAY_SHARE * pv_range):
        return ()
    text = (
        f"the free run is off PV by {seen.refitted.rmse:.4g} over the held-out stretch, {1.0 - far / 100.0:.0f} times "
        f"as far as PV's own mean there and {100.0 * seen.refitted.rmse / pv_range:.1f} % of PV's range: a wandering "
        "load explains it, and so would one that drifts or steps"
    )
    return (Reason("free_run_astray", text),)


def too_few(record: Experiment) -> tuple[Reason, ...]:
    """Why a record cannot be compared at all: a sample after a gap says where PV starts anew, not how it moves."""
    compared = int(np.sum(compared_samples(record.usable)))
    if compared >= _LEAST_COMPARED:
        return ()
    return (
        Reason("too_few_data", f"{counted(compared, 'sample')} can be compared; at least {_LEAST_COMPARED} are needed"),
    )


def nothing_left(base: Fit) -> bool:
    """Whether the linear refit leaves no more of PV than rounding: of numbers, or to the decimals that it is kept with,
    which stands to one side as long as PV rests. Wide levels are an effect, and say nothing of others.
    """
    seen = base.record.usable
    left, pv = base.residual[seen], base.record.pv[seen]
    if float(np.std(left)) <= ROUNDING * float(np.std(pv)):
        return True
    step = decimals_of(pv)
    nearly_all, all_of_it = np.quantile(np.abs(left), (0.98, 1.0))
    return bool(step <= _FINE * base.record.pv_span and nearly_all <= ROUNDED * step and all_of_it <= _FARTHEST * step)


def unrelated(behind: TraceModel) -> tuple[Reason, ...]:
    """Why nothing can be said of a simulated trace that does not answer the recorded OP."""
    if behind.share <= _UNRELATED:
        return ()
    text = (
        f"a linear model of the recorded OP leaves {100.0 * behind.share:.0f} % of the simulated trace unexplained: "
        "was it simulated from this OP? A loop simulated by itself has a different OP"
    )
    return (Reason("simulation_unrelated", text),)


def _answer_to_op(found: Fit) -> float:
    """Log-likelihood (nat) that a model gains over the linear one under an OP that stands still."""
    return found.likelihood - fit_linear(_at_rest(found.record), found.given).likelihood


def _at_rest(record: Experiment) -> Experiment:
    """The same record under an OP that stands still."""
    return record.with_op_changed(lambda op: np.full_like(op, record.op_mid))


def _op_moved(record: Experiment, share: float) -> Experiment:
    """The same record under an OP that comes later by a share of it; what leaves its end is at its start."""
    return record.with_op_changed(lambda op: np.roll(op, int(share * len(op))))
