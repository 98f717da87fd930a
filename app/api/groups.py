"""Loops that oscillate together."""

from typing import Any

from fastapi import APIRouter

from app.api.models import GroupPage
from app.http.backend import Services
from app.services.plant.groups import plant_groups

router = APIRouter(tags=["groups"])


@router.get("/groups", response_model=GroupPage, summary="Loops that oscillate together")
def groups(backend: Services) -> Any:
    """Groups of loops that swing with one period, the likeliest source of each first; by the newest verdicts."""
    return {"rows": plant_groups(backend), "next_cursor": None}
