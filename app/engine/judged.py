"""What one recording says by itself: whether it is fit, how it oscillates, the verdict, the spells that turn it. The
published rule is run beside that (`audit`)."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.audit_config import AuditConfig
from app.engine.causality.stuck_stem import StuckStem, stuck_stem
from app.engine.codes import UNANSWERED, Cause, CheckCode, ReasonCode
from app.engine.evidence import Reason, in_digits, reason_of, told_probability
from app.engine.fitness import Fitness, refused_as_standing
from app.engine.judgement import Judgement
from app.engine.long_records.episodes import (
    BEGAN,
    NO_EPISODES,
    EpisodeConfig,
    Episodes,
    episode_reasons,
    find,
    samples_wanted,
)
from app.engine.long_records.stretches import NEWEST_SAMPLES, newest_moving
from app.engine.oscillation import Oscillation
from app.engine.preparation import Preparation, prepare
from app.engine.recording import Recording, UniformRecord
from app.engine.verdict import judging
from app.engine.verdict.shape_model import ShapeModel
from app.engine.verdict.unanswered import standing, stuck, unanswered

__all__ = ["Judged", "identified_part", "judge"]

SPOILED_BY: dict[CheckCode, Cause] = {
    "pv_flat": UNANSWERED,
    "op_flat": "controller_not_acting",
    "not_in_automatic": "not_in_automatic",
    "op_two_values": "on_off_control",
    "op_at_limits": "op_at_limits",
    "samples_per_cycle": "sampled_too_slowly",
}

_OF_STRETCHES: frozenset[ReasonCode] = frozenset({"stretches", "stretches_disagree"})


@dataclass(frozen=True, eq=False)
class Judged:
    """What a recording says by itself.

    fitness: of the stretch that is judged. oscillation: in it; None where there is none to be judged. judgement: the
    verdict with its spells. of_record: the verdict of what was judged by itself, without the spells, of which a size is
    told; None where nothing was identifiable: then the judgement is all that is said.
    """

    fitness: Fitness
    oscillation: Oscillation | None
    judgement: Judgement
    of_record: Judgement | None = None
    episodes: Episodes = NO_EPISODES


def judge(recording: Recording, config: AuditConfig, model: ShapeModel | None = None) -> Judged:
    """The verdict of one recording, whatever is run beside it. model: the fitted numbers; the ones that this version
    ships where None (another one judges what these were fitted on).

    Behind the longest stretch a newer one may be left, too short to be judged in its place unasked. Where that can be
    relied on by itself it says what the valve does now; where it only says otherwise, the longest is not relied on.
    """
    found = _judged(recording, config, model)
    if not _leaves_newer(recording, found, config):
        return found
    alone = replace(config.fitness, newest_share=0.0, min_samples=config.judgement.min_samples)
    return _of_both(found, _judged(recording, replace(config, fitness=alone), model))


def identified_part(recording: Recording, max_samples: int = NEWEST_SAMPLES) -> UniformRecord | None:
    """The part of a recording on which a model of the loop is identified: of what is judged the newest samples in which
    the loop is at work. None where nothing is judged.
    """
    found = judge(recording, AuditConfig())
    return None if found.of_record is None else newest_moving(found.fitness.audited, max_samples)


def _leaves_newer(recording: Recording, found: Judged, config: AuditConfig) -> bool:
    """Whether behind what was judged so many samples are left as a verdict needs to be relied on."""
    whole = found.fitness.whole
    if found.of_record is None or whole is None:
        return False
    end_s = float(recording.time_s[0]) + whole.start_s + whole.length_s
    return recording.samples - int(np.searchsorted(recording.time_s, end_s)) >= config.judgement.min_samples


def _of_both(longest: Judged, newest: Judged) -> Judged:
    """A valve does not come loose by itself, and a short stretch shows less of one that sticks: it clears none that the
    longest does not clear, but takes the trust in what the longest says.
    """
    said, now = longest.judgement, newest.judgement
    if newest.of_record is None or now.verdict == "inconclusive":
        return longest
    before, since = longest.fitness.looked_at, newest.fitness.looked_at
    if since.start_s <= before.start_s:
        return longest
    hours = in_digits(since.length_s / 3600.0, 2)
    told = f"the newest stretch, {since.samples:,} samples in {hours} h,"
    cleared = (said.verdict, said.reliability) == ("no_stiction", "reliable")
    if now.reliability == "reliable" and (now.verdict == "stiction" or cleared):
        text = f"{told} is judged: it is long enough by itself; the longest, of {before.samples:,}, is older"
        return replace(newest, judgement=replace(now, reasons=(*now.reasons, Reason("newer_judged", text))))
    if now.verdict == said.verdict or said.reliability != "reliable":
        return longest
    probability = told_probability(now.stiction_probability or 0.0)
    text = f"{told} was judged as well and disagrees: probability of stiction {probability}"
    reasons = (*said.reasons, Reason("newer_disagrees", text))
    return replace(longest, judgement=replace(said, reliability="not_reliable", reasons=reasons))


def _judged(recording: Recording, config: AuditConfig, model: ShapeModel | None) -> Judged:
    prepared = prepare(recording, config.fitness, model)
    fitness, oscillation = prepared.fitness, prepared.oscillation
    if fitness.standstill is not None:
        fitness = refused_as_standing(fitness)
        return Judged(fitness, None, _refusal(recording, fitness))
    stem = _stuck_stem(recording, prepared)
    if stem is not None:
        return Judged(fitness, None, _beside_refusals(stuck(stem), fitness))
    if oscillation is None or not fitness.auditable:
        return Judged(fitness, oscillation, _refusal(recording, fitness))
    by_itself = judging.judge(fitness.audited, oscillation, fitness, config.judgement, recording.integrating, model)
    by_itself = replace(by_itself, unanswered_since_s=_dead_since_s(recording, fitness, by_itself))
    if prepared.rest_of is not None:
        by_itself = replace(by_itself, reasons=(*by_itself.reasons, _rest_reason(fitness, prepared.rest_of)))
    quicker = _quicker(oscillation, fitness, config.episodes)
    episodes = find(fitness.looked_at, quicker, config.episodes, model)
    return Judged(fitness, oscillation, _with_episodes(by_itself, episodes), by_itself, episodes)


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
        hidden_band_op=None,
    )


def _began_first(reasons: tuple[Reason, ...]) -> tuple[Reason, ...]:
    """When it began is what nobody should have to look for below why the record of before says otherwise."""
    return tuple(sorted(reasons, key=lambda reason: reason.code != BEGAN))


def _rest_reason(fitness: Fitness, rest_of: UniformRecord) -> Reason:
    share = fitness.audited.samples / rest_of.samples
    text = (
        f"the set point moves PV more than anything else; judged where it is constant, on {100 * share:.0f} % of the "
        "record, because the loop cycles there by itself; the rest is not judged"
    )
    return Reason("set_point_rests", text)


def _dead_since_s(recording: Recording, fitness: Fitness, judgement: Judgement) -> float | None:
    """Since when PV stands, where that is what is said of a recording whose shapes were judged all the same."""
    if judgement.likely_cause != UNANSWERED or fitness.pv_dead_s is None:
        return None
    return float(recording.time_s[-1] - recording.time_s[0]) - fitness.pv_dead_s


def _stuck_stem(recording: Recording, prepared: Preparation) -> StuckStem | None:
    """Of the whole of what could be audited, where that goes up to the recording's end: what was before and what is."""
    record = prepared.rest_of or prepared.fitness.whole
    return stuck_stem(record) if record is not None and ends_with(record, recording) else None


def ends_with(record: UniformRecord, recording: Recording) -> bool:
    """Whether a stretch goes up to the end of the recording that it is of."""
    return record.end_s >= float(recording.time_s[-1] - recording.time_s[0])


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
