"""The one place where an Audit becomes JSON: the audit line, its flat twin for tables, the arrays for storage."""

from collections.abc import Iterable
from datetime import datetime
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from app.engine.audit import Audit
from app.engine.episodes import Episode
from app.engine.fitness.signals import set_point_activity
from app.engine.hammerstein import OneParameterResult, TwoParameterResult
from app.engine.reliability import Rung
from app.engine.rivals import Rival, runner_up, winner
from app.engine.yper import YperResult
from app.services.auditing.size_line import (
    FlatSize,
    StictionSizeLine,
    flat_size,
    stiction_size_detail,
    stiction_size_line,
)
from app.services.moments import epoch_ms, iso_utc

VerdictName = Literal["stiction", "no_stiction", "inconclusive", "not_auditable"]
ReliabilityName = Literal["reliable", "not_reliable"]
ReadingName = Literal["high_stiction", "high_no_stiction", "low_stiction", "low_no_stiction"]

STORED_DIGITS = 5
LARGEST_EXPONENT = 16  # beyond it powers of ten are no longer exact
STORED_FREQUENCIES = 256


class ReasonLine(BaseModel):
    """Why a verdict or its reliability is what it is."""

    code: str = Field(description="Stable code of the reason.")
    text: str = Field(description="The reason as a sentence for an engineer.")


class HammersteinLine(BaseModel):
    """The Hammerstein identification of the last rung of the ladder; null where nothing was identified."""

    d: float | None = Field(description="Stiction band of the one-parameter model, in units of OP; 0: none.")
    S: float | None = Field(description="Deadband plus stickband of the two-parameter model, in units of OP.")
    J: float | None = Field(description="Slip jump of the two-parameter valve model, in units of OP.")
    na: int | None = Field(description="Order of A in A(q) y = B(q) v + C(q) e.")
    nb: int | None = Field(description="Order of B.")
    nc: int | None = Field(description="Order of C.")
    rmse: float | None = Field(description="Root mean square of the one-step prediction error, in units of PV.")
    rmse_without_stiction: float | None = Field(description="The same with a valve that follows OP (d = 0).")
    search_space: tuple[int, int, int] | None = Field(description="Greatest na, nb and nc that were searched.")
    widenings: int | None = Field(description="How many times the search space was widened.")
    one_stiction: bool | None = Field(None, description="What the one-parameter model answers: d > 0.")
    two_stiction: bool | None = Field(None, description="What the two-parameter model answers; null: not run.")
    two_rmse: float | None = Field(None, description="RMSE of the two-parameter model, in units of PV; null: not run.")


class RivalLine(BaseModel):
    """One explanation of the loop's movement: stiction, or a rival of it."""

    code: str = Field(description="Stable code of the explanation.")
    score: float = Field(description="0 to 1; from 0.5 on it stands out. Of stiction: its probability.", ge=0, le=1)
    text: str = Field(description="What was seen, or why it was not evaluated.")
    applies: bool = Field(description="Whether its assumptions hold for this record.")
    statistic: float | None = Field(description="What was measured; null where it was not evaluated.")
    threshold: float | None = Field(description="From where on the statistic speaks for it.")
    explained: float | None = Field(
        description="Share of PV's variance explained in free run on cycles not fitted; null: nothing fitted."
    )


class EpisodeLine(BaseModel):
    """A stretch of a long record in which the valve sticks, while it does not in the rest."""

    start_s: float = Field(description="Start, in seconds from the first sample.")
    end_s: float = Field(description="End, in seconds from the first sample.")
    start: str | None = Field(None, description="Start, ISO 8601, UTC; null where the recording has no calendar time.")
    end: str | None = Field(None, description="End, ISO 8601, UTC.")
    probability: float = Field(description="Probability of stiction in it: the median of its windows.")
    reliability: ReliabilityName = Field(description="Whether it can be relied on.")
    period_s: float = Field(description="Period of the oscillation in it, in seconds.")


