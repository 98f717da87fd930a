"""The audited verdict: shapes fused to a calibrated probability, rivals heard, reliability stated with its reasons."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.answering import goes_its_own_way
from app.engine.corroborate import Corroboration, corroborate
from app.engine.coupling import strangers_chance, strangers_chance_finely
from app.engine.evidence import Finding, Reason
from app.engine.features import NAMES, Features, observe
from app.engine.fitness import Fitness
from app.engine.hidden_band import HiddenBand, hidden_band
from app.engine.judgement import (
    FOREIGN_CYCLE,
    HIDDEN_BAND,
    NO_ANSWER,
    OWN_CYCLE,
    PV_STANDS,
    UNCOUPLED,
    WOUND_UP,
    Judgement,
    Reliability,
    Verdict,
)
from app.engine.oscillation import Oscillation
from app.engine.own_cycle import OwnCycle, could_be_missed, own_cycle
from app.engine.recording import FloatArray, UniformRecord
from app.engine.reliability import Reference
from app.engine.rivals import FOLLOWED, SATURATED, Rival, compete, contest, held_out_fundamental
from app.engine.sampled import correlation
from app.engine.shape_model import ShapeModel, fitted_model
from app.engine.timekeeping import timekeeping
from app.engine.unanswered import CAUSE as STUCK_OR_DEAD
from app.engine.verdict_config import VerdictConfig
from app.engine.verdict_wording import is_spoken, sentence

_REASONS_GIVEN = 3
_PHASE_SINE = NAMES.index("phase_sine")
_SAID = {"stiction": "stiction", "no_stiction": "no stiction", None: "neither"}
# Findings that leave a verdict possible and take its reliability away. Not op_interpolated: against a standing PV an
# integrating controller runs on straight lines by itself.
_DOUBTFUL_DATA = frozenset({"pv_quantised", "pv_interpolated", "filled", "stored_points"})

# For most of the stretch one of them held one value, as behind a valve that is stuck: the rest of it says little.
_DEAD = frozenset({"op_flat", "pv_flat"})


@dataclass(frozen=True, eq=False)
class Weighing:
    """What one record's shapes say, before thresholds.

    log_odds: calibrated log-odds of stiction with the rivals that stand out counted; window_spread: standard deviation
    of the log-odds between windows. contributions: (F,) to the log-odds of the logistic, in the order of
    `features.NAMES`. rivals: the strongest first.
    """

    log_odds: float
    window_spread: float
    contributions: FloatArray
    features: Features
    rivals: tuple[Rival, ...]

    @property
    def probability(self) -> float:
        return _logistic(self.log_odds)

    @property
    def log_odds_by_shapes(self) -> float:
        """`log_odds` before the rivals were counted."""
        return self.log_odds + counted_against(self.rivals)

    @property
    def probability_by_shapes(self) -> float:
        return _logistic(self.log_odds_by_shapes)


def _logistic(log_odds: float) -> float:
    return 1.0 / (1.0 + float(np.exp(-np.clip(log_odds, -20.0, 20.0))))


def weigh(record: UniformRecord, oscillation: Oscillation, model: ShapeModel | None = None) -> Weighing | None:
    """The evidence of a record's shapes, or None where PV or OP does not vary.

    model: the fitted numbers; the ones that this version ships where None. Invariant to unit, offset and sign of PV and
    OP and to the time unit.
    """
    features = observe(record, oscillation)
    if features is None:
        return None
    return weigh_features(features, compete(record, oscillation, features), model or fitted_model())


def weigh_features(features: Features, rivals: tuple[Rival, ...], model: ShapeModel) -> Weighing:
    """The same from features and rivals already at hand."""
    return Weighing(
        log_odds=float(model.log_odds(features.values)) - counted_against(rivals),
        window_spread=float(np.std(model.log_odds(features.table))),
        contributions=model.contributions(features.values),
        features=features,
        rivals=rivals,
    )


def counted_against(rivals: tuple[Rival, ...]) -> float:
    """What the rivals that stand out take from the log-odds of stiction."""
    return sum(rival.counts for rival in rivals if rival.stands_out)


def judge(
    record: UniformRecord,
    oscillation: Oscillation,
    fitness: Fitness,
    config: VerdictConfig | None = None,
    integrating: bool | None = None,
) -> Judgement:
    """Verdict, probability, reliability, reasons and likely cause of one record that is fit to be audited.

    integrating: whether the process integrates, None where it is not known; only the published methods ask for it.
    """
    config = config or VerdictConfig()
    weighing = weigh(record, oscillation)
    if weighing is None:
        text = "PV or OP does not vary in the audited stretch: nothing can be said"
        return Judgement("inconclusive", 0.5, "not_reliable", (Reason("no_variation", text),), None)
    judgement = conclude(weighing, oscillation, fitness, config)
    methods = corroborate(record, oscillation, integrating, weighing.features.windows)
    return replace(judgement, reasons=(*judgement.reasons, methods_reason(methods)))


def conclude(weighing: Weighing, oscillation: Oscillation, fitness: Fitness, config: VerdictConfig) -> Judgement:
    """The judgement that follows from weighed evidence."""
    probability = weighing.probability
    unrelated, lost = _unrelated(fitness, oscillation, config), _lost(fitness)
    verdict = _verdict(probability, unrelated, lost, config)
    own = _own(probability, verdict, oscillation, fitness, config)
    doubts = _doubts(weighing, verdict, oscillation, fitness, own, config)
    doubts += _parts_disagree(weighing, fitness, config)
    doubts += tuple(_data_doubts(weighing, fitness, config))
    foreign = _foreign_cycle(own)
    reliability: Reliability = "not_reliable" if lost or unrelated or foreign or doubts else "reliable"
    first = (*([lost.reason] if lost else []), *unrelated, *foreign)
    reasons = (
        *first,
        *_shape_reasons(weighing, verdict),
        *_own_cycle_reason(own),
        *_rival_reasons(weighing, verdict),
        *doubts,
    )
    reasons += _stretches_reason(fitness)
    ranked = contest(weighing.rivals, probability, weighing.features)
    found = Judgement(verdict, probability, reliability, reasons, _cause(weighing, verdict), ranked)
    if lost and verdict == "inconclusive":
        return replace(found, likely_cause=lost.cause)
    return replace(found, likely_cause=None) if found.shows_no_valve else found


def _verdict(probability: float, unrelated: tuple[Reason, ...], lost: "_Lost | None", config: VerdictConfig) -> Verdict:
    if abs(probability - 0.5) < config.undecided_within:
        return "inconclusive"
    if probability > 0.5:
        return "stiction"
    # Behind a valve that does not move at all PV owes nothing to OP: what accuses nobody clears nobody there.
    strangers = any(reason.code == UNCOUPLED for reason in unrelated)
    return "inconclusive" if strangers or lost else "no_stiction"


def _own(
    probability: float, verdict: Verdict, oscillation: Oscillation, fitness: Fitness, config: VerdictConfig
) -> OwnCycle:
    """Whether the cycle is the valve's, asked where it is likely, or where it would be missed."""
    record, period_s = fitness.looked_at, oscillation.period_s
    if verdict != "stiction" or probability < config.reliable_own_cycle_from or period_s is None:
        return OwnCycle()
    if probability >= config.reliable_stiction_from and not could_be_missed(record):
        return OwnCycle()
    return own_cycle(record, period_s)


