"""What keeps a verdict from being relied on: unclear evidence, unrelated signals, data, time, other loops."""

from dataclasses import dataclass

import numpy as np

from app.engine.causality.answering import goes_its_own_way
from app.engine.causality.coupling import strangers_chance, strangers_chance_finely
from app.engine.causality.hidden_band import HiddenBand
from app.engine.causality.outside_corners import LEAST_RATIO, OutsideCorners
from app.engine.causality.own_cycle import OwnCycle
from app.engine.codes import UNANSWERED, Cause, CheckCode
from app.engine.evidence import Finding, Measured, Operator, Reason, in_digits, reason_of
from app.engine.fitness import Fitness
from app.engine.judgement import (
    FOREIGN_CYCLE,
    HIDDEN_BAND,
    LINEAR_LOOK_ALIKES,
    NO_ANSWER,
    OUTSIDE_CORNERS,
    PV_STANDS,
    UNCOUPLED,
    WOUND_UP,
    Verdict,
)
from app.engine.oscillation import Oscillation
from app.engine.recording import UniformRecord
from app.engine.rivals import SATURATED, Rival
from app.engine.signals.sampled import correlation
from app.engine.verdict.config import VerdictConfig
from app.engine.verdict.look_alikes import MOST_CHANCE, LookAlikes
from app.engine.verdict.reasons import of_rival
from app.engine.verdict.timekeeping import timekeeping
from app.engine.verdict.weighing import Weighing

# Findings that leave a verdict possible and take its reliability away. Not op_interpolated: against a standing PV an
# integrating controller runs on straight lines by itself.
_DOUBTFUL_DATA: frozenset[CheckCode] = frozenset({"pv_quantised", "pv_interpolated", "stored_points"})

# For most of the stretch one of them held one value, as behind a valve that is stuck: the rest of it says little.
_DEAD: frozenset[CheckCode] = frozenset({"op_flat", "pv_flat"})


def band_reason(band: HiddenBand | None) -> tuple[Reason, ...]:
    if band is None:
        return ()
    text = (
        f"PV moves as if the valve followed only after OP had reversed by about {band.S:.2g} units: it may stick, or "
        "have backlash, by that much, whatever the shapes say"
    )
    return (Reason(HIDDEN_BAND, text, Measured(band.nats, "<=", band.needed)),)


def foreign_cycle(own: OwnCycle) -> tuple[Reason, ...]:
    if not own.missed:
        return ()
    text = (
        f"in {own.cycles:.0f} cycles PV does not move as it would if the valve caused them and stuck for much of OP's "
        "travel in each: an oscillation from elsewhere makes such shapes too, and lets PV stand still"
    )
    return (Reason(FOREIGN_CYCLE, text),)


def corners_reason(corners: OutsideCorners | None) -> tuple[Reason, ...]:
    if corners is None or not corners.shown:
        return ()
    text = (
        "PV reverses as its own past predicts, and the stem of a valve that OP moves predicts it "
        f"{corners.stem_over_turns:.2g} times as well; the times between the reversals of OP vary "
        f"{corners.time_over_travel:.2g} times as much as its travel between them: a sticking valve breaks free after "
        "so much travel of OP, an oscillation from elsewhere follows its own timing"
    )
    return (Reason(OUTSIDE_CORNERS, text, Measured(corners.ratio, ">=", LEAST_RATIO)),)


def doubts(
    weighing: Weighing, verdict: Verdict, oscillation: Oscillation, fitness: Fitness, config: VerdictConfig
) -> tuple[Reason, ...]:
    """Reasons from the record and its time not to rely on the verdict; empty if there are none."""
    doubts = []
    if oscillation.cycles < config.min_cycles:
        text = f"the judged data hold {oscillation.cycles:.1f} cycles; a reliable verdict needs {config.min_cycles:g}"
        doubts.append(Reason("few_cycles", text, Measured(oscillation.cycles, ">=", config.min_cycles)))
    samples = fitness.looked_at.samples
    if samples < config.min_samples:
        text = f"the judged data hold {samples:,} samples; a reliable verdict needs {config.min_samples}"
        doubts.append(Reason("few_samples", text, Measured(samples, ">=", config.min_samples)))
    if verdict == "no_stiction":
        doubts.extend(_no_answer(fitness))
    if verdict == "stiction":
        doubts.extend(_shaped_outside(weighing, config))
        doubts.extend(_keeps_time(fitness.audited, oscillation, config))
        doubts.extend(of_rival(rival) for rival in weighing.rivals if rival.stands_out and rival.counts)
    return tuple(doubts)