class AuditFields(BaseModel):
    """What the audit line and a row of the reliability table have in common."""

    model_config = ConfigDict(frozen=True)

    recording: str = Field(description="Name of the recording: its file name without suffix, or the loop's tag.")
    loop: str = Field(description="Tag of the control loop.")
    samples: int = Field(description="Samples of the recording.")
    sampling_interval_s: float | None = Field(description="Sampling interval in seconds; null below two samples.")
    verdict: VerdictName = Field(description="What is said about the valve.")
    stiction_probability: float | None = Field(
        description="Probability that the valve sticks, 0 to 1; null only with not_auditable.", ge=0, le=1
    )
    reliability: ReliabilityName = Field(description="Whether the verdict can be relied on.")
    yper_pct: float | None = Field(
        description="Yper in per cent, with PV and OP at unit standard deviation: free of their units."
    )
    yper_raw_pct: float | None = Field(description="Yper in per cent as published, which depends on the units.")
    table2_reading: ReadingName | None = Field(description="Yper (high or low) and identification, read by table 2.")
    stiction_band_pct_of_op_range: float | None = Field(
        description="Stiction band d in per cent of the range that OP covers in the audited window."
    )
    likely_cause: str | None = Field(
        description="Code of what probably drives the loop or spoils the record; null where nothing is known."
    )
    engine_version: str = Field(description="Version of the engine that made the audit.")
    elapsed_s: float = Field(description="Time that the audit took, in seconds.")
    oscillation_period_s: float | None = Field(description="Period of the loop's oscillation in seconds; null: none.")
    oscillation_regularity: float | None = Field(description="Regularity of the oscillation; above 1 it is regular.")
    oscillation_strength: float | None = Field(
        None, description="Strength of the oscillation: how far it repeats itself after a period, 0 to 1."
    )
    health: float | None = Field(
        None, description="Health of the loop, 0 to 100; what each part takes off is in health_parts."
    )
    filled_share: float | None = Field(description="Share of the audited samples that were interpolated, 0 to 1.")
    rival_winner: str | None = Field(
        None, description="The explanation that wins, stiction among them; null where none stands out."
    )
    rival_runner_up: str | None = Field(None, description="The explanation behind the winner; null: nothing near it.")
    samples_per_cycle: float | None = Field(None, description="Samples in one period of the oscillation.")
    cycles: float | None = Field(None, description="Periods of the oscillation in the audited stretch.")
    missing_share: float | None = Field(None, description="Share of samples without PV or OP, 0 to 1.")
    automatic_share: float | None = Field(
        None, description="Share of samples in automatic, 0 to 1; null: not recorded."
    )
    pv_on_line_share: float | None = Field(
        None, description="Share of PV samples on the line between their neighbours: the historian's interpolation."
    )
    op_on_line_share: float | None = Field(None, description="The same of OP.")
    pv_levels: float | None = Field(None, description="Range of PV in its least steps: its quantisation.")
    op_levels: float | None = Field(None, description="Range of OP in its least steps.")
    set_point_activity: float | None = Field(
        None, description="Standard deviation of SP over that of PV; 0: it stands, null: not recorded."
    )
    input_fingerprint: str = Field(description="SHA-256 of the recording's samples.")
    config_fingerprint: str = Field(description="SHA-256 of the configuration of the audit.")


class HealthPartLine(BaseModel):
    """What one aspect takes off the health of a loop."""

    code: str = Field(description="stiction, oscillation, service, saturation, tracking or data.")
    weight: float = Field(description="What it can take off at most; the weights are 100 together.")
    lost: float = Field(description="What it takes off.")
    text: str = Field(description="What was seen.")


class AuditLine(AuditFields):
    """One audited recording: a line of `audit --format jsonl`."""

    health_parts: list[HealthPartLine] = Field(description="What the health number is made of.")
    reasons: list[ReasonLine] = Field(description="Why, the weightiest first.")
    hammerstein: HammersteinLine = Field(description="The published identification.")
    rivals: list[RivalLine] = Field(default=[], description="Stiction and its rival explanations, the winner first.")
    episodes: list[EpisodeLine] = Field(default=[], description="Spells of stiction in a long record, by time.")
    stiction_size: StictionSizeLine = Field(description="S and J with an interval, beside the published S and J.")
    window_start_s: float | None = Field(description="Start of the audited window, seconds from the first sample.")
    window_end_s: float | None = Field(description="End of the audited window, seconds from the first sample.")


