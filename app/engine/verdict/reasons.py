"""Why a verdict is as it is, reason by reason: shapes, rivals, published methods, the reference."""

import numpy as np

from app.counting import counted
from app.engine.causality.own_cycle import OwnCycle
from app.engine.codes import shape_code
from app.engine.corroborate import Corroboration
from app.engine.evidence import Measured, Operator, Reason, in_digits, measured_of
from app.engine.features import NAMES
from app.engine.fitness import Fitness
from app.engine.judgement import (
    OWN_CYCLE,
    Verdict,
)
from app.engine.reference.reliability import Reference
from app.engine.rivals import Rival
from app.engine.verdict.weighing import Weighing
from app.engine.verdict.wording import is_spoken, sentence

_REASONS_GIVEN = 3
_SAID = {"stiction": "stiction", "no_stiction": "no stiction", None: "neither"}


def own_cycle_reason(own: OwnCycle) -> tuple[Reason, ...]:
    if not own.shown:
        return ()
    text = (
        "PV moves as it would with a valve that stands still for a large part of each cycle; the position of such a "
        "valve predicts PV better than PV and OP alone do"
    )
    return (Reason(OWN_CYCLE, text),)


def stretches_reason(fitness: Fitness) -> tuple[Reason, ...]:
    whole = fitness.speaks_for
    if whole is None:
        return ()
    hours = in_digits(fitness.audited.length_s / 3600.0, 2)
    text = f"{whole.judged} stretches of {hours} h were each judged separately; the representative one is shown"
    text += (
        f"; {counted(whole.standing, 'more was', 'more were')} left out, because PV or OP stood still"
        if whole.standing
        else ""
    )
    return (Reason("stretches", text),)


def shape_reasons(weighing: Weighing, verdict: Verdict) -> tuple[Reason, ...]:
    """The features that weigh most for the verdict."""
    side = -1.0 if verdict == "no_stiction" else 1.0
    order = np.argsort(-side * weighing.contributions)
    loudest = [k for k in order if side * weighing.contributions[k] > 0.0 and is_spoken(NAMES[k], side > 0)]
    return tuple(_shape_reason(weighing, int(k), side > 0) for k in loudest[:_REASONS_GIVEN])


def _shape_reason(weighing: Weighing, k: int, for_stiction: bool) -> Reason:
    """What is measured passes where it speaks for stiction."""
    value, neutral = float(weighing.features.values[k]), float(weighing.neutral[k])
    operator: Operator = ">" if (value > neutral) == for_stiction else "<"
    return Reason(shape_code(NAMES[k]), sentence(NAMES[k], for_stiction, value), Measured(value, operator, neutral))


def rival_reasons(weighing: Weighing, verdict: Verdict) -> tuple[Reason, ...]:
    if verdict == "stiction":
        return ()
    return tuple(of_rival(rival) for rival in weighing.rivals[:2] if rival.stands_out)


def of_rival(rival: Rival) -> Reason:
    return Reason(rival.cause, rival.text, measured_of(rival.statistic, rival.operator, rival.threshold))


def methods_reason(methods: tuple[Corroboration, ...]) -> Reason:
    """How the published methods vote. They corroborate and do not change the verdict."""
    said = [m for m in methods if m.applies]
    if not said:
        return Reason("published_methods", "none of the published methods applies to this record")
    votes = [(words, [m.method for m in said if m.says == side]) for side, words in _SAID.items()]
    told = [_vote(words, names) for words, names in votes if names or words == _SAID["stiction"]]
    if len(said) == 1:
        text = f"the one published method that applies says {_SAID[said[0].says]} ({_named([said[0].method])})"
        return Reason("published_methods", f"{text}; it does not affect the verdict")
    which = f"of {len(said)} published methods that apply"
    return Reason("published_methods", f"{which}, {', '.join(told)}; they do not affect the verdict")


def _vote(words: str, methods: list[str]) -> str:
    named = _named(methods)
    count = str(len(methods)) if methods else "none"
    return f"{count} {'say' if len(methods) > 1 else 'says'} {words}{f' ({named})' if named else ''}"


def _named(methods: list[str]) -> str:
    return ", ".join(method.replace("_", " ") for method in methods)


def reference_reason(reference: Reference, verdict: Verdict) -> tuple[Reason, ...]:
    """States where the published rule disagrees; nothing where it agrees."""
    said = "stiction" if reference.last.stiction else "no_stiction"
    if verdict == "inconclusive" or said == verdict:
        return ()
    says = said.replace("_", " ")
    text = f"the published rule, run alongside as the reference, says {says}; it does not affect the verdict"
    return (Reason("reference_disagrees", text),)
