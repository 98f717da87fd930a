"""What is asked and answered about explanations: each field with its meaning and its unit."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, Strict

from app.api.models import AnyPage, Name
from app.http.backend import IsoTime
from app.services.explaining.explanations import LONGEST_WINDOW_H
from app.services.explaining.simulations import LARGEST_TRACE

Number = Annotated[float, Strict(), Field(allow_inf_nan=False)]
Span = Annotated[list[float], Field(min_length=2, max_length=2)]


class TraceIn(BaseModel):
    """A simulated PV over the window."""

    model_config = ConfigDict(extra="forbid")

    values: list[Number | None] = Field(description="Simulated PV, in the unit of PV; null where there is none.")
    time: list[Number] | list[datetime] | None = Field(
        None,
        description="A time for each value: ISO 8601 (without an offset: in the plant's zone), or seconds from the "
        "first sample of the window, or seconds since 1970. Left out: one value for each sample of the window.",
    )


class ExplanationIn(BaseModel):
    """Which stretch of the loop's recording, against which simulation.

    Of `trace`, `csv`, `column` and `model` at most one. None of them: the recorded column PV_sim where there is one, or
    else our own identified linear loop.
    """

    model_config = ConfigDict(extra="forbid", populate_by_name=True)

    start: IsoTime | None = Field(
        None, alias="from", description="Start of the window, ISO 8601; without an offset it is UTC."
    )
    end: IsoTime | None = Field(None, alias="to", description="End of the window; left out: the newest sample.")
    window_h: Annotated[float, Strict()] | None = Field(
        None,
        gt=0,
        le=LONGEST_WINDOW_H,
        description="Length of the window in hours, up to its end; not together with its start.",
    )
    trace: TraceIn | None = Field(None, description=f"A simulated trace, at most {LARGEST_TRACE} values.")
    csv: str | None = Field(
        None, description="A simulated trace as CSV text: a column PV_sim, perhaps a column of times."
    )
    column: Name | None = Field(None, description="A signal recorded with the loop that holds the simulation.")
    model: dict[str, Any] | None = Field(
        None,
        description="A model to simulate: gain (PV per OP; per second where integrating), time_constants_s, "
        "dead_time_s, damping (the first time constant is then one over the natural frequency in rad/s), "
        "integrating, controller (gain in OP per PV, integral_time_s, derivative_time_s, "
        "type ideal or series).",
        examples=[
            {
                "gain": 1.2,
                "time_constants_s": [30],
                "dead_time_s": 4,
                "controller": {"gain": 0.5, "integral_time_s": 40},
            }
        ],
    )


class Told(BaseModel):
    """Part of an answer; fields may be added."""

    model_config = ConfigDict(extra="allow")


class EstimateOut(Told):
    value: float | None = Field(description="Estimate, in `unit`.")
    low: float | None = Field(description="Low end of the 95 % interval.")
    high: float | None = Field(description="High end of the 95 % interval.")
    unit: str = Field(description="Unit of value, low and high.")


class EvidenceOut(Told):
    code: str = Field(description="Stable code of the reason.")
    text: str = Field(description="The reason as a sentence for an engineer.")


class EffectOut(Told):
    """A piece of physics that the simulation lacks."""

    effect: str = Field(description="Code: valve.stiction, sensor.drift, ...; unnamed where no physics fits.")
    alternatives: list[str] = Field(description="Codes that this recording cannot tell from `effect`.")
    probability: float = Field(description="That `effect` or one of its alternatives is right, 0 to 1.")
    block: str = Field(description="valve, process, sensor or disturbance.")
    parameters: dict[str, EstimateOut] = Field(description="Parameters by name, with 95 % intervals.")
    windows: list[Span] = Field(
        description="Where it acts: from start up to, not at, end, in seconds from the start of the recording."
    )
    condition: str = Field(description="When it acts, in words.")
    evidence: list[EvidenceOut] = Field(description="Why it is believed.")


class LocatedOut(Told):
    """Where the two differ."""

    block: str | None = Field(description="valve, process, sensor, disturbance or controller; null: nowhere.")
    windows: list[Span] = Field(
        description="From start up to, not at, end, in seconds from the start of the recording."
    )
    condition: str = Field(description="When they differ, in words.")
    frequency_hz: float | None = Field(description="Where they differ at one frequency, in Hz.")


class LagsTestOut(Told):
    """Squared correlations over some lags, against chance."""

    statistic: float | None = Field(description="Ljung and Box's, or Haugh's, statistic.")
    limit: float | None = Field(description="What chance exceeds in one record of twenty.")
    p: float | None = Field(description="How often chance alone gives so much.")
    lags: int = Field(description="How many lags.")


class ResidualTestsOut(Told):
    """What a free run leaves on the stretch that no fit has seen, whitened by its noise model."""

    whiteness: LagsTestOut = Field(description="Whether it is white: beyond the limit something is left to model.")
    independence: LagsTestOut | None = Field(
        description="Whether it owes nothing to OP before it: beyond the limit OP explains more. null: OP stands still."
    )


class ResidualsOut(Told):
    """Tests of the three simulations; null where the stretch is too short or nothing is left."""

    given: ResidualTestsOut | None = Field(description="The simulation as given.")
    refitted: ResidualTestsOut | None = Field(description="Its parameters fitted.")
    explained: ResidualTestsOut | None = Field(description="With the missing physics.")


class FitOut(Told):
    """Free-run simulations over the stretch that no fit has seen: as given, refitted, and with the missing physics."""

    rmse_given: float | None = Field(description="In the unit of PV; null where no simulation was given.")
    rmse_refitted: float | None = Field(description="The same structure with its parameters fitted, in the unit of PV.")
    rmse_explained: float | None = Field(description="With the missing physics, in the unit of PV.")
    fit_pct_given: float | None = Field(description="Fit in per cent; null where no simulation was given.")
    fit_pct_refitted: float | None = Field(description="Fit in per cent.")
    fit_pct_explained: float | None = Field(description="Fit in per cent.")
    held_out: list[Span] = Field(
        description="From start up to, not at, end, in seconds from the start of the recording."
    )
    residuals: ResidualsOut | None = Field(
        None, description="Whiteness and independence of OP; null in answers of an engine before they were tested."
    )


class RequestOut(BaseModel):
    """What was asked for, and how far it is."""

    model_config = ConfigDict(from_attributes=True)

    id: str = Field(description="Identifier of the explanation.")
    loop: str = Field(description="Tag of the loop.")
    state: Literal["open", "done", "failed"] = Field(description="open -> done or failed.")
    asked_at: str = Field(description="ISO 8601, UTC.")
    asked_by: str | None = Field(description="Who asked, where that is known.")
    ended_at: str | None = Field(description="ISO 8601, UTC; null before the end.")
    audit_id: str | None = Field(description="The nightly run that asked for it; null: somebody did.")
    window_start: str | None = Field(description="First sample of the window, ISO 8601, UTC.")
    window_end: str | None = Field(description="Last sample of the window, ISO 8601, UTC.")
    as_judged: bool = Field(
        description="Where neither window nor simulation was given: of a long record only the part that its audit "
        "judges is explained; once that is done the window is that part."
    )
    verdict: Literal["missing_physics", "consistent", "inconclusive"] | None = Field(description="null before the end.")
    effect_codes: list[str] = Field(description="Codes of the effects, the strongest first.")
    error_code: str | None = Field(description="Stable code of why it failed.")
    error_text: str | None = Field(description="Why it failed, in words.")
    waits_for_room_since: str | None = Field(
        None,
        description="Since when there is no room on the disk to keep its answer, ISO 8601, UTC; it is tried again "
        "every five minutes at the latest. Null: it does not wait for that.",
    )


class ExplanationOut(RequestOut):
    """An explanation: what was asked for and, once it is done, all that `loopaudit explain --format json` says.

    While it is open `located` may hold a first answer: where the two differ, before it is known why.
    """

    model_config = ConfigDict(from_attributes=True, extra="allow")

    simulation: Literal["trace", "column", "model", "identified"] = Field(
        description="What the recording is compared with; identified: our own linear loop."
    )
    recording: str | None = Field(description="Name of the recording: the loop's tag.")
    effects: list[EffectOut] = Field(description="What is missing, the strongest first; empty where nothing is.")
    located: LocatedOut | None = Field(description="Where the two differ.")
    fit: FitOut | None = Field(description="How much better the explained simulation is.")
    figures_of: dict[str, str | None] | None = Field(
        None, description="Whose free runs given, refitted and explained are, in words; null in older answers."
    )
    validation: dict[str, Any] | None = Field(
        description="The same on a second recording; null where none was given: over HTTP none is."
    )
    refit: dict[str, EstimateOut] | None = Field(description="The simulation's own parameters, fitted.")
    evidence: list[EvidenceOut] = Field(description="What else was found.")
    closed_loop: dict[str, Any] | None = Field(
        description="The loop closed again from SP alone, where that can be done."
    )
    model: dict[str, Any] | None = Field(description="The explained model, enough to simulate again.")
    engine_version: str | None = Field(description="Version of the engine.")
    elapsed_s: float | None = Field(description="Time that it took, in seconds.")


class ExplanationPage(AnyPage):
    rows: list[RequestOut] = Field(description="Explanations, the newest first, without their answers.")


class PlotOut(BaseModel):
    """Traces for a chart: of each stretch the least and the greatest value; times in seconds from `start`."""

    start: str = Field(description="Instant of second 0, ISO 8601, UTC.")
    time_s: list[float] = Field(description="Seconds from the start of the recording.")
    recording: list[float | None] = Field(description="PV as recorded, in its unit.")
    given: list[float | None] | None = Field(description="The simulation as given; null where none was.")
    refitted: list[float | None] = Field(description="The simulation with its own parameters fitted.")
    explained: list[float | None] = Field(description="The simulation with the missing physics.")
    trigger_label: str = Field(description="What the residual depends on, with its unit.")
    trigger: list[float | None] = Field(description="Its values at some of the samples.")
    residual_before: list[float | None] = Field(description="Recording minus refitted simulation at these samples.")
    residual_after: list[float | None] = Field(description="Recording minus explained simulation at these samples.")
    windows: list[Span] = Field(description="Where the two differ: from start up to, not at, end, s from the start.")
    held_out: list[Span] = Field(description="What no fit has seen: from start up to, not at, end, s from the start.")
