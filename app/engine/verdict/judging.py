"""The audited verdict: shapes combined into a calibrated probability, rivals weighed, reliability with its reasons."""

from dataclasses import replace

from app.engine.causality.hidden_band import hidden_band
from app.engine.causality.outside_corners import outside_corners
from app.engine.causality.own_cycle import OwnCycle, could_be_missed, own_cycle
from app.engine.codes import Cause
from app.engine.corroborate import corroborate
from app.engine.evidence import Reason
from app.engine.fitness import Fitness
from app.engine.judgement import UNCOUPLED, Judgement, Reliability, Verdict
from app.engine.oscillation import Oscillation
from app.engine.recording import UniformRecord
from app.engine.rivals import contest
from app.engine.verdict.config import VerdictConfig
from app.engine.verdict.doubts import (
    Lost,
    alike_reason,
    band_reason,
    corners_reason,
    data_doubts,
    doubts,
    foreign_cycle,
    lost_of,
    parts_disagree,
    unclear,
    unrelated_signals,
)
from app.engine.verdict.look_alikes import look_alikes
from app.engine.verdict.reasons import methods_reason, own_cycle_reason, rival_reasons, shape_reasons, stretches_reason
from app.engine.verdict.shape_model import ShapeModel, fitted_model
from app.engine.verdict.weighing import Weighing, weigh


def judge(
    record: UniformRecord,
    oscillation: Oscillation,
    fitness: Fitness,
    config: VerdictConfig | None = None,
    integrating: bool | None = None,
    model: ShapeModel | None = None,
) -> Judgement:
    """Verdict, probability, reliability, reasons and likely cause of one record that is fit to be audited.

    integrating: whether the process integrates; None if unknown. Only the published methods use it.
    model: the model of the shapes; None for the shipped one.
    """
    config, model = config or VerdictConfig(), model or fitted_model()
    weighing = weigh(record, oscillation, model)
    if weighing is None:
        text = "PV or OP does not vary in the audited stretch: nothing can be said"
        return Judgement("inconclusive", 0.5, "not_reliable", (Reason("no_variation", text),), None)
    judgement = conclude(weighing, oscillation, fitness, config, model)
    methods = corroborate(record, oscillation, integrating, weighing.features.windows)
    return replace(judgement, reasons=(*judgement.reasons, methods_reason(methods)), methods=methods)


def conclude(
    weighing: Weighing, oscillation: Oscillation, fitness: Fitness, config: VerdictConfig, model: ShapeModel
) -> Judgement:
    """The judgement that follows from the weighed evidence."""
    probability = weighing.probability
    unrelated, lost = unrelated_signals(fitness, oscillation, config), lost_of(fitness)
    verdict = _verdict(probability, unrelated, lost, config)
    own = _own(probability, verdict, oscillation, fitness, config)
    band = hidden_band(fitness.looked_at) if verdict == "no_stiction" else None
    doubted = (
        *(() if own.shown else unclear(weighing, config)),
        *doubts(weighing, verdict, oscillation, fitness, config),
        *band_reason(band),
        *parts_disagree(weighing, fitness, config),
        *data_doubts(weighing, fitness, config),
    )
    foreign = foreign_cycle(own)
    if verdict == "stiction" and not (own.shown or lost or unrelated or foreign or doubted):
        doubted = _dear_doubts(weighing, oscillation, fitness, config, model)
    reliability: Reliability = "not_reliable" if lost or unrelated or foreign or doubted else "reliable"
    first = (*([lost.reason] if lost else []), *unrelated, *foreign)
    reasons = (
        *first,
        *shape_reasons(weighing, verdict),
        *own_cycle_reason(own),
        *rival_reasons(weighing, verdict),
        *doubted,
        *stretches_reason(fitness),
    )
    ranked = contest(weighing.rivals, probability, weighing.features)
    found = Judgement(verdict, probability, reliability, reasons, _cause(weighing, verdict), ranked)
    found = replace(found, hidden_band_op=None if band is None else band.S)
    if lost and verdict == "inconclusive":
        return replace(found, likely_cause=lost.cause)
    return replace(found, likely_cause=None) if found.shows_no_valve else found


def _verdict(probability: float, unrelated: tuple[Reason, ...], lost: "Lost | None", config: VerdictConfig) -> Verdict:
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
    if probability >= config.sure_stiction_from and not could_be_missed(record):
        return OwnCycle()
    return own_cycle(record, period_s)


def _dear_doubts(
    weighing: Weighing, oscillation: Oscillation, fitness: Fitness, config: VerdictConfig, model: ShapeModel
) -> tuple[Reason, ...]:
    """Asked of what would be relied on, where no stem has told it already: chance, then corners from elsewhere."""
    if weighing.probability < config.unlike_linear_from:
        alike = alike_reason(look_alikes(fitness.audited, oscillation, weighing.log_odds_by_shapes, model))
        if alike:
            return alike
    if oscillation.period_s is None:
        return ()
    return corners_reason(outside_corners(fitness.looked_at, oscillation.period_s))


def _cause(weighing: Weighing, verdict: Verdict) -> Cause | None:
    if verdict == "stiction":
        return "stiction"
    if weighing.rivals and weighing.rivals[0].stands_out:
        return weighing.rivals[0].cause
    return None
