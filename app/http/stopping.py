"""The answer to what is still under way when the server, told to stop, waits no longer."""

import asyncio
import logging

from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.http.problems import LONGEST_ECHO, stopped

PARTING_S = 5.0

log = logging.getLogger("loopaudit.api")


class AnswerWhenStopped:
    """uvicorn would call it a fault of the program, in an answer that says no more and with a traceback in the log."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        answered, under_way = False, scope["app"].state.under_way
        under_way.add(task := asyncio.current_task())

        async def noticed(message: Message) -> None:
            nonlocal answered
            answered = True
            await send(message)

        try:
            await self.app(scope, receive, noticed)
        except asyncio.CancelledError:
            log.warning("%s %s was not done when the service stopped", scope["method"], scope["path"][:LONGEST_ECHO])
            if not answered:  # else the connection is closed within the answer, which tells it
                await stopped(Request(scope))(scope, receive, send)
        finally:
            under_way.discard(task)


async def all_told(under_way: set[asyncio.Task[None]]) -> None:
    """What is answered and noted of them needs what closes with the service."""
    if under_way:
        await asyncio.wait(under_way, timeout=PARTING_S)
