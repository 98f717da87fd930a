"""Explanations of a loop: asked for, looked up, their traces."""

from typing import Annotated, Any

from fastapi import APIRouter, Body, Depends, Response
from starlette.responses import PlainTextResponse

from app.api.explanation_models import ExplanationIn, ExplanationOut, ExplanationPage, PlotOut
from app.api.loops import Points
from app.api.models import CSV
from app.http.backend import Caller, Cursor, Identifier, Limit, Services
from app.http.parameters import json_alone
from app.http.paths import LoopTag
from app.http.problems import responses
from app.services.addresses import tag_in_url
from app.services.explaining import explanations as service
from app.services.explaining import traces as explanation_traces
from app.services.explaining.simulations import GivenSimulation, GivenTrace

WITHOUT_SIMULATION = ExplanationIn()
Wanted = Annotated[ExplanationIn, Body()]

router = APIRouter(tags=["explanations"])


@router.post(
    "/loops/{tag:path}/explanations",
    status_code=202,
    response_model=ExplanationOut,
    responses=responses(400, 404, 409, 413, 415, 422),
    dependencies=[Depends(json_alone)],
    summary="Compare a loop's recording with a simulation",
)
def ask(
    response: Response, backend: Services, tag: LoopTag, caller: Caller, wanted: Wanted = WITHOUT_SIMULATION
) -> Any:
    """Where they differ, and which physics is missing; without a body the recorded simulation or our own is taken.
    202: the request is stored; a worker does it. 409 while far more of them wait than anybody looks at."""
    asked = service.ask(backend, tag, meant(wanted), asked_by=caller.who)
    response.headers["Location"] = f"/v1/loops/{tag_in_url(tag)}/explanations/{asked['id']}"
    return asked


@router.get(
    "/loops/{tag:path}/explanations",
    response_model=ExplanationPage,
    responses=responses(400, 404, 422),
    summary="A loop's explanations, newest first",
)
def explanations(backend: Services, tag: LoopTag, limit: Limit = 100, cursor: Cursor = None) -> Any:
    return service.list_explanations(backend, tag, limit, cursor)


@router.get(
    "/loops/{tag:path}/explanations/{explanation_id}",
    response_model=ExplanationOut,
    responses=responses(404),
    summary="One explanation",
)
def explanation(backend: Services, tag: LoopTag, explanation_id: Identifier) -> Any:
    """State and, once it is done, every field of `loopaudit explain --format json`."""
    return service.get_explanation(backend, tag, explanation_id)


@router.get(
    "/loops/{tag:path}/explanations/{explanation_id}/trace",
    response_class=PlainTextResponse,
    responses={**responses(404), **CSV},
    summary="Recording and simulations as CSV",
)
def trace(backend: Services, tag: LoopTag, explanation_id: Identifier) -> PlainTextResponse:
    """Time in seconds, PV, the three simulations and their residuals, over the whole window."""
    text = explanation_traces.trace_csv(backend, tag, explanation_id)
    headers = {"Content-Disposition": 'attachment; filename="explanation.csv"'}
    return PlainTextResponse(text, media_type="text/csv; charset=utf-8", headers=headers)


@router.get(
    "/loops/{tag:path}/explanations/{explanation_id}/plot",
    response_model=PlotOut,
    responses=responses(404, 422),
    summary="The same for a chart",
)
def plot(backend: Services, tag: LoopTag, explanation_id: Identifier, points: Points = 2000) -> Any:
    return explanation_traces.plot(backend, tag, explanation_id, points)


def meant(wanted: ExplanationIn) -> service.Wanted:
    trace = None if wanted.trace is None else GivenTrace(wanted.trace.values, wanted.trace.time)
    simulation = GivenSimulation(trace, wanted.csv, wanted.column, wanted.model)
    return service.Wanted(wanted.start, wanted.end, wanted.window_h, simulation)
