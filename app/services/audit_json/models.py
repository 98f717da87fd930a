"""An audit as JSON: each field of its line, of its flat twin for tables and of the key figures, with its unit."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from app.services.audit_json.size import FlatSize, StictionSizeLine

VerdictName = Literal["stiction", "no_stiction", "inconclusive", "not_auditable"]
ReliabilityName = Literal["reliable", "not_reliable"]
ReadingName = Literal["high_stiction", "high_no_stiction", "low_stiction", "low_no_stiction"]


class ReasonLine(BaseModel):
    """Why a verdict or its reliability is what it is."""

    code: str = Field(description="Stable code of the reason.")
    text: str = Field(description="The reason as a sentence for an engineer.")
    statistic: float | None = Field(None, description="What was measured; null: no one figure decides.")
    operator: Literal["<", "<=", ">", ">="] | None = Field(
        None, description="How the statistic was held against the threshold."
    )
    threshold: float | None = Field(None, description="What the statistic was held against.")
    passed: bool | None = Field(
        None,
        description="Whether `statistic operator threshold` holds. Of a shape: it speaks for stiction; of another "
        "cause: it stands out; of all else: what a reliable verdict needs is there.",
    )


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
    operator: Literal["<", "<=", ">", ">="] = Field(">=", description="How the statistic then stands to the threshold.")
    explained: float | None = Field(
        description="Share of PV's variance explained in free run on cycles not fitted; null: nothing fitted."
    )
    explained_without_stiction: float | None = Field(
        None, description="Of stiction: the same by a valve that follows OP; null: of all others."
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

    recording: str = Field(
        description="Name of the recording: its file name without suffix, of a file with several loops also `:` and "
        "the loop's tag (unit:FIC101); of the service the loop's tag."
    )
    loop: str = Field(description="Tag of the control loop.")
    samples: int = Field(description="Samples of the recording.")
    window_samples: int | None = Field(
        None, description="Samples from window_start to window_end, which is what was judged; null: nothing was."
    )
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
        description="Stiction band d in per cent of the range that OP covers in what the published rule was run on."
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
        None,
        description="Health of the loop, 0 to 100; what each part takes off is in health_parts. Null: too little was "
        "measured to say anything, good or bad; health_not_evaluated says what.",
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
    moves_set_point_of: str | None = Field(
        None, description="Loops whose set point this loop's OP is, parted by ';'; null: none was found."
    )
    set_point_moved_by: str | None = Field(
        None, description="The loop whose OP is this loop's set point, or loops, parted by ';'; null: none was found."
    )
    unanswered_since: str | None = Field(
        None,
        description="Since when PV does not answer OP, up to the end of the record, ISO 8601, UTC; null: it answers, "
        "or nobody has seen it begin.",
    )
    stood_with: int | None = Field(
        None,
        description="How many other loops' PV froze at about the same time, beyond chance; null: none, or PV "
        "is not frozen.",
    )
    stood_together_since: str | None = Field(
        None,
        description="When the first of all of them froze, ISO 8601, UTC: the same in the rows of one run, and "
        "another one where a loop that froze before was audited later; null: where stood_with is.",
    )
    hidden_band_op: float | None = Field(
        None,
        description="The band that PV shows though the shapes clear the valve, in the unit of OP; null: it shows none, "
        "or the valve is not cleared.",
    )
    input_fingerprint: str = Field(
        description="SHA-256 of what was judged: samples, spans, whether the process integrates."
    )
    config_fingerprint: str = Field(description="SHA-256 of the configuration of the audit.")
    health_not_evaluated: str | None = Field(None, description="Why there is no health; null: there is one.")


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
    unanswered_since_s: float | None = Field(None, description="unanswered_since in seconds from the first sample.")


class ReliabilityRow(FlatSize, AuditFields):
    """One loop in the per-loop reliability table: the audit line, flat, with where and when."""

    health_parts: str | None = Field(
        None, description="What takes how much off the health: `stiction 38.0;oscillation 12.1`."
    )
    unit: str | None = Field(description="Plant unit that the loop belongs to.")
    window_start: str | None = Field(description="First audited sample, ISO 8601, UTC.")
    window_end: str | None = Field(description="Last audited sample, ISO 8601, UTC.")
    input_start: str | None = Field(
        None, description="First sample that the audit was given, ISO 8601, UTC; null: not kept."
    )
    input_end: str | None = Field(None, description="Last sample that the audit was given, ISO 8601, UTC.")
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
    of_old_record: bool = Field(
        False,
        description="Whether the record of the verdict ended two days or more before the newest sample that the plant "
        "had when the run was started: the verdict dates from then.",
    )


class WrittenFields(BaseModel):
    """What is to be done about a loop, and what is written of it: of now, or, in the table of a run that a newer one
    has taken the place of, of when that run ended."""

    next_step: str | None = Field(None, description="What to do next about the loop, in words, as its page says.")
    work_order: str | None = Field(None, description="The work order that was written of the loop last; null: none.")
    repaired_at: str | None = Field(None, description="When it was repaired last, ISO 8601, UTC; null: not known.")
    shelved_until: str | None = Field(
        None, description="Until when it is left out of what to look at first, ISO 8601, UTC; null: it is not shelved."
    )
    of_before_repair: bool = Field(False, description="Whether the verdict is from before the repair at repaired_at.")


class TableRow(WrittenFields, ReliabilityRow):
    """A row of the reliability table: the newest verdict of a loop, with what is written of the loop."""


class KeyFiguresLine(BaseModel):
    """What engineers expect of a loop monitor, over good samples only; null where a figure cannot be had."""

    good_share_pct: float | None = Field(None, description="Samples with PV and OP, per cent of all samples.")
    service_factor_pct: float | None = Field(None, description="Good time in automatic, per cent; null: no mode.")
    op_saturation_pct: float | None = Field(
        None, description="Time in automatic with OP at an end of its span, per cent; null: no span."
    )
    op_at_extreme_pct: float | None = Field(
        None, description="The same at the one of OP's own extremes where it stands longer; null: its span is known."
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
    op_travel_per_h: float | None = Field(None, description="Travel of OP an hour of recorded time, in the unit of OP.")
    op_reversals_per_h: float | None = Field(
        None,
        description="Changes of OP's direction an hour of recorded time; turns within 2 % of the range in which OP was "
        "(5th to 95th percentile) do not count.",
    )
    op_travel_pct_of_span_per_h: float | None = Field(
        None, description="Travel of OP an hour of recorded time, per cent of its span; null: no span."
    )
    response_time_s: float | None = Field(
        None, description="Lag at which the autocorrelation of the control error falls below 1/e, in seconds."
    )
    harris_index: float | None = Field(
        None, description="Minimum over present variance of the control error, 0 (poor) to 1; no measure between loops."
    )
    harris_horizon_samples: int | None = Field(
        None, description="Dead time that the Harris index assumes of every loop, in samples."
    )