def _band_reason(band: HiddenBand | None) -> tuple[Reason, ...]:
    if band is None:
        return ()
    text = (
        f"PV goes as behind a valve that moves only after OP has gone some {band.S:.2g} units the other way: it may "
        "stick, or have play, by so much, whatever the shapes say"
    )
    return (Reason(HIDDEN_BAND, text),)


def _own_cycle_reason(own: OwnCycle) -> tuple[Reason, ...]:
    if not own.shown:
        return ()
    text = (
        "PV moves as it would behind a valve that stands still for a large part of each cycle; the position of such a "
        "valve foretells PV better than PV and OP alone do"
    )
    return (Reason(OWN_CYCLE, text),)


def _foreign_cycle(own: OwnCycle) -> tuple[Reason, ...]:
    if not own.missed:
        return ()
    text = (
        f"in {own.cycles:.0f} cycles PV does not go as behind a valve that sticks for much of what OP moves in each, "
        "as it would if the valve made them: what goes to and fro elsewhere makes such shapes too, and has PV stand"
    )
    return (Reason(FOREIGN_CYCLE, text),)


def _doubts(
    weighing: Weighing,
    verdict: Verdict,
    oscillation: Oscillation,
    fitness: Fitness,
    own: OwnCycle,
    config: VerdictConfig,
) -> tuple[Reason, ...]:
    """Why the shapes and their time do not make the verdict reliable; empty where they do."""
    doubts = []
    if not own.shown:
        doubts.extend(_unclear(weighing, oscillation, config))
    if oscillation.cycles < config.min_cycles:
        text = f"what was judged holds {oscillation.cycles:.1f} cycles; {config.min_cycles:g} or more can be relied on"
        doubts.append(Reason("few_cycles", text))
    if verdict == "no_stiction":
        doubts.extend((*_no_answer(fitness), *_band_reason(hidden_band(fitness.looked_at))))
    if verdict == "stiction":
        doubts.extend(_shaped_outside(weighing, config))
        doubts.extend(_keeps_time(fitness.audited, oscillation, config))
        doubts.extend(Reason(rival.cause, rival.text) for rival in weighing.rivals if rival.stands_out and rival.counts)
    return tuple(doubts)


