"""What every route is given: the services' backend, opened once a process."""

from datetime import datetime
from typing import Annotated, Any

from fastapi import Depends, Path, Query, Request
from pydantic import BeforeValidator

from app.services.access.identity import ANYONE, Identity, current
from app.services.backend import Backend
from app.services.cursors import LONGEST as LONGEST_CURSOR


async def opened(request: Request) -> Backend:
    return request.app.state.backend  # async: a plain function would cost each request a thread of its own


def caller() -> Identity:
    """Who makes the request that is being served, as the guard found."""
    return current.get() or ANYONE


def no_bare_number(value: Any) -> Any:
    """A number would be taken for seconds since 1970: 20240301 for a day in August 1970."""
    try:
        float(value)
    except (TypeError, ValueError):
        return value
    raise ValueError("a time is written in ISO 8601, such as 2024-03-01T12:00:00Z")


IsoTime = Annotated[datetime, BeforeValidator(no_bare_number)]
Services = Annotated[Backend, Depends(opened)]
Caller = Annotated[Identity, Depends(caller)]

CURSOR = "`next_cursor` of the page before; empty: the first page, so stop where it was null."
Limit = Annotated[int, Query(ge=1, le=1000, description="Rows a page.")]
Identifier = Annotated[str, Path(max_length=100, description="As it was answered by the request that made it.")]
Cursor = Annotated[str | None, Query(max_length=LONGEST_CURSOR, description=CURSOR)]