class ReliabilityRow(FlatSize, AuditFields):
    """One loop in the per-loop reliability table: the audit line, flat, with where and when."""

    health_parts: str | None = Field(
        None, description="What takes how much off the health: `stiction 38.0;oscillation 12.1`."
    )
    unit: str | None = Field(description="Plant unit that the loop belongs to.")
    window_start: str | None = Field(description="First audited sample, ISO 8601, UTC.")
    window_end: str | None = Field(description="Last audited sample, ISO 8601, UTC.")
    audited_at: str | None = Field(description="When the audit was made, ISO 8601, UTC.")
    window_start_ms: int | None = Field(None, description="window_start in milliseconds since 1970, UTC.")
    window_end_ms: int | None = Field(None, description="window_end in milliseconds since 1970, UTC.")
    audited_at_ms: int | None = Field(None, description="audited_at in milliseconds since 1970, UTC.")
    audit_id: str | None = Field(description="The audit run that this row comes from.")
    reasons: str = Field(description="Codes of the reasons, separated by semicolons.")
    reasons_text: str = Field(description="The reasons as sentences.")
    hammerstein_d: float | None = Field(description="Stiction band d in units of OP; 0: none.")
    hammerstein_S: float | None = Field(description="Deadband plus stickband S in units of OP.")
    hammerstein_J: float | None = Field(description="Slip jump J in units of OP.")
    hammerstein_na: int | None = Field(description="Order of A.")
    hammerstein_nb: int | None = Field(description="Order of B.")
    hammerstein_nc: int | None = Field(description="Order of C.")
    hammerstein_rmse: float | None = Field(description="RMSE of the one-step prediction, in units of PV.")
    hammerstein_rmse_without_stiction: float | None = Field(description="The same with d = 0, in units of PV.")
    hammerstein_search_space: str | None = Field(description="Greatest na, nb and nc that were searched: 5x5x10.")
    hammerstein_widenings: int | None = Field(description="How many times the search space was widened.")
    hammerstein_one_stiction: bool | None = Field(None, description="Answer of the one-parameter model: d > 0.")
    hammerstein_two_stiction: bool | None = Field(None, description="Answer of the two-parameter model; null: not run.")
    hammerstein_two_rmse: float | None = Field(None, description="RMSE of the two-parameter model; null: not run.")
    episodes: int = Field(0, description="Spells of stiction in a long record.")
    episode_start: str | None = Field(None, description="Start of the newest spell, ISO 8601, UTC.")
    episode_end: str | None = Field(None, description="End of the newest spell, ISO 8601, UTC.")
    episode_probability: float | None = Field(None, description="Probability of stiction in the newest spell.")


