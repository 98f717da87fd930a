"""What every route is given: the services' backend, opened once a process."""

from typing import Annotated

from fastapi import Depends, Path, Query, Request

from app.services.backend import Backend


async def opened(request: Request) -> Backend:
    return request.app.state.backend  # async: a plain function would cost each request a thread of its own


Services = Annotated[Backend, Depends(opened)]

Limit = Annotated[int, Query(ge=1, le=1000, description="Rows a page.")]
Identifier = Annotated[str, Path(max_length=100, description="As it was answered by the request that made it.")]
Cursor = Annotated[str | None, Query(max_length=2000, description="`next_cursor` of the page before.")]
