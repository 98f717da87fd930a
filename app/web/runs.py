"""Audit runs: started, watched while they go on, looked up, stopped."""

from fastapi import APIRouter
from fastapi.responses import HTMLResponse
from starlette.responses import RedirectResponse

from app.http.backend import Caller, Identifier, Services
from app.services.auditing.audits import cancel_audit, failures, list_audits, start_audit, whole_run
from app.services.auditing.run_figures import run_figures
from app.services.digests.deliveries import deliveries_of
from app.web.rendering import page

SHOWN = 50
SHOWN_FAILURES = 500

router = APIRouter()


@router.get("/runs")
def runs(backend: Services, cursor: str = "") -> HTMLResponse:
    newest = whole_run(backend)
    going_on = newest if newest and not newest.ended else None
    return page("runs.html", backend.clock, found=list_audits(backend, SHOWN, cursor or None), going_on=going_on)


@router.post("/runs")
def start(backend: Services, caller: Caller) -> RedirectResponse:
    """Who clicks twice gets one run: the second click leads to the one that goes on."""
    run_started = start_audit(backend, trigger="request", started_by=caller.who, unless_going_on=True)
    return RedirectResponse(f"/runs/{run_started.id}", 303)


@router.get("/runs/{audit_id}")
def run(backend: Services, audit_id: Identifier) -> HTMLResponse:
    figures = run_figures(backend, audit_id)
    failed = failures(backend, audit_id, SHOWN_FAILURES) if figures.run.failed else []
    sent = deliveries_of(backend, audit_id)
    told = {"run": figures.run, "figures": figures, "failures": failed, "deliveries": sent}
    return page("run.html", backend.clock, **told)


@router.post("/runs/{audit_id}/cancel")
def cancel(backend: Services, audit_id: Identifier) -> RedirectResponse:
    return RedirectResponse(f"/runs/{cancel_audit(backend, audit_id).id}", 303)