def _parts_disagree(weighing: Weighing, fitness: Fitness, config: VerdictConfig) -> tuple[Reason, ...]:
    """Of a long record its stretches are asked, of others the windows."""
    whole = fitness.speaks_for
    if whole is not None:
        text = f"only {whole.agreeing} of the {whole.judged} stretches that were judged are on this side"
        text += "" if whole.newest_agree else ", the newest two are not"
        return (Reason("stretches_disagree", text),) if whole.contested else ()
    if weighing.window_spread <= config.max_window_spread * abs(weighing.log_odds_by_shapes):
        return ()
    return (Reason("windows_disagree", "parts of the record say different things about the valve"),)


def _stretches_reason(fitness: Fitness) -> tuple[Reason, ...]:
    whole = fitness.speaks_for
    if whole is None:
        return ()
    length_h = fitness.audited.samples * fitness.audited.sampling_interval_s / 3600.0
    text = f"{whole.judged} stretches of {length_h:.2g} h were judged each by itself; the middle one of them is shown"
    text += f"; {whole.standing} more are left out, because PV or OP stood still" if whole.standing else ""
    return (Reason("stretches", text),)


def _unclear(weighing: Weighing, oscillation: Oscillation, config: VerdictConfig) -> list[Reason]:
    """A limit cycle is evidence of its own, a sine that comes from outside is none; and a rival that stands out makes
    stiction the less likely cause, but clears no valve whose shapes do not.
    """
    probability, shapes = weighing.probability, weighing.probability_by_shapes
    if probability <= config.reliable_no_stiction_to:
        if shapes <= config.reliable_no_stiction_to:
            return []
        text = f"another cause explains the record, but the shapes do not clear the valve: {shapes:.2f} by them alone"
        return [Reason("not_cleared", text)]
    if probability >= config.reliable_stiction_from:
        return []
    if probability >= config.reliable_cycling_from and _limit_cycle(weighing, oscillation, config):
        return []
    text = f"the evidence is not clear enough: probability of stiction {probability:.2f}"
    return [Reason("evidence_not_clear", text)]


def _limit_cycle(weighing: Weighing, oscillation: Oscillation, config: VerdictConfig) -> bool:
    """Whether the loop swings regularly and strongly, and not as one sine under noise does: a valve that sticks lets go
    now and then. Nor in quadrature, as what comes from outside does behind integral action, and what too much of that
    makes: where a limit cycle is in quadrature it has corners, and the shapes say so clearly.
    """
    if not oscillation.regular or oscillation.strength < config.strong_swing:
        return False
    if weighing.features.values[_PHASE_SINE] > config.max_cycling_phase:
        return False
    if any(rival.cause == "set_point_following" and (rival.explained or 0.0) >= FOLLOWED for rival in weighing.rivals):
        return False
    window = weighing.features.windows[0]
    return any(held_out_fundamental(x) < config.max_cycling_wave for x in (window.pv, window.op))


