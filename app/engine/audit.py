"""The whole way of one recording: fitness, oscillation, reference, verdict."""

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from app.engine import ENGINE_VERSION
from app.engine.audit_config import AuditConfig
from app.engine.codes import UNANSWERED, CheckCode, ReasonCode
from app.engine.evidence import Reason, reason_of
from app.engine.fitness import Fitness
from app.engine.health import Health
from app.engine.health import health as health_of
from app.engine.judged import judge
from app.engine.judgement import Judgement
from app.engine.key_figures import KeyFigures
from app.engine.key_figures import compute as key_figures_of
from app.engine.long_records.episodes import (
    NO_EPISODES,
    Episodes,
)
from app.engine.long_records.stretches import newest, newest_moving
from app.engine.oscillation import Oscillation, detect
from app.engine.plant_wide.swing import Swing, swing_of
from app.engine.quantification import StictionSize, quantify
from app.engine.recording import Recording, UniformRecord, known_span
from app.engine.reference import published_rule
from app.engine.reference.reliability import LadderConfig, Reference, climb
from app.engine.verdict.reasons import reference_reason
from app.errors import DataError

__all__ = ["Audit", "AuditConfig", "Window", "audit", "ladder_for", "newest"]

# Findings that show a historian's compression: what lies between the stored values is not the loop's.
_REBUILT: frozenset[CheckCode] = frozenset({"pv_interpolated", "op_interpolated"})
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

    samples: samples of the recording, one of each scan. sampling_interval_s: of the audited stretch, else the
    recording's median; None below two samples.
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


def audit(recording: Recording, config: AuditConfig | None = None, *, with_reference: bool = True) -> Audit:
    """Audits one recording: the same recording, configuration and engine version give the same answer.

    recording: one loop's record, of any unit and sampling. A recording that cannot be audited is an answer, verdict
    "not_auditable" with the reasons, never an exception. Changing sign, scale or offset of PV or OP does not change the
    verdict. with_reference: whether the published rule is run beside the verdict, which is half of the work.
    """
    config = config or _AS_CONFIGURED
    found = judge(recording, config)
    fitness, oscillation = found.fitness, found.oscillation
    if found.of_record is None or oscillation is None:
        return _result(recording, config, fitness, found.judgement, oscillation=oscillation)
    record = newest_moving(fitness.audited, config.max_samples)
    try:
        reference = climb(record, ladder_for(found.judgement, config), config.hammerstein) if with_reference else None
    except DataError as error:
        refusal = _unidentifiable(error, record)
        return _result(recording, config, fitness, refusal, oscillation=oscillation, record=record)
    result = _result(
        recording,
        config,
        fitness,
        _with_reference(found.judgement, reference, fitness, config),
        oscillation=oscillation,
        record=record,
        reference=reference,
        episodes=found.episodes,
    )
    return replace(result, stiction_size=_stiction_size(record, fitness, oscillation, found.of_record, config))


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


def _with_reference(
    judgement: Judgement, reference: Reference | None, fitness: Fitness, config: AuditConfig
) -> Judgement:
    """The published rule's reading beside the verdict, which it does not move, and what speaks against the data."""
    published: tuple[Reason, ...] = ()
    if reference is not None:
        published = reference_reason(reference, judgement.verdict) + _published_reasons(reference, config)
    given = {reason.code for reason in judgement.reasons}
    doubts = tuple(reason_of(f) for f in fitness.findings if f.outcome == "fail" and f.code not in given)
    return replace(judgement, reasons=judgement.reasons + published + doubts)


def _published_reasons(reference: Reference, config: AuditConfig) -> tuple[Reason, ...]:
    """The reasons of the published rule, marked as its own; what it says of its own probability is left out."""
    reasons = published_rule.judge(reference, config.verdict).reasons
    marked = (replace(r, text=f"published rule: {r.text}") for r in reasons if r.code != "reference_only")
    return tuple(marked)


def _unidentifiable(error: DataError, record: UniformRecord) -> Judgement:
    reason, cause = Reason(cast(ReasonCode, error.code), error.message), None
    if np.ptp(record.pv) == 0.0 < np.ptp(record.op):
        moved = f"{record.samples:,} samples in which OP moves"
        text = f"PV holds one value over {moved}: a stuck valve or a dead transmitter"
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
    figures, span = key_figures_of(recording, config.fitness), known_span(recording.op_range)
    looked_at = None if record is None else fitness.looked_at
    return Audit(
        recording=recording.name,
        samples=-(-recording.samples // fitness.repeats),
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
