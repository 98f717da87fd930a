"""The whole way of one recording: fitness, oscillation, reference, verdict."""

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from app.engine import ENGINE_VERSION
from app.engine.audit_config import AuditConfig
from app.engine.causality.stuck_stem import StuckStem, stuck_stem
from app.engine.codes import UNANSWERED, Cause, CheckCode, ReasonCode
from app.engine.evidence import Reason, reason_of
from app.engine.fitness import Fitness, refused_as_standing
from app.engine.health import Health
from app.engine.health import health as health_of
from app.engine.judgement import Judgement
from app.engine.key_figures import KeyFigures
from app.engine.key_figures import compute as key_figures_of
from app.engine.long_records.episodes import (
    BEGAN,
    NO_EPISODES,
    EpisodeConfig,
    Episodes,
    episode_reasons,
    find,
    samples_wanted,
)
from app.engine.long_records.stretches import newest, newest_moving
from app.engine.oscillation import Oscillation, detect
from app.engine.plant_wide.swing import Swing, swing_of
from app.engine.preparation import Preparation, prepare
from app.engine.quantification import StictionSize, quantify
from app.engine.recording import Recording, UniformRecord, known_span
from app.engine.reference import published_rule
from app.engine.reference.reliability import LadderConfig, Reference, climb
from app.engine.verdict import judging
from app.engine.verdict.reasons import reference_reason
from app.engine.verdict.unanswered import standing, stuck, unanswered
from app.errors import DataError

__all__ = ["Audit", "AuditConfig", "Window", "audit", "ladder_for", "newest"]

SPOILED_BY: dict[CheckCode, Cause] = {
    "pv_flat": UNANSWERED,
    "op_flat": "controller_not_acting",
    "not_in_automatic": "not_in_automatic",
    "op_two_values": "on_off_control",
    "op_at_limits": "op_at_limits",
    "samples_per_cycle": "sampled_too_slowly",
}

# Findings that show a historian's compression: what lies between the stored values is not the loop's.
_REBUILT: frozenset[CheckCode] = frozenset({"pv_interpolated", "op_interpolated"})
_OF_STRETCHES: frozenset[ReasonCode] = frozenset({"stretches", "stretches_disagree"})
_SAME_PERIOD = 0.2  # difference of logarithms
_AS_CONFIGURED = AuditConfig()  # one of it, because its fingerprint costs as much as a stage of the audit


@dataclass(frozen=True)
class Window:
    """A stretch of the recording, in seconds from its start (first and last sample)."""

    start_s: float
    end_s: float
    samples: int


@dataclass(frozen=True, eq=False)
class Audit:
    """What one audit found, and what is needed to make it again.

    samples: samples of the recording. sampling_interval_s: of the audited stretch, else the recording's median; None
    below two samples.
    window: what was judged. identified: the part of it that the published rule was run on.
    op_span: max(OP) - min(OP) in what was identified, unit of OP.
    oscillation, window, identified, reference, op_span: None where the recording is not auditable.
    episodes: stretches of a long record in which the valve sticks while it does not in the rest.
    key_figures: over the whole recording, also where it is not auditable. health: from these and the verdict.
    swing: what is kept of a regular oscillation to compare loops by; None where there is none.
    stiction_size: None where the valve is cleared or nothing can be said. op_instrument_span: of OP, None: not known.
    input_fingerprint: SHA-256 of samples, spans and whether the process integrates; config_fingerprint: of the
    configuration.
    """

    recording: str
    samples: int
    sampling_interval_s: float | None
    fitness: Fitness
    oscillation: Oscillation | None
    window: Window | None
    identified: Window | None
    op_span: float | None
    reference: Reference | None
    judgement: Judgement
    episodes: Episodes
    key_figures: KeyFigures
    health: Health
    swing: Swing | None
    input_fingerprint: str
    config_fingerprint: str
    engine_version: str
    stiction_size: StictionSize | None = None
    op_instrument_span: float | None = None

    @property
    def stiction_band_pct_of_op_range(self) -> float | None:
        """The stiction band d of the last rung in per cent of the range that OP covers in what was identified."""
        if self.reference is None or not self.op_span:
            return None
        return 100.0 * float(self.reference.last.one.d_best) / self.op_span


def audit(recording: Recording, config: AuditConfig | None = None) -> Audit:
    """Audits one recording: the same recording, configuration and engine version give the same answer.

    recording: one loop's record, of any unit and sampling. A recording that cannot be audited is an answer, verdict
    "not_auditable" with the reasons, never an exception. Changing sign, scale or offset of PV or OP does not change the
    verdict.
    """
    config = config or _AS_CONFIGURED
    prepared = prepare(recording, config.fitness)
    fitness, oscillation = prepared.fitness, prepared.oscillation
    if fitness.standstill is not None:
        fitness = refused_as_standing(fitness)
        return _result(recording, config, fitness, _refusal(recording, fitness))
    stem = _stuck_stem(recording, prepared)
    if stem is not None:
        return _result(recording, config, fitness, _beside_refusals(stuck(stem), fitness))
    if oscillation is None or not fitness.auditable:
        return _result(recording, config, fitness, _refusal(recording, fitness), oscillation=oscillation)
    return _identified(recording, config, prepared, oscillation)