def parts_disagree(weighing: Weighing, fitness: Fitness, config: VerdictConfig) -> tuple[Reason, ...]:
    """The reason if the parts of a record disagree: the stretches of a long record, the windows of others."""
    whole = fitness.speaks_for
    if whole is not None:
        text = f"only {whole.agreeing} of the {whole.judged} judged stretches agree with the verdict"
        text += "" if whole.newest_agree else ", and the newest two do not"
        return (Reason("stretches_disagree", text),) if whole.contested else ()
    spread = Measured(weighing.window_spread, "<=", config.max_window_spread * abs(weighing.log_odds_by_shapes))
    if spread.passed:
        return ()
    return (Reason("windows_disagree", "parts of the record disagree about the valve", spread),)


def unclear(weighing: Weighing, config: VerdictConfig) -> tuple[Reason, ...]:
    """Why the probability is not clear enough. A rival that stands out makes stiction the less likely cause, but it
    does not clear a valve whose shapes do not.
    """
    probability, shapes = weighing.probability, weighing.probability_by_shapes
    if probability <= config.reliable_no_stiction_to:
        if shapes <= config.reliable_no_stiction_to:
            return ()
        text = (
            f"another cause explains the record, but the shapes alone do not clear the valve: probability {shapes:.2f}"
        )
        return (Reason("not_cleared", text, Measured(shapes, "<=", config.reliable_no_stiction_to)),)
    if probability >= config.reliable_stiction_from:
        return ()
    text = f"the evidence is not clear enough: probability of stiction {probability:.2f}"
    needed: Operator = ">=" if probability > 0.5 else "<="
    limit = config.reliable_stiction_from if probability > 0.5 else config.reliable_no_stiction_to
    return (Reason("evidence_not_clear", text, Measured(probability, needed, limit)),)


def alike_reason(found: LookAlikes | None) -> tuple[Reason, ...]:
    """The reason if a linear loop would look as sticky. found: None if this was not tested."""
    if found is None or found.shown:
        return ()
    text = (
        "under a wandering load, a loop whose valve does not stick would look as sticky by chance: of records with the "
        f"same spectra as PV and OP, {100 * found.chance:.2g} % do"
    )
    return (Reason(LINEAR_LOOK_ALIKES, text, Measured(found.chance, "<=", MOST_CHANCE)),)


def unrelated_signals(fitness: Fitness, oscillation: Oscillation, config: VerdictConfig) -> tuple[Reason, ...]:
    """The reason if PV and OP are one signal, or may be unrelated (a tag of another loop): then nothing is shown of a
    valve. Little is shown if only their fast movements agree.
    """
    record = fitness.audited
    if 1.0 - correlation(record.pv, record.op) ** 2 < config.min_difference:
        text = "PV is OP on another scale: a proportional-only controller, one tag for both, or no process between them"
        return (Reason("same_signal", text),)
    chance = strangers_chance(fitness.looked_at, oscillation)
    if chance is None or chance < config.max_strangers_chance:
        return ()
    if strangers_chance_finely(fitness.looked_at, oscillation) < config.max_strangers_chance:
        text = "PV and OP are related in their fast movements only, not over part of a cycle"
        return (Reason("uncoupled_slowly", text),)
    text = (
        "PV and OP are unrelated: tags of two loops, no closed loop, or a historian that stored each only now and then"
    )
    return (Reason(UNCOUPLED, text),)


@dataclass(frozen=True)
class Lost:
    """The loop is no longer controlled at the end of the record: what the valve did before does not clear it."""

    reason: Reason
    cause: Cause


def lost_of(fitness: Fitness) -> Lost | None:
    if fitness.pv_dead_s is not None:
        hours = in_digits(fitness.pv_dead_s / 3600.0, 2)
        text = (
            f"PV has held one value for the last {hours} h while OP moved, and never for so "
            "long before: unless the unit is shut down, the transmitter is dead or the valve is stuck; check both"
        )
        return Lost(Reason(PV_STANDS, text), UNANSWERED)
    if fitness.wound_up_s is not None:
        hours = in_digits(fitness.wound_up_s / 3600.0, 2)
        text = (
            f"OP has been at its limit for most of the last {hours} h, which never happened before, and "
            "PV does not come back: the valve may be stuck by now, or too small for the load"
        )
        return Lost(Reason(WOUND_UP, text), SATURATED)
    return None


