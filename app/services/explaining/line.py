"""An explanation as the JSON that `explain --format json` and the API answer with: the one place where that form is
made.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypedDict

from app.engine import ENGINE_VERSION
from app.engine.mismatch.fit.closed_loop import ClosedLoop, LoopFigures
from app.engine.mismatch.fit.windows import Window
from app.engine.mismatch.judge.holdout import FitMeasures
from app.engine.mismatch.judge.residuals import LagsTest
from app.engine.mismatch.judge.result import (
    NOWHERE,
    Effect,
    ExplainedModel,
    Explanation,
    Improvement,
    Location,
    PartModel,
)
from app.engine.mismatch.loop.law import Law
from app.errors import DataError
from app.services.audit_json.numbers import or_none

Kind = Literal["trace", "column", "model", "identified"]
"""What a recording is compared with; identified: our own linear loop."""

SIMULATIONS = ("given", "refitted", "explained")

FIGURES = 6
"""Significant ones, of each number of an explanation."""

GIVEN_WORDS: dict[Kind, str] = {
    "trace": "the given simulation",
    "column": "the simulation recorded with it",
    "model": "the given model",
}


@dataclass(frozen=True)
class Second:
    """The recording that an explanation was validated on, and what simulation there was of it."""

    name: str
    simulation: Kind


class ExplanationLine(TypedDict):
    """The fields of `explanation_line`, in their order."""

    recording: str
    simulation: Kind
    figures_of: dict[str, str | None]
    verdict: str
    effects: list[dict[str, Any]]
    located: dict[str, Any]
    fit: dict[str, Any]
    validation: dict[str, Any] | None
    refit: dict[str, Any]
    evidence: list[dict[str, Any]]
    closed_loop: dict[str, Any] | None
    model: dict[str, Any]
    engine_version: str
    elapsed_s: float | None


LINE_FIELDS = tuple(ExplanationLine.__annotations__)


def explanation_line(
    explanation: Explanation,
    elapsed_s: float | None = None,
    simulation: Kind = "identified",
    second: Second | None = None,
) -> dict[str, Any]:
    line: ExplanationLine = {
        "recording": explanation.name,
        "simulation": simulation,
        "figures_of": figures_of(explanation.name, simulation, [effect.code for effect in explanation.effects]),
        "verdict": explanation.verdict,
        "effects": [effect_line(effect) for effect in explanation.effects],
        "located": location_line(explanation.located),
        "fit": fit_line(explanation.fit),
        "validation": None if explanation.validation is None else validation_line(explanation.validation, second),
        "refit": {
            e.name: {"value": rounded(e.value), "low": rounded(e.low), "high": rounded(e.high), "unit": e.unit}
            for e in explanation.refit
        },
        "evidence": [{"code": reason.code, "text": reason.text} for reason in explanation.evidence],
        "closed_loop": None if explanation.closed_loop is None else closed_loop_line(explanation.closed_loop),
        "model": model_line(explanation.model),
        "engine_version": explanation.engine_version,
        "elapsed_s": None if elapsed_s is None else round(elapsed_s, 3),
    }
    return {**line}


def unusable_line(error: DataError, name: str, simulation: Kind, elapsed_s: float | None = None) -> dict[str, Any]:
    """Of a recording with nothing to compare a simulation with: the same fields, inconclusive, with the reason."""
    line: ExplanationLine = {
        "recording": name,
        "simulation": simulation,
        "figures_of": dict.fromkeys(SIMULATIONS),
        "verdict": "inconclusive",
        "effects": [],
        "located": location_line(NOWHERE),
        "fit": {
            **dict.fromkeys(f"{of}_{simulated}" for of in ("rmse", "fit_pct") for simulated in SIMULATIONS),
            "held_out": [],
            "residuals": dict.fromkeys(SIMULATIONS),
        },
        "validation": None,
        "refit": {},
        "evidence": [{"code": error.code, "text": error.message}],
        "closed_loop": None,
        "model": {},
        "engine_version": ENGINE_VERSION,
        "elapsed_s": None if elapsed_s is None else round(elapsed_s, 3),
    }
    return {**line}


def figures_of(recording: str, simulation: Kind, codes: Sequence[str]) -> dict[str, str | None]:
    """Whose free runs the figures called given, refitted and explained are of."""
    given = GIVEN_WORDS.get(simulation)
    behind = f"the linear model behind {given}" if simulation in ("trace", "column") else given
    refitted = f"{behind}, its parameters fitted to {recording}" if behind else f"our own linear loop of {recording}"
    named = f"{refitted}, with {' and '.join(dict.fromkeys(codes))}" if codes else f"{refitted}, nothing added"
    return {"given": given, "refitted": refitted, "explained": named}


def location_line(located: Location) -> dict[str, Any]:
    return {
        "block": located.block,
        "windows": windows(located.windows),
        "condition": located.condition,
        "frequency_hz": rounded(located.frequency_hz),
    }


def located_line(located: Location, name: str, elapsed_s: float | None = None) -> dict[str, Any]:
    """The first answer: where the two differ, without names."""
    return {
        "recording": name,
        "located": location_line(located),
        "evidence": [{"code": reason.code, "text": reason.text} for reason in located.evidence],
        "elapsed_s": None if elapsed_s is None else round(elapsed_s, 3),
    }


def rounded(value: float | None) -> float | None:
    return or_none(value, FIGURES)


def windows(found: tuple[Window, ...]) -> list[list[float | None]]:
    """[start, end] of each, s from the start of the record: from `start` up to, not at, `end`."""
    return [[rounded(w.start_s), rounded(w.end_s)] for w in found]


def effect_line(effect: Effect) -> dict[str, Any]:
    return {
        "effect": effect.code,
        "alternatives": list(effect.alternatives),
        "probability": round(effect.probability, 3),
        "block": effect.place,
        "parameters": {
            p.name: {"value": rounded(p.value), "low": rounded(p.low), "high": rounded(p.high), "unit": p.unit}
            for p in effect.parameters
        },
        "windows": windows(effect.windows),
        "condition": effect.condition,
        "evidence": [{"code": reason.code, "text": reason.text} for reason in effect.evidence],
    }


def rmse(fitness: FitMeasures | None) -> float | None:
    return None if fitness is None else rounded(fitness.rmse)


def percent(fitness: FitMeasures | None) -> float | None:
    return None if fitness is None else rounded(fitness.fit_pct)


def fit_line(fit: Improvement) -> dict[str, Any]:
    return {
        "rmse_given": rmse(fit.given),
        "rmse_refitted": rmse(fit.refitted),
        "rmse_explained": rmse(fit.explained),
        "fit_pct_given": percent(fit.given),
        "fit_pct_refitted": percent(fit.refitted),
        "fit_pct_explained": percent(fit.explained),
        "held_out": windows(fit.held_out),
        "residuals": {
            "given": None if fit.given is None else tests_line(fit.given),
            "refitted": tests_line(fit.refitted),
            "explained": tests_line(fit.explained),
        },
    }


def tests_line(fitness: FitMeasures) -> dict[str, Any] | None:
    """Whether what the free run leaves is white, and owes nothing to OP."""
    tests = fitness.tests
    if tests is None:
        return None
    return {"whiteness": test_line(tests.whiteness), "independence": test_line(tests.independence)}


def test_line(test: LagsTest | None) -> dict[str, float | int | None] | None:
    if test is None:
        return None
    p = rounded(test.p_value)
    return {"statistic": rounded(test.statistic), "limit": rounded(test.limit), "p": p, "lags": test.lags}


def validation_line(validation: Improvement, second: Second | None) -> dict[str, Any]:
    """On a second recording; `given` there is a model's own run, or the simulation that was recorded with it."""
    given = None if second is None or validation.given is None else GIVEN_WORDS.get(second.simulation)
    return {
        "recording": None if second is None else second.name,
        "given_of": given,
        "rmse_given": rmse(validation.given),
        "rmse_refitted": rmse(validation.refitted),
        "rmse_explained": rmse(validation.explained),
    }


