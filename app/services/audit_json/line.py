"""The one place where an Audit becomes JSON: the audit line and its flat twin for tables."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from app.engine.audit import Audit
from app.engine.evidence import Reason
from app.engine.fitness.signals import set_point_activity
from app.engine.long_records.episodes import Episode
from app.engine.reference.reliability import Rung
from app.engine.rivals import Rival, runner_up, winner
from app.services.audit_json.models import (
    AuditFields,
    AuditLine,
    EpisodeLine,
    HammersteinLine,
    HealthPartLine,
    ReasonLine,
    ReliabilityRow,
    RivalLine,
)
from app.services.audit_json.numbers import or_none
from app.services.audit_json.size import flat_size, stiction_size_line
from app.services.telling.reasons import BETWEEN

# The order of the contract first, then what was added to it; a field that is not named here comes last.
LINE_ORDER = (
    "recording", "loop", "samples", "sampling_interval_s", "verdict", "stiction_probability", "reliability", "reasons",
    "yper_pct", "yper_raw_pct", "table2_reading", "hammerstein", "stiction_band_pct_of_op_range", "likely_cause",
    "engine_version", "elapsed_s", "oscillation_period_s", "oscillation_regularity", "window_start_s", "window_end_s",
    "filled_share", "rival_winner", "rival_runner_up", "rivals", "episodes", "input_fingerprint", "config_fingerprint",
)  # fmt: skip
KNOWN_TO_A_SERVICE = (
    *("unit", "audit_id"),
    *("window_start", "window_end", "audited_at", "window_start_ms", "window_end_ms", "audited_at_ms"),
    *("input_start", "input_end"),
)
"""What a row has of its loop and its run, beside what its line tells."""
NOT_OF_FILES = (*KNOWN_TO_A_SERVICE, "of_old_record")
"""What nothing is known of where files are audited without a service."""


def audit_line(audit: Audit, elapsed_s: float, loop: str | None = None) -> dict[str, Any]:
    """The line of `audit --format jsonl`, JSON-safe, None where unknown. `loop`: the recording's name by default."""
    reference, judgement, window = audit.reference, audit.judgement, audit.window
    oscillation = audit.oscillation
    line = AuditLine(
        recording=audit.recording,
        loop=loop or audit.recording,
        samples=audit.samples,
        sampling_interval_s=or_none(audit.sampling_interval_s),
        verdict=judgement.verdict,
        stiction_probability=or_none(judgement.stiction_probability),
        reliability=judgement.reliability,
        reasons=[reason_line(reason) for reason in judgement.reasons],
        yper_pct=None if reference is None else or_none(reference.yper.yper_pct),
        yper_raw_pct=None if reference is None else or_none(reference.yper_raw.yper_pct),
        table2_reading=None if reference is None else reference.reading,
        hammerstein=_hammerstein(audit),
        stiction_size=stiction_size_line(audit),
        stiction_band_pct_of_op_range=or_none(audit.stiction_band_pct_of_op_range),
        likely_cause=judgement.likely_cause,
        engine_version=audit.engine_version,
        elapsed_s=round(elapsed_s, 6),
        oscillation_period_s=None if oscillation is None else or_none(oscillation.period_s),
        oscillation_regularity=None if oscillation is None else or_none(oscillation.regularity),
        oscillation_strength=None if oscillation is None else or_none(oscillation.strength),
        health=audit.health.value,
        health_not_evaluated=audit.health.not_evaluated,
        health_parts=[HealthPartLine(**vars(part)) for part in audit.health.parts],
        window_start_s=None if window is None else window.start_s,
        window_end_s=None if window is None else window.end_s,
        window_samples=None if window is None else window.samples,
        filled_share=audit.fitness.filled_share,
        rival_winner=_code(winner(judgement.rivals)),
        rival_runner_up=_code(runner_up(judgement.rivals)),
        rivals=[rival_line(rival) for rival in judgement.rivals],
        episodes=[episode_line(episode) for episode in audit.episodes.found],
        unanswered_since_s=or_none(judgement.unanswered_since_s),
        hidden_band_op=or_none(judgement.hidden_band_op),
        **_fitness_shares(audit),
        input_fingerprint=audit.input_fingerprint,
        config_fingerprint=audit.config_fingerprint,
    ).model_dump(mode="json")
    return {name: line[name] for name in (*LINE_ORDER, *line)}  # a name that is there already keeps its place


