"""What requests do and what they are refused stands in the trail, before the answer goes out."""

import asyncio
import logging
from typing import Any

from fastapi import FastAPI
from fastapi.concurrency import run_in_threadpool
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Send

from app.http.asked import Asked
from app.http.problems import AWAY
from app.services.access import trail
from app.services.access.identity import NOBODY, Identity
from app.services.backend import Backend
from app.services.outward import TrailOutcome

COUNTED = (401,)  # what strangers do is noted where it is limited by address: nobody fills the trail without a key

log = logging.getLogger("loopaudit.access")


async def answer_noted(
    app: ASGIApp, of: FastAPI, asked: Asked, identity: Identity, receive: Receive, send: Send
) -> None:
    """Calls the app; what changes something is noted."""
    if not asked.permission.action:
        await app(asked.scope, receive, send)
        return
    answered = False

    async def noted(message: Message) -> None:
        nonlocal answered
        if message["type"] == "http.response.start":
            answered = True
            outcome = outcome_of(message["status"], asked.scope["state"].get("in_doubt", False))
            where = MutableHeaders(scope=message).get("location")
            who = asked.scope["state"].get("identity", identity)
            if who is not NOBODY or message["status"] in COUNTED:
                await note(of, asked, who, outcome, message["status"], where)
        await send(message)

    try:
        await app(asked.scope, receive, noted)
    except (Exception, asyncio.CancelledError) as error:
        if not answered:
            # When the service is stopped, a thread may go on with it all the same.
            stopped = isinstance(error, asyncio.CancelledError)
            await note(of, asked, identity, *(("not_known", 503) if stopped else ("failed", 500)))
        raise


def outcome_of(status: int, in_doubt: bool) -> TrailOutcome:
    """in_doubt: the database went away while it was written; the change may stand all the same."""
    if in_doubt:
        return "not_known"
    return "done" if status < 400 else "refused" if status < 500 else "failed"


async def note(
    of: FastAPI, asked: Asked, identity: Identity, outcome: TrailOutcome, status: int, subject: str | None = None
) -> None:
    backend: Backend = of.state.backend
    action = asked.permission.action or "access"
    detail: dict[str, Any] = {"status": status, "address": asked.address}
    try:
        await run_in_threadpool(trail.record, backend, identity, action, subject or asked.path, outcome, **detail)
    except AWAY as error:
        log.error("the trail could not be written: %s %s %s: %s", identity.who, action, outcome, type(error).__name__)