def closed_loop_line(closed: ClosedLoop) -> dict[str, Any]:
    return {
        "controller": law_line(closed.law),
        "given_controller": None if closed.given_law is None else law_line(closed.given_law),
        "recorded": figures_line(closed.recorded),
        "given": figures_line(closed.given),
        "refitted": figures_line(closed.refitted),
        "explained": figures_line(closed.explained),
        "with_noise": figures_line(closed.with_noise),
        "as_recorded": figures_line(closed.as_recorded),
        "lacked": list(closed.lacked),
    }


def law_line(law: Law) -> dict[str, float | None]:
    return {
        "kc": rounded(law.kc),
        "ki": rounded(law.ki),
        "kd": rounded(law.kd),
        "explained": rounded(law.explained),
        "sp": rounded(law.sp),
    }


def figures_line(figures: LoopFigures | None) -> dict[str, float | None] | None:
    if figures is None:
        return None
    return {
        "period_s": rounded(figures.period_s),
        "amplitude": rounded(figures.amplitude),
        "yper_pct": rounded(figures.yper_pct),
        "shape": rounded(figures.shape),
    }


def model_line(model: ExplainedModel) -> dict[str, Any]:
    return {
        "sampling_interval_s": model.sampling_interval_s,
        "op_mid": model.op_mid,
        "pv_mid": model.pv_mid,
        "op_span": model.op_span,
        "pv_span": model.pv_span,
        "plant": dict(model.plant),
        "parts": [{"name": p.name, "effect": p.code, "values": list(p.values)} for p in model.parts],
        "measured": list(model.measured),
        "rest": list(model.rest),
        "duration_s": model.duration_s,
        "measured_mids": list(model.measured_mids),
        "op_follows_pv": model.op_follows_pv,
    }


def model_from_line(line: object) -> ExplainedModel:
    """An exported model, as JSON gave it. Raises DataError("model_invalid") where it is not whole."""
    model = line.get("model", line) if isinstance(line, dict) else line
    if not isinstance(model, dict):
        raise DataError("model_invalid", f"this is no model that explain has written, but {str(model)[:60]!r}")
    try:
        return ExplainedModel(
            sampling_interval_s=float(model["sampling_interval_s"]),
            op_mid=float(model["op_mid"]),
            pv_mid=float(model["pv_mid"]),
            op_span=float(model["op_span"]),
            pv_span=float(model["pv_span"]),
            plant=tuple((str(name), float(value)) for name, value in model["plant"].items()),
            parts=tuple(
                PartModel(str(p["name"]), str(p["effect"]), tuple(float(v) for v in p["values"]))
                for p in model["parts"]
            ),
            measured=tuple(str(name) for name in model["measured"]),
            rest=tuple(float(value) for value in model.get("rest", ())),
            duration_s=None if model.get("duration_s") is None else float(model["duration_s"]),
            measured_mids=tuple(float(value) for value in model.get("measured_mids", ())),
            op_follows_pv=bool(model.get("op_follows_pv", True)),
        )
    except KeyError as error:
        raise DataError("model_invalid", f"this is no model that explain has written: it has no {error}") from error
    except (TypeError, ValueError, AttributeError) as error:
        raise DataError("model_invalid", f"this is no model that explain has written: {error}") from error
