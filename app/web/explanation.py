"""The part of a loop's page that says what a simulation of it lacks, and the button that asks for it."""

from typing import Any

from fastapi import APIRouter
from fastapi.responses import HTMLResponse
from starlette.responses import RedirectResponse, Response

from app.errors import LoopauditError
from app.http.backend import Caller, Services
from app.http.paths import LoopTag
from app.services.addresses import tag_in_url
from app.services.backend import Backend
from app.services.explaining import explanations
from app.services.explaining.wording import in_words
from app.web.rendering import page

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
    return page("_explanation.html", backend.clock, tag=tag, explanation=newest_in_words(backend, tag))


def newest_in_words(backend: Backend, tag: str) -> dict[str, Any] | None:
    """What the template shows of a loop's newest explanation; None where there is none."""
    found = explanations.newest(backend, tag)
    if found is None:
        return None
    return in_words(found, backend.clock)