def reliability_row(line: dict[str, Any]) -> dict[str, Any]:
    """The flat twin of an audit line, every value a number, a string or None. What only a service
    knows is None, until `rows.as_row` fills it."""
    flat = {name: line[name] for name in AuditFields.model_fields}
    hammerstein = {f"hammerstein_{name}": value for name, value in line["hammerstein"].items()}
    space = line["hammerstein"]["search_space"]
    hammerstein["hammerstein_search_space"] = None if space is None else "x".join(map(str, space))
    reasons, episodes = line["reasons"], line["episodes"]
    newest = episodes[-1] if episodes else dict.fromkeys(EpisodeLine.model_fields)
    return ReliabilityRow(
        **flat,
        **hammerstein,
        **flat_size(line["stiction_size"]),
        **dict.fromkeys(KNOWN_TO_A_SERVICE),
        episodes=len(episodes),
        episode_start=newest["start"],
        episode_end=newest["end"],
        episode_probability=newest["probability"],
        **flat_reasons(reasons),
        health_parts=flat_health(line["health_parts"]),
    ).model_dump(mode="json")


def flat_reasons(reasons: Sequence[Mapping[str, str]]) -> dict[str, str]:
    return {
        "reasons": ";".join(reason["code"] for reason in reasons),
        "reasons_text": BETWEEN.join(reason["text"] for reason in reasons),
    }


def flat_health(parts: Iterable[Mapping[str, Any]]) -> str:
    return ";".join(f"{part['code']} {part['lost']:.1f}" for part in parts if part["lost"] > 0.0)


def _hammerstein(audit: Audit) -> HammersteinLine:
    if audit.reference is None:
        return HammersteinLine.model_validate(dict.fromkeys(HammersteinLine.model_fields))
    rung = audit.reference.last
    one, two = rung.one, rung.two
    return HammersteinLine(
        d=or_none(one.d_best),
        S=None if two is None else or_none(two.S_best),
        J=None if two is None else or_none(two.J_best),
        na=int(one.na[one.best]),
        nb=int(one.nb[one.best]),
        nc=int(one.nc[one.best]),
        rmse=or_none(one.rmse_best),
        rmse_without_stiction=or_none(one.rmse_without_stiction),
        search_space=space_of(rung),
        widenings=audit.reference.widenings,
        one_stiction=bool(one.stiction),
        two_stiction=None if two is None else bool(two.stiction),
        two_rmse=None if two is None else or_none(float(two.rmse_best)),
    )


def _code(rival: Rival | None) -> str | None:
    return None if rival is None else rival.cause


def reason_line(reason: Reason) -> ReasonLine:
    found = reason.measured
    if found is None or or_none(found.statistic) is None or or_none(found.threshold) is None:
        return ReasonLine(code=reason.code, text=reason.text)
    measured = {
        "statistic": or_none(found.statistic),
        "operator": found.operator,
        "threshold": or_none(found.threshold),
    }
    return ReasonLine(code=reason.code, text=reason.text, passed=bool(found.passed), **measured)


def rival_line(rival: Rival) -> RivalLine:
    measured = ("statistic", "threshold", "explained", "explained_without_stiction")
    numbers = {name: or_none(getattr(rival, name)) for name in measured}
    told = {"code": rival.cause, "score": rival.strength, "text": rival.text, "applies": rival.applies}
    return RivalLine(**told, operator=rival.operator, **numbers)


def episode_line(episode: Episode) -> EpisodeLine:
    return EpisodeLine(
        start_s=episode.start_s,
        end_s=episode.end_s,
        start=None,
        end=None,
        probability=episode.probability,
        reliability=episode.reliability,
        period_s=episode.period_s,
    )


def _fitness_shares(audit: Audit) -> dict[str, float | None]:
    """How fit the data are, beside the share that was filled: from the findings, by their codes."""
    fitness, oscillation = audit.fitness, audit.oscillation
    measured = {finding.code: or_none(finding.statistic) for finding in fitness.findings}
    record = fitness.record
    return {
        "samples_per_cycle": None if oscillation is None else or_none(oscillation.samples_per_cycle),
        "cycles": None if oscillation is None else or_none(oscillation.cycles),
        "missing_share": or_none(fitness.missing_share),
        "automatic_share": or_none(fitness.automatic_share),
        "pv_on_line_share": measured.get("pv_interpolated"),
        "op_on_line_share": measured.get("op_interpolated"),
        "pv_levels": measured.get("pv_quantised"),
        "op_levels": measured.get("op_quantised"),
        "set_point_activity": None if record is None else or_none(set_point_activity(record.sp, record.pv)),
    }


def space_of(rung: Rung) -> tuple[int, int, int]:
    return (rung.space.na_max, rung.space.nb_max, rung.space.nc_max)