def _identified(recording: Recording, config: AuditConfig, prepared: Preparation, oscillation: Oscillation) -> Audit:
    fitness = prepared.fitness
    record = newest_moving(fitness.audited, config.max_samples)
    by_itself = judging.judge(fitness.audited, oscillation, fitness, config.judgement, recording.integrating)
    if prepared.rest_of is not None:
        by_itself = replace(by_itself, reasons=(*by_itself.reasons, _rest_reason(fitness, prepared.rest_of)))
    episodes = find(fitness.looked_at, _quicker(oscillation, fitness, config.episodes), config.episodes)
    judgement = _with_episodes(by_itself, episodes)
    try:
        reference = climb(record, ladder_for(judgement, config), config.hammerstein)
    except DataError as error:
        refusal = _unidentifiable(error, record)
        return _result(recording, config, fitness, refusal, oscillation=oscillation, record=record)
    judgement = _with_reference(judgement, reference, fitness, config)
    result = _result(
        recording,
        config,
        fitness,
        judgement,
        oscillation=oscillation,
        record=record,
        reference=reference,
        episodes=episodes,
    )
    # What was judged by itself is not the spell that turned the verdict.
    return replace(result, stiction_size=_stiction_size(record, fitness, oscillation, by_itself, config))


def _quicker(oscillation: Oscillation, fitness: Fitness, config: EpisodeConfig) -> Oscillation:
    """Of the oscillations of a long record and of the stretch that speaks for it the one by which shorter spells are
    seen.
    """
    if fitness.speaks_for is None:
        return oscillation
    return min((oscillation, fitness.speaks_for.oscillation), key=lambda one: samples_wanted(one, config))


def _with_episodes(judgement: Judgement, episodes: Episodes) -> Judgement:
    """What reliable spells add. A valve that sticks for a part of the record is not cleared by the rest of it; one that
    sticks up to the end sticks, whatever it did before, and that comes first.
    """
    reasons = episode_reasons(episodes)
    if judgement.verdict == "stiction" or not reasons:
        told = (*judgement.reasons, *reasons)
        return replace(judgement, reasons=told if judgement.reliability == "reliable" else _began_first(told))
    if all(reason.code != BEGAN for reason in reasons):
        return replace(judgement, reliability="not_reliable", reasons=(*judgement.reasons, *reasons))
    # What explains the rest of the record, and which parts of it agree, is not said of the spell.
    left = {rival.cause for rival in judgement.rivals} | _OF_STRETCHES
    kept = tuple(reason for reason in judgement.reasons if reason.code not in left)
    return replace(
        judgement,
        verdict="stiction",
        stiction_probability=[episode for episode in episodes.found if episode.at_end][-1].probability,
        reliability="not_reliable",
        reasons=_began_first((*reasons, *kept)),
        likely_cause="stiction",
    )


def _began_first(reasons: tuple[Reason, ...]) -> tuple[Reason, ...]:
    """When it began is what nobody should have to look for below why the record of before says otherwise."""
    return tuple(sorted(reasons, key=lambda reason: reason.code != BEGAN))


def _rest_reason(fitness: Fitness, rest_of: UniformRecord) -> Reason:
    share = fitness.audited.samples / rest_of.samples
    text = (
        f"the set point moves PV more than all else; judged where it stands, on {100 * share:.0f} % of the record, "
        "because the loop cycles there by itself; the remainder is not judged"
    )
    return Reason("set_point_rests", text)


def _stiction_size(
    record: UniformRecord, fitness: Fitness, oscillation: Oscillation, judgement: Judgement, config: AuditConfig
) -> StictionSize | None:
    if judgement.verdict not in ("stiction", "inconclusive"):
        return None
    as_sampled = not any(f.outcome == "fail" and f.code in _REBUILT for f in fitness.findings)
    return quantify(record, oscillation, as_sampled, config.quantification)


def ladder_for(judgement: Judgement, config: AuditConfig) -> LadderConfig:
    """The whole ladder, or its first rung where the shapes clear the valve by more than the configuration asks."""
    if (judgement.stiction_probability or 0.0) > config.doubt_above:
        return config.ladder
    return replace(config.ladder, widen=False, two_parameter=False)


def _with_reference(judgement: Judgement, reference: Reference, fitness: Fitness, config: AuditConfig) -> Judgement:
    """The published rule's reading beside the verdict, which it does not move, and what speaks against the data."""
    published = reference_reason(reference, judgement.verdict) + _published_reasons(reference, config)
    given = {reason.code for reason in judgement.reasons}
    doubts = tuple(reason_of(f) for f in fitness.findings if f.outcome == "fail" and f.code not in given)
    return replace(judgement, reasons=judgement.reasons + published + doubts)


