"""Exports of the historian: dropped into the page, what was understood, what was refused, and tags mapped by hand."""

from typing import Annotated

from fastapi import APIRouter, Form, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import HTMLResponse
from starlette.responses import RedirectResponse

from app.api.backend import Caller, Identifier, Services
from app.api.uploads import store
from app.services.intake import uploads as service
from app.web.rendering import page

SHOWN = 50
LONGEST_MAPPING = 8 << 20

router = APIRouter()


@router.get("/uploads")
def uploads(backend: Services, cursor: str = "") -> HTMLResponse:
    return page("uploads.html", backend.clock, found=service.list_uploads(backend, SHOWN, cursor or None))


@router.post("/uploads")
async def receive(request: Request, backend: Services) -> RedirectResponse:
    """For browsers without scripts; with them the page sends the file to the API and shows how far it is."""
    receipt = await store(request, backend, None, service.ReadingOptions())
    return RedirectResponse(f"/uploads/{receipt.upload.id}", 303)


@router.get("/uploads/{upload_id}")
def upload(backend: Services, upload_id: Identifier) -> HTMLResponse:
    return page("upload.html", backend.clock, upload=service.get_upload(backend, upload_id))


@router.post("/uploads/{upload_id}/mapping")
async def read_again(
    request: Request,
    backend: Services,
    caller: Caller,
    upload_id: Identifier,
    mapping: Annotated[str, Form(max_length=LONGEST_MAPPING)],
) -> RedirectResponse:
    async with request.app.state.mapping_places:
        receipt = await run_in_threadpool(service.read_again, backend, upload_id, mapping.encode(), caller.who)
    return RedirectResponse(f"/uploads/{receipt.upload.id}", 303)
