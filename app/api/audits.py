"""Audit runs: started, watched, looked up, stopped."""

import asyncio
from collections.abc import AsyncIterator
from functools import partial
from typing import Annotated, Any, NamedTuple
from weakref import WeakValueDictionary

from fastapi import APIRouter, Body, Depends, Request, Response
from fastapi.concurrency import run_in_threadpool
from pydantic import TypeAdapter
from starlette.responses import StreamingResponse

from app.api.models import AuditIn, AuditPage
from app.http.backend import Caller, Cursor, Identifier, Limit, Services
from app.http.parameters import json_alone
from app.http.probing import Probe
from app.http.problems import responses
from app.services.auditing import audits as service
from app.services.outward import AuditOut

LOOK_S = 0.5
HEARTBEAT_EVERY = 20
EVENT_STREAM: dict[int | str, dict[str, Any]] = {
    200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}}
}

EVERY_LOOP = AuditIn(tags=None, unit=None, type=None)
Wanted = Annotated[AuditIn, Body()]
RUN = TypeAdapter(AuditOut)

router = APIRouter(tags=["audits"])


@router.post(
    "/audits",
    status_code=202,
    response_model=AuditOut,
    responses=responses(400, 409, 415, 422),
    dependencies=[Depends(json_alone)],
    summary="Start an audit",
)
def start(response: Response, backend: Services, caller: Caller, wanted: Wanted = EVERY_LOOP) -> Any:
    """Audits the loops that the body names, or the plant, also without a body. 202: it is stored; workers do it. While
    a run of the whole plant goes on, and no upload was read since it began, the plant asked for again is that run.
    Where the plant has no loop with samples yet the run is done at once, with the `code` `no_loops`.
    409 while far more loops wait for their audits than any plant has."""
    asked = loop_filter(wanted)
    whole = asked == service.LoopFilter()
    run = service.start_audit(backend, asked, trigger="request", started_by=caller.who, unless_going_on=whole)
    response.headers["Location"] = f"/v1/audits/{run.id}"
    return run


@router.get("/audits", response_model=AuditPage, responses=responses(400, 422), summary="The runs, newest first")
def audits(backend: Services, limit: Limit = 100, cursor: Cursor = None) -> Any:
    return service.list_audits(backend, limit, cursor)


@router.get("/audits/{audit_id}/events", responses={**responses(404), **EVENT_STREAM}, summary="Progress as events")
async def events(request: Request, backend: Services, audit_id: Identifier) -> StreamingResponse:
    """Server-sent events: `progress` with the run whenever it has moved, `end` when it has ended."""
    await run_in_threadpool(service.get_audit, backend, audit_id)
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return StreamingResponse(watched(request, backend, audit_id), media_type="text/event-stream", headers=headers)


@router.get("/audits/{audit_id}", response_model=AuditOut, responses=responses(404), summary="One run and its progress")
def audit(backend: Services, audit_id: Identifier) -> Any:
    return service.get_audit(backend, audit_id)


@router.post("/audits/{audit_id}/cancel", response_model=AuditOut, responses=responses(404, 409), summary="Stop a run")
def cancel(backend: Services, audit_id: Identifier) -> Any:
    """Loops that are not done become failed with the code `cancelled`; verdicts that are there stay. A run that was
    cancelled before is answered as it is, one that has ended otherwise with 409."""
    return service.cancel_audit(backend, audit_id)


def loop_filter(wanted: AuditIn) -> service.LoopFilter:
    return service.LoopFilter(None if wanted.tags is None else tuple(wanted.tags), wanted.unit, wanted.type)


class Look(NamedTuple):
    """A run as its streams tell it, and whether it has ended."""

    told: str
    ended: bool


def look_at(backend: Services, audit_id: str) -> Look:
    run = service.get_audit(backend, audit_id)
    return Look(RUN.dump_json(run).decode(), run.ended)


def watcher(request: Request, backend: Services, audit_id: str) -> Probe[Look]:
    """One a run for all its streams: however many watch it, the database is asked as for one."""
    known: WeakValueDictionary[str, Probe[Look]] = request.app.state.watched
    found = known.get(audit_id)
    if found is None:
        known[audit_id] = found = Probe(partial(look_at, backend, audit_id), LOOK_S)
    return found


async def watched(request: Request, backend: Services, audit_id: str) -> AsyncIterator[str]:
    """One event a change, a comment now and then so that a broken connection is noticed, and the end."""
    last, quiet, run = "", 0, watcher(request, backend, audit_id)
    while not await request.is_disconnected():
        told, ended = await run.found()
        if ended:
            yield f"event: end\ndata: {told}\n\n"
            return
        quiet = 0 if told != last else quiet + 1
        if told != last:
            yield f"event: progress\ndata: {told}\n\n"
        elif quiet % HEARTBEAT_EVERY == 0:
            yield ": still running\n\n"
        last = told
        await asyncio.sleep(LOOK_S)
