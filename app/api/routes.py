"""All routes of the API, under one door."""

from functools import cache

from fastapi import APIRouter, Depends

from app.api import (
    audits,
    explanations,
    groups,
    loop_list,
    loops,
    notes,
    reliability,
    reports,
    trail,
    uploads,
)
from app.http.parameters import only_known
from app.http.problems import responses

ROOMS = (uploads, explanations, reports, notes, loop_list, loops, reliability, audits, groups, trail)


@cache
def api() -> APIRouter:
    """Put together once: each room is looked through again wherever it is put, for 20 ms in all."""
    router = APIRouter(prefix="/v1", dependencies=[Depends(only_known)], responses=responses(422))
    for room in ROOMS:
        router.include_router(room.router)
    return router
