"""The part of a loop's page that says what a simulation of it lacks, and the button that asks for it."""

from typing import Any

from fastapi import APIRouter
from fastapi.responses import HTMLResponse
from starlette.responses import RedirectResponse, Response

from app.api.backend import Caller, Services
from app.api.paths import LoopTag
from app.errors import LoopauditError
from app.services import explanations
from app.services.backend import Backend
from app.services.explanation_wording import (
    SIMULATION_WORDS,
    VERDICT_WORDS,
    effect_words,
    number,
    parameters_in_words,
    windows_in_words,
)
from app.web.rendering import page, tag_in_url

router = APIRouter(include_in_schema=False)


@router.post("/loops/{tag:path}/explanations")
def ask(backend: Services, tag: LoopTag, caller: Caller) -> Response:
    """Against the recorded simulation, or our own linear loop; where one is being worked out it is that one."""
    newest = explanations.newest(backend, tag)
    if newest is None or newest["state"] != "open":
        try:
            explanations.ask(backend, tag, asked_by=caller.who)
        except LoopauditError as error:
            refused = page("explanation_refused.html", tag=tag, text=error.message)
            refused.status_code = 404 if error.code == "unknown_loop" else 422
            return refused
    return RedirectResponse(f"/loops/{tag_in_url(tag)}#explanation", status_code=303)


@router.get("/loops/{tag:path}/explanation")
def part(backend: Services, tag: LoopTag) -> HTMLResponse:
    """The part by itself, for a page that waits for an answer."""
    return page("_explanation.html", tag=tag, explanation=newest_in_words(backend, tag))


def newest_in_words(backend: Backend, tag: str) -> dict[str, Any] | None:
    """What the template shows of a loop's newest explanation; None where there is none."""
    found = explanations.newest(backend, tag)
    if found is None:
        return None
    return found | {
        "verdict_words": VERDICT_WORDS.get(found["verdict"] or "", ""),
        "simulation_words": SIMULATION_WORDS[found["simulation"]],
        "told_effects": [effect_in_words(effect) for effect in found["effects"]],
        "errors": errors(found["fit"]),
        "reasons": [reason["text"] for reason in found["evidence"]],
    }


def effect_in_words(effect: dict[str, Any]) -> dict[str, Any]:
    return {
        "code": effect["effect"],
        "words": effect_words(effect["effect"]),
        "alternatives": [effect_words(code) for code in effect["alternatives"]],
        "probability": effect["probability"],
        "block": effect["block"],
        "condition": effect["condition"],
        "parameters": parameters_in_words(effect["parameters"]),
        "windows": windows_in_words(effect["windows"]),
        "reasons": [reason["text"] for reason in effect["evidence"]],
    }


def errors(fit: dict[str, Any] | None) -> list[tuple[str, str, str]]:
    """Free-run error and fit on the stretch that no fit has seen: as given, refitted, explained."""
    if fit is None:
        return []
    names = {"given": "as given", "refitted": "its own parameters fitted", "explained": "with the missing physics"}
    return [
        (words, number(fit[f"rmse_{name}"]), number(fit[f"fit_pct_{name}"]))
        for name, words in names.items()
        if fit[f"rmse_{name}"] is not None
    ]
