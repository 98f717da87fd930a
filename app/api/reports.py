"""Reports to keep and to pass on: one HTML file each, which needs no network."""

import re
from datetime import UTC, datetime
from typing import Annotated, Any

from fastapi import APIRouter, Query
from fastapi.concurrency import run_in_threadpool
from pydantic import Field
from starlette.requests import Request
from starlette.responses import HTMLResponse

from app.api.models import NightsPage
from app.api.reliability import RowFilters
from app.http.backend import Services
from app.http.paths import LoopTag
from app.http.problems import responses
from app.services.auditing.audits import get_audit
from app.services.backend import Backend
from app.services.plant.course import course
from app.services.plant.reliability import sortable
from app.services.reports import documents as reports

router = APIRouter(tags=["reports"])
UNSAFE = re.compile(r"[^A-Za-z0-9._-]+")


@router.get(
    "/loops/{tag:path}/report", response_class=HTMLResponse, responses=responses(404), summary="A loop's report"
)
def loop(backend: Services, tag: LoopTag) -> HTMLResponse:
    """What is known of a loop: verdict, evidence, charts, history, key figures with their sources; one HTML file."""
    return _file(backend, reports.loop_report(backend, tag), tag)


@router.get("/report", response_class=HTMLResponse, responses=responses(404), summary="The plant's report")
def plant(backend: Services) -> HTMLResponse:
    """The plant: counts, changes, the worst loops of each unit, what could not be audited and why; one HTML file."""
    return _file(backend, reports.plant_report(backend), backend.settings.plant)


class ReportsQuery(RowFilters):
    """Reports of which loops, in which order."""

    sort: str = Field("-priority", max_length=60, description=f"One of {', '.join(sortable())}; `-` turns it around.")
    limit: int = Field(reports.MOST_TOGETHER, ge=1, le=reports.MOST_TOGETHER, description="Reports in the file.")


@router.get(
    "/reports", response_class=HTMLResponse, responses=responses(400, 404, 422), summary="Reports of many loops"
)
async def of_many(request: Request, backend: Services, query: Annotated[ReportsQuery, Query()]) -> HTMLResponse:
    """The reports of the loops that the filters of the reliability table leave, in one HTML file with a list of them at
    its head; printed, each loop begins on a page of its own."""

    def written() -> HTMLResponse:
        if query.audit_id is not None:
            get_audit(backend, query.audit_id)
        html = reports.loop_reports(backend, query.filters(), query.sort, query.limit)
        return _file(backend, html, f"{backend.settings.plant}-loops")

    async with request.app.state.table_places:  # some ten megabytes each, and seconds of work
        return await run_in_threadpool(written)


@router.get("/nights", response_model=NightsPage, summary="The plant, night by night")
def nights(backend: Services) -> Any:
    """How many valves stick reliably, in the plant and in its units, its mean health, and what was in manual."""
    return {"rows": course(backend), "next_cursor": None}


def _file(backend: Backend, html: str, name: str) -> HTMLResponse:
    """To be saved, under a name that every file system takes."""
    safe = UNSAFE.sub("-", name).strip("-.")[:80] or "report"
    filename = f"{safe}-{backend.clock.date(datetime.now(UTC))}.html"
    return HTMLResponse(html, headers={"Content-Disposition": f'attachment; filename="{filename}"'})
