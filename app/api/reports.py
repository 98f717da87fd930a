"""Reports to keep and to pass on: one HTML file each, which needs no network."""

import re
from datetime import UTC, datetime
from typing import Any

from fastapi import APIRouter
from starlette.responses import HTMLResponse

from app.api.models import NightsPage
from app.http.backend import Services
from app.http.paths import LoopTag
from app.http.problems import responses
from app.services.backend import Backend
from app.services.plant.course import course
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


@router.get("/nights", response_model=NightsPage, summary="The plant, night by night")
def nights(backend: Services) -> Any:
    """How many valves stick reliably, in the plant and in its units, its mean health, and what was in manual."""
    return {"rows": course(backend), "next_cursor": None}


def _file(backend: Backend, html: str, name: str) -> HTMLResponse:
    """To be saved, under a name that every file system takes."""
    safe = UNSAFE.sub("-", name).strip("-.")[:80] or "report"
    filename = f"{safe}-{backend.clock.date(datetime.now(UTC))}.html"
    return HTMLResponse(html, headers={"Content-Disposition": f'attachment; filename="{filename}"'})