def _unrelated(fitness: Fitness, oscillation: Oscillation, config: VerdictConfig) -> tuple[Reason, ...]:
    """Where PV and OP are one signal, or may be strangers (a tag of another loop), nothing is shown of a valve; little
    where they go together only in what is quick.
    """
    record = fitness.audited
    if 1.0 - correlation(record.pv, record.op) ** 2 < config.min_difference:
        text = "PV is OP on another scale: a controller of gain alone, one tag for both, or no process between them"
        return (Reason("same_signal", text),)
    if strangers_chance(fitness.looked_at, oscillation) < config.max_strangers_chance:
        return ()
    if strangers_chance_finely(fitness.looked_at, oscillation) < config.max_strangers_chance:
        text = "what is new in PV and what is new in OP go together in what is quick, and not over a part of a swing"
        return (Reason("uncoupled_slowly", text),)
    text = (
        "what is new in PV and what is new in OP have nothing to do with each other: tags of two loops, or no loop, or "
        "a historian that stored each only now and then"
    )
    return (Reason("uncoupled", text),)


@dataclass(frozen=True)
class _Lost:
    """That by the end of a record nothing is controlled any more: what the valve did till then clears it no longer."""

    reason: Reason
    cause: str


def _lost(fitness: Fitness) -> _Lost | None:
    if fitness.pv_dead_s is not None:
        text = (
            f"PV has held one value for the last {fitness.pv_dead_s / 3600.0:.2g} h while OP moved, and never for so "
            "long before: unless the unit stands, the transmitter is dead, or the valve is stuck; look at both"
        )
        return _Lost(Reason(PV_STANDS, text), STUCK_OR_DEAD)
    if fitness.wound_up_s is not None:
        text = (
            f"OP has mostly stood at its limit for the last {fitness.wound_up_s / 3600.0:.2g} h, as never before, and "
            "PV does not come back for it: the valve may stand fast by now, or be too small for the load"
        )
        return _Lost(Reason(WOUND_UP, text), SATURATED)
    return None


def _no_answer(fitness: Fitness) -> list[Reason]:
    """Where PV is carried away and is not seen to answer OP, the valve may stand fast, and its loop not cycle."""
    record = fitness.looked_at
    if not goes_its_own_way(record):
        return []
    text = (
        f"PV goes its way and shows no answer to OP, which went over {np.ptp(record.op):.3g} units: so it does behind "
        "a valve that stands fast, or moves now and then only"
    )
    return [Reason(NO_ANSWER, text)]


def _shaped_outside(weighing: Weighing, config: VerdictConfig) -> list[Reason]:
    """Where PV and OP are all but the set point's movement, or one sine, the shape need not be the valve's."""
    doubts = []
    for rival in weighing.rivals:
        if rival.cause == "set_point_following" and _follows(rival, config):
            doubts.append(Reason("set_point_moves", rival.text))
        if rival.cause == "external_oscillation" and (rival.statistic or 0.0) >= config.max_wave:
            doubts.append(Reason("nearly_sinusoidal", rival.text))
    return doubts


def _follows(rival: Rival, config: VerdictConfig) -> bool:
    """PV alone is enough where it is all the set point's: on a level OP is the slope of SP, no response to it."""
    return rival.strength >= config.max_following or (rival.explained or 0.0) >= config.max_followed


def _keeps_time(record: UniformRecord, oscillation: Oscillation, config: VerdictConfig) -> list[Reason]:
    """A swing that comes back to its time is driven from outside, whatever its shape."""
    found = timekeeping(record, oscillation)
    if found is None or found.jitter >= min(config.min_jitter, config.min_jitter_of_unlike * found.unlike):
        return []
    text = (
        f"{oscillation.cycles:.0f} cycles keep time to {100 * found.jitter:.2g} % of a cycle, though they differ by "
        f"{100 * found.unlike:.0f} % of the swing, as what a timer or a machine drives; a valve that sticks lets go "
        "sooner or later each time"
    )
    return [Reason("keeps_time", text)]