class KeyFiguresLine(BaseModel):
    """What engineers expect of a loop monitor, over good samples only; null where a figure cannot be had."""

    good_share_pct: float | None = Field(None, description="Samples with PV and OP, per cent of all samples.")
    service_factor_pct: float | None = Field(None, description="Good samples in automatic, per cent; null: no mode.")
    op_saturation_pct: float | None = Field(
        None, description="Samples in automatic with OP at an end of its span, per cent; null: no span."
    )
    error_mean: float | None = Field(None, description="Mean of SP - PV, in the unit of PV.")
    error_std: float | None = Field(None, description="Standard deviation of SP - PV, in the unit of PV.")
    error_abs_mean: float | None = Field(None, description="Mean of abs(SP - PV), in the unit of PV.")
    error_abs_p95: float | None = Field(None, description="95th percentile of abs(SP - PV), in the unit of PV.")
    error_p05: float | None = Field(None, description="5th percentile of SP - PV, in the unit of PV.")
    error_median: float | None = Field(None, description="Median of SP - PV, in the unit of PV.")
    error_p95: float | None = Field(None, description="95th percentile of SP - PV, in the unit of PV.")
    error_abs_mean_pct_of_span: float | None = Field(
        None, description="Mean of abs(SP - PV), per cent of PV's span; null: no span."
    )
    variability_pct: float | None = Field(None, description="2 std(PV) over abs(mean(PV)), per cent.")
    pv_std: float | None = Field(None, description="Standard deviation of PV, in its unit.")
    op_std: float | None = Field(None, description="Standard deviation of OP, in its unit.")
    op_travel_per_h: float | None = Field(None, description="Travel of OP an hour, in the unit of OP.")
    op_reversals_per_h: float | None = Field(None, description="Changes of OP's direction an hour.")
    op_travel_pct_of_span_per_h: float | None = Field(
        None, description="Travel of OP an hour, per cent of its span; null: no span."
    )
    response_time_s: float | None = Field(
        None, description="Lag at which the autocorrelation of the control error falls below 1/e, in seconds."
    )
    harris_index: float | None = Field(
        None, description="Minimum over present variance of the control error, 0 (poor) to 1; no measure between loops."
    )
    harris_horizon_samples: int | None = Field(None, description="Dead time that the Harris index assumes, in samples.")


# The order of the contract first, then what was added to it; a field that is not named here comes last.
LINE_ORDER = (
    "recording", "loop", "samples", "sampling_interval_s", "verdict", "stiction_probability", "reliability", "reasons",
    "yper_pct", "yper_raw_pct", "table2_reading", "hammerstein", "stiction_band_pct_of_op_range", "likely_cause",
    "engine_version", "elapsed_s", "oscillation_period_s", "oscillation_regularity", "window_start_s", "window_end_s",
    "filled_share", "rival_winner", "rival_runner_up", "rivals", "episodes", "input_fingerprint", "config_fingerprint",
)  # fmt: skip


def audit_line(audit: Audit, elapsed_s: float, loop: str | None = None) -> dict[str, Any]:
    """The line of `audit --format jsonl`, JSON-safe, None where unknown. `loop`: the recording's name by default."""
    reference, judgement, window = audit.reference, audit.judgement, audit.window
    oscillation = audit.oscillation
    line = AuditLine(
        recording=audit.recording,
        loop=loop or audit.recording,
        samples=audit.samples,
        sampling_interval_s=_number(audit.sampling_interval_s),
        verdict=judgement.verdict,
        stiction_probability=_number(judgement.stiction_probability),
        reliability=judgement.reliability,
        reasons=[ReasonLine(code=reason.code, text=reason.text) for reason in judgement.reasons],
        yper_pct=None if reference is None else _number(reference.yper.yper_pct),
        yper_raw_pct=None if reference is None else _number(reference.yper_raw.yper_pct),
        table2_reading=None if reference is None else reference.reading,
        hammerstein=_hammerstein(audit),
        stiction_size=stiction_size_line(audit),
        stiction_band_pct_of_op_range=_number(audit.stiction_band_pct_of_op_range),
        likely_cause=judgement.likely_cause,
        engine_version=audit.engine_version,
        elapsed_s=round(elapsed_s, 6),
        oscillation_period_s=None if oscillation is None else _number(oscillation.period_s),
        oscillation_regularity=None if oscillation is None else _number(oscillation.regularity),
        oscillation_strength=None if oscillation is None else _number(oscillation.strength),
        health=audit.health.value,
        health_parts=[HealthPartLine(**vars(part)) for part in audit.health.parts],
        window_start_s=None if window is None else window.start_s,
        window_end_s=None if window is None else window.end_s,
        filled_share=audit.fitness.filled_share,
        rival_winner=_code(winner(judgement.rivals)),
        rival_runner_up=_code(runner_up(judgement.rivals)),
        rivals=[_rival(rival) for rival in judgement.rivals],
        episodes=[_episode(episode) for episode in audit.episodes.found],
        **_fitness_shares(audit),
        input_fingerprint=audit.input_fingerprint,
        config_fingerprint=audit.config_fingerprint,
    ).model_dump(mode="json")
    return {name: line[name] for name in (*LINE_ORDER, *line)}  # a name that is there already keeps its place