def _published_reasons(reference: Reference, config: AuditConfig) -> tuple[Reason, ...]:
    """The reasons of the published rule, marked as its own; what it says of its own probability is left out."""
    reasons = published_rule.judge(reference, config.verdict).reasons
    marked = (replace(r, text=f"published rule: {r.text}") for r in reasons if r.code != "reference_only")
    return tuple(marked)


def _stuck_stem(recording: Recording, prepared: Preparation) -> StuckStem | None:
    """Of the whole of what could be audited, where that goes up to the recording's end: what was before and what is."""
    record = prepared.rest_of or prepared.fitness.whole
    return stuck_stem(record) if record is not None and ends_with(record, recording) else None


def ends_with(record: UniformRecord, recording: Recording) -> bool:
    """Whether a stretch goes up to the end of the recording that it is of."""
    length_s = record.samples * record.sampling_interval_s
    return record.start_s + length_s >= float(recording.time_s[-1] - recording.time_s[0])


def _refusal(recording: Recording, fitness: Fitness) -> Judgement:
    refusals, stands = fitness.refusals, fitness.standstill
    reasons = tuple(reason_of(finding) for finding in refusals)
    flat_throughout = stands is None or (stands.from_start and stands.levels == 1)
    if {reason.code for reason in reasons} == {"pv_flat"} and flat_throughout:
        dead = unanswered(recording)
        return replace(dead, reasons=dead.reasons + reasons)
    if stands is not None:
        return _beside_refusals(standing(stands), fitness)
    causes = [SPOILED_BY[finding.code] for finding in refusals if finding.code in SPOILED_BY]
    return Judgement("not_auditable", None, "not_reliable", reasons, causes[0] if causes else None)


def _beside_refusals(judgement: Judgement, fitness: Fitness) -> Judgement:
    return replace(judgement, reasons=judgement.reasons + tuple(reason_of(finding) for finding in fitness.refusals))


def _unidentifiable(error: DataError, record: UniformRecord) -> Judgement:
    reason, cause = Reason(cast(ReasonCode, error.code), error.message), None
    if np.ptp(record.pv) == 0.0 < np.ptp(record.op):
        text = f"PV holds one value for {record.samples} samples in which OP moves: a stuck valve or a dead transmitter"
        reason, cause = Reason("pv_flat", text), UNANSWERED
    return Judgement("not_auditable", None, "not_reliable", (reason,), cause)


def _result(
    recording: Recording,
    config: AuditConfig,
    fitness: Fitness,
    judgement: Judgement,
    *,
    oscillation: Oscillation | None = None,
    record: UniformRecord | None = None,
    reference: Reference | None = None,
    episodes: Episodes = NO_EPISODES,
) -> Audit:
    figures, span = key_figures_of(recording), known_span(recording.op_range)
    looked_at = None if record is None else fitness.looked_at
    return Audit(
        recording=recording.name,
        samples=recording.samples,
        sampling_interval_s=_interval(recording, fitness),
        fitness=fitness,
        oscillation=oscillation,
        window=None if looked_at is None else _window(looked_at),
        identified=None if record is None else _window(record),
        op_span=None if record is None else float(np.ptp(record.op)),
        reference=reference,
        judgement=judgement,
        episodes=episodes,
        key_figures=figures,
        health=health_of(judgement, figures, oscillation),
        swing=None if looked_at is None or oscillation is None else _swing(fitness, oscillation, config),
        input_fingerprint=recording.fingerprint(),
        config_fingerprint=config.fingerprint(),
        engine_version=ENGINE_VERSION,
        op_instrument_span=None if span is None else span[1] - span[0],
    )


def _swing(fitness: Fitness, oscillation: Oscillation, config: AuditConfig) -> Swing | None:
    """Of the newest samples, by the period that they show themselves where it is that of the stretch that was judged:
    over more cycles it is known better.
    """
    part, whole = newest(fitness.looked_at, config.max_samples), fitness.speaks_for
    if whole is not None:
        own = whole.oscillation if part is whole.record else detect(part)
        oscillation = own if own.regular and _same_period(own, oscillation) else oscillation
    return swing_of(part, oscillation)


def _same_period(one: Oscillation, other: Oscillation) -> bool:
    if one.period_s is None or other.period_s is None:
        return False
    return abs(np.log(one.period_s / other.period_s)) < _SAME_PERIOD


def _window(record: UniformRecord) -> Window:
    length_s = (record.samples - 1) * record.sampling_interval_s
    return Window(record.start_s, record.start_s + length_s, record.samples)


def _interval(recording: Recording, fitness: Fitness) -> float | None:
    if fitness.record is not None:
        return fitness.record.sampling_interval_s
    return float(np.median(np.diff(recording.time_s))) if recording.samples > 1 else None