def _no_answer(fitness: Fitness) -> list[Reason]:
    """Where PV is carried away and is not seen to answer OP, the valve may stand fast, and its loop not cycle."""
    record = fitness.looked_at
    if not goes_its_own_way(record):
        return []
    text = (
        f"PV drifts on its own and shows no answer to OP, which covered {np.ptp(record.op):.3g} units: a valve that is "
        "stuck fast, or moves only now and then, looks the same"
    )
    return [Reason(NO_ANSWER, text)]


def _shaped_outside(weighing: Weighing, config: VerdictConfig) -> list[Reason]:
    """Where PV and OP are all but the set point's movement, or one sine, the shape need not be the valve's."""
    doubts = []
    for rival in weighing.rivals:
        if rival.cause == "set_point_following":
            doubts.extend(_follows(rival, config))
        wave = Measured(rival.explained or 0.0, "<", config.max_wave)
        if rival.cause == "external_oscillation" and not wave.passed:
            text = f"a sine of constant phase explains {100 * wave.statistic:.0f} % of PV and OP on unseen cycles"
            doubts.append(Reason("nearly_sinusoidal", text, wave))
    return doubts


def _follows(rival: Rival, config: VerdictConfig) -> list[Reason]:
    """PV alone is enough where it is all the set point's: on a level OP is the slope of SP, no response to it."""
    both = Measured(rival.strength, "<", config.max_following)
    if not both.passed:
        return [Reason("set_point_moves", rival.text, both)]
    alone = Measured(rival.explained or 0.0, "<", config.max_followed)
    if alone.passed:
        return []
    text = f"the set point explains PV ({100 * alone.statistic:.0f} % of its variance on unseen cycles)"
    return [Reason("set_point_moves", text, alone)]


def _keeps_time(record: UniformRecord, oscillation: Oscillation, config: VerdictConfig) -> list[Reason]:
    """A swing that comes back to its time is driven from outside, whatever its shape."""
    found = timekeeping(record, oscillation, config.min_jitter)
    if found is None:
        return []
    jitter = Measured(found.jitter, ">=", min(config.min_jitter, config.min_jitter_of_unlike * found.unlike))
    if jitter.passed:
        return []
    text = (
        f"{oscillation.cycles:.0f} cycles keep time to {100 * found.jitter:.2g} % of a cycle, though their shapes "
        f"differ by {100 * found.unlike:.0f} % of the swing, as if driven by a timer or a machine; a sticking valve "
        "breaks free earlier or later each time"
    )
    return [Reason("keeps_time", text, jitter)]


def data_doubts(weighing: Weighing, fitness: Fitness, config: VerdictConfig) -> list[Reason]:
    # Where the loop cycles on the resolution of its sensor, coarse values are the explanation and not a doubt.
    cycles_on_it = any(r.cause == "quantised_sensor" and r.stands_out for r in weighing.rivals)
    codes = _DOUBTFUL_DATA - {"pv_quantised"} if cycles_on_it else _DOUBTFUL_DATA
    doubts = [reason_of(f) for f in fitness.findings if f.outcome == "fail" and f.code in codes]
    doubts += [reason_of(f) for f in fitness.findings if f.code in _DEAD and _beyond(f)]
    if fitness.filled_share is not None and fitness.filled_share > config.max_filled_share:
        text = f"{100 * fitness.filled_share:.0f} % of the samples were filled by interpolation"
        doubts.append(Reason("filled_share", text, Measured(fitness.filled_share, "<=", config.max_filled_share)))
    if fitness.automatic_share is not None and fitness.automatic_share < config.min_automatic_share:
        text = f"the loop was in automatic for only {100 * fitness.automatic_share:.0f} % of the recording"
        measured = Measured(fitness.automatic_share, ">=", config.min_automatic_share)
        doubts.append(Reason("mode_share", text, measured))
    return doubts


def _beyond(finding: Finding) -> bool:
    """Whether a check's statistic is beyond its threshold, also where enough was left to go on with."""
    value, threshold = finding.statistic, finding.threshold
    return value is not None and threshold is not None and value >= threshold