def reliability_row(
    line: dict[str, Any],
    *,
    unit: str | None = None,
    window_start: datetime | None = None,
    window_end: datetime | None = None,
    audited_at: datetime | None = None,
    audit_id: str | None = None,
) -> dict[str, Any]:
    """The flat twin of an audit line, every value a number, a string or None. The times must know their zone."""
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
        unit=unit,
        window_start=iso_utc(window_start),
        window_end=iso_utc(window_end),
        audited_at=iso_utc(audited_at),
        window_start_ms=epoch_ms(window_start),
        window_end_ms=epoch_ms(window_end),
        audited_at_ms=epoch_ms(audited_at),
        audit_id=audit_id,
        episodes=len(episodes),
        episode_start=newest["start"],
        episode_end=newest["end"],
        episode_probability=newest["probability"],
        health_parts=";".join(f"{p['code']} {p['lost']:.1f}" for p in line["health_parts"] if p["lost"] > 0.0),
        reasons=";".join(reason["code"] for reason in reasons),
        reasons_text=". ".join(reason["text"] for reason in reasons),
    ).model_dump(mode="json")


def detail(audit: Audit) -> dict[str, Any]:
    """What the line leaves out, for storage and charts: findings, rungs with their curves and surfaces, spectra.

    Numbers have five significant digits, spectra at most 256 lines (the highest of each group is kept).
    """
    reference = audit.reference
    return {
        "findings": [_finding(finding) for finding in audit.fitness.findings],
        "window": None if audit.window is None else vars(audit.window),
        "key_figures": _scalars(vars(audit.key_figures)),
        "health": [vars(part) for part in audit.health.parts],
        "oscillation": None if audit.oscillation is None else _scalars(vars(audit.oscillation)),
        "rivals": [_rival(rival).model_dump() for rival in audit.judgement.rivals],
        "episodes": [_episode(episode).model_dump() for episode in audit.episodes.found],
        "episode_windows": [_scalars(vars(window)) for window in audit.episodes.windows],
        "rungs": [] if reference is None else [_rung(rung) for rung in reference.rungs],
        "spectra": None if reference is None else _spectra(reference.yper),
        "stiction_size": None if audit.stiction_size is None else stiction_size_detail(audit.stiction_size),
    }


def _hammerstein(audit: Audit) -> HammersteinLine:
    if audit.reference is None:
        return HammersteinLine.model_validate(dict.fromkeys(HammersteinLine.model_fields))
    rung = audit.reference.last
    one, two = rung.one, rung.two
    return HammersteinLine(
        d=_number(one.d_best),
        S=None if two is None else _number(two.S_best),
        J=None if two is None else _number(two.J_best),
        na=int(one.na[one.best]),
        nb=int(one.nb[one.best]),
        nc=int(one.nc[one.best]),
        rmse=_number(one.rmse_best),
        rmse_without_stiction=_number(one.rmse_without_stiction),
        search_space=_space(rung),
        widenings=audit.reference.widenings,
        one_stiction=bool(one.stiction),
        two_stiction=None if two is None else bool(two.stiction),
        two_rmse=None if two is None else _number(float(two.rmse_best)),
    )


def _code(rival: Rival | None) -> str | None:
    return None if rival is None else rival.cause


def _rival(rival: Rival) -> RivalLine:
    numbers = {name: _number(getattr(rival, name)) for name in ("statistic", "threshold", "explained")}
    return RivalLine(code=rival.cause, score=rival.strength, text=rival.text, applies=rival.applies, **numbers)