def _data_doubts(weighing: Weighing, fitness: Fitness, config: VerdictConfig) -> list[Reason]:
    # Where the loop cycles on the resolution of its sensor, coarse values are the explanation and not a doubt.
    cycles_on_it = any(r.cause == "quantised_sensor" and r.stands_out for r in weighing.rivals)
    codes = _DOUBTFUL_DATA - {"pv_quantised"} if cycles_on_it else _DOUBTFUL_DATA
    doubts = [Reason(f.code, f.text) for f in fitness.findings if f.outcome == "fail" and f.code in codes]
    doubts += [Reason(f.code, f.text) for f in fitness.findings if f.code in _DEAD and _beyond(f)]
    if fitness.filled_share is not None and fitness.filled_share > config.max_filled_share:
        text = f"{100 * fitness.filled_share:.0f} % of the samples were filled by interpolation"
        doubts.append(Reason("filled_share", text))
    if fitness.automatic_share is not None and fitness.automatic_share < config.min_automatic_share:
        text = f"the loop was in automatic for {100 * fitness.automatic_share:.0f} % of the recording only"
        doubts.append(Reason("mode_share", text))
    return doubts


def _beyond(finding: Finding) -> bool:
    """Whether a check's statistic is beyond its threshold, also where enough was left to go on with."""
    value, threshold = finding.statistic, finding.threshold
    return value is not None and threshold is not None and value >= threshold


def _shape_reasons(weighing: Weighing, verdict: Verdict) -> tuple[Reason, ...]:
    """The features that speak loudest for the verdict."""
    side = -1.0 if verdict == "no_stiction" else 1.0
    order = np.argsort(-side * weighing.contributions)
    loudest = [k for k in order if side * weighing.contributions[k] > 0.0 and is_spoken(NAMES[k], side > 0)]
    return tuple(
        Reason(f"shape_{NAMES[k]}", sentence(NAMES[k], side > 0, weighing.features.values[k]))
        for k in loudest[:_REASONS_GIVEN]
    )


def _rival_reasons(weighing: Weighing, verdict: Verdict) -> tuple[Reason, ...]:
    if verdict == "stiction":
        return ()
    return tuple(Reason(rival.cause, rival.text) for rival in weighing.rivals[:2] if rival.stands_out)


def methods_reason(methods: tuple[Corroboration, ...]) -> Reason:
    """How the published methods vote; they corroborate and do not move the verdict."""
    said = [m for m in methods if m.applies]
    if not said:
        return Reason("published_methods", "none of the published methods applies to this record")
    votes = [(words, [m.method for m in said if m.says == side]) for side, words in _SAID.items()]
    told = [_vote(words, names) for words, names in votes if names or words == _SAID["stiction"]]
    if len(said) == 1:
        text = f"the one published method that applies says {_SAID[said[0].says]} ({_named([said[0].method])})"
        return Reason("published_methods", f"{text}; it does not move the verdict")
    which = f"of {len(said)} published methods that apply"
    return Reason("published_methods", f"{which}, {', '.join(told)}; they do not move the verdict")


def _vote(words: str, methods: list[str]) -> str:
    named = _named(methods)
    count = str(len(methods)) if methods else "none"
    return f"{count} {'say' if len(methods) > 1 else 'says'} {words}{f' ({named})' if named else ''}"


def _named(methods: list[str]) -> str:
    return ", ".join(method.replace("_", " ") for method in methods)


def reference_reason(reference: Reference, verdict: Verdict) -> tuple[Reason, ...]:
    """Says where the published rule disagrees; nothing where it does not."""
    said = "stiction" if reference.last.stiction else "no_stiction"
    if verdict == "inconclusive" or said == verdict:
        return ()
    says = said.replace("_", " ")
    text = f"the published rule, run beside it as the reference, says {says}; it does not move the verdict"
    return (Reason("reference_disagrees", text),)


def _cause(weighing: Weighing, verdict: Verdict) -> str | None:
    if verdict == "stiction":
        return "stiction"
    if weighing.rivals and weighing.rivals[0].stands_out:
        return weighing.rivals[0].cause
    return None