def _episode(episode: Episode) -> EpisodeLine:
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
    measured = {finding.code: _number(finding.statistic) for finding in fitness.findings}
    record = fitness.record
    return {
        "samples_per_cycle": None if oscillation is None else _number(oscillation.samples_per_cycle),
        "cycles": None if oscillation is None else _number(oscillation.cycles),
        "missing_share": _number(fitness.missing_share),
        "automatic_share": _number(fitness.automatic_share),
        "pv_on_line_share": measured.get("pv_interpolated"),
        "op_on_line_share": measured.get("op_interpolated"),
        "pv_levels": measured.get("pv_quantised"),
        "op_levels": measured.get("op_quantised"),
        "set_point_activity": None if record is None else _number(set_point_activity(record.sp, record.pv)),
    }


def _space(rung: Rung) -> tuple[int, int, int]:
    return (rung.space.na_max, rung.space.nb_max, rung.space.nc_max)


def _finding(finding: Any) -> dict[str, Any]:
    return _scalars(vars(finding))


def _rung(rung: Rung) -> dict[str, Any]:
    return {
        "search_space": list(_space(rung)),
        "stiction": bool(rung.stiction),
        "reading": rung.reading,
        "agrees": bool(rung.agrees),
        "one_parameter": _curve(rung.one),
        "two_parameter": None if rung.two is None else _surface(rung.two),
    }


def _curve(one: OneParameterResult) -> dict[str, Any]:
    return {
        "d": _numbers(one.d),
        "rmse": _numbers(one.rmse),
        "rmse_refined": _numbers(one.rmse_refined),
        "aic": _numbers(one.aic),
        "orders": np.stack([one.na, one.nb, one.nc], axis=1).tolist(),
        "best": int(one.best),
        "stiction": bool(one.stiction),
    }


def _surface(two: TwoParameterResult) -> dict[str, Any]:
    return {
        "S": _numbers(two.S),
        "J": _numbers(two.J),
        "rmse": _numbers(two.rmse),
        "rmse_refined": _numbers(two.rmse_refined),
        "best": int(two.best),
        "stiction": bool(two.stiction),
    }


def _spectra(yper: YperResult) -> dict[str, Any]:
    groups = _groups(len(yper.frequency_hz))
    amplitudes = (yper.pv_amplitude, yper.op_amplitude, yper.threshold_amplitude)
    pv, op, threshold = (_numbers(np.maximum.reduceat(amplitude, groups)) for amplitude in amplitudes)
    return {
        "frequency_hz": _numbers(yper.frequency_hz[groups]),
        "pv_amplitude": pv,
        "op_amplitude": op,
        "threshold_amplitude": threshold,
        "significant": np.logical_or.reduceat(yper.significant, groups).tolist(),
    }


def _groups(count: int) -> np.ndarray:
    """Where each group of neighbouring frequencies starts: at most STORED_FREQUENCIES groups."""
    return np.unique(np.linspace(0, count, min(count, STORED_FREQUENCIES), endpoint=False).astype(int))


def _scalars(values: dict[str, Any]) -> dict[str, Any]:
    return {name: _number(value) if isinstance(value, float) else value for name, value in values.items()}


def _number(value: float | None) -> float | None:
    """A number that JSON can hold, or None."""
    return None if value is None or not np.isfinite(value) else float(value)


def _numbers(values: Iterable[float]) -> list[float | None]:
    """Five significant digits are more than any chart shows, and a third of the bytes."""
    array = np.asarray(values, dtype=np.float64)
    known = np.isfinite(array)
    rounded: list[float | None] = _rounded(np.where(known, array, 0.0)).tolist()
    if not known.all():
        for place in np.flatnonzero(~known):
            rounded[place] = None
    return rounded


def _rounded(array: np.ndarray) -> np.ndarray:
    """(n,) to `STORED_DIGITS` significant digits, all at once: as texts they would take longer than the rest."""
    size = np.abs(array)
    exponent = np.floor(np.log10(size, out=np.zeros_like(size), where=size > 0.0))
    if np.any(np.abs(exponent) > LARGEST_EXPONENT):
        return np.array([float(f"{value:.{STORED_DIGITS - 1}e}") for value in array])
    scale = 10.0 ** np.abs(STORED_DIGITS - 1 - exponent)
    return np.where(exponent < STORED_DIGITS, np.rint(array * scale) / scale, np.rint(array / scale) * scale)
