"""Exports of the historian: dropped into the page, what was understood, what was refused, tags mapped by hand,
and the audit of what came."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Form, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse
from starlette.datastructures import FormData
from starlette.responses import RedirectResponse, Response

from app.errors import DataError, NotFoundError, RequestError
from app.http.backend import Caller, Identifier, Services
from app.http.problems import status_of
from app.http.receiving import LARGEST_MAPPING, MULTIPART, is_empty, mapping_of, store
from app.http.spooling import FORM_OVERHEAD_BYTES, spooled
from app.services.auditing.audits import LoopFilter, start_audit
from app.services.backend import Backend
from app.services.data_folder import folder_state
from app.services.intake import places
from app.services.intake import uploads as service
from app.web.rendering import page

SHOWN = 50
SHOWN_TAGS, SHOWN_REJECTS = 600, 300
FIELDS = 10


@dataclass(frozen=True)
class TypedMapping:
    """What stands in the form of a mapping, and why it was not taken."""

    mapping: str = "tag,loop,signal\n"
    keep: bool = True
    refused: str | None = None


NO_MAPPING_TYPED = TypedMapping()

router = APIRouter()


@router.get("/uploads")
def uploads(backend: Services, cursor: str = "") -> HTMLResponse:
    found = service.list_uploads(backend, SHOWN, cursor or None)
    return page("uploads.html", backend.clock, found=found, kept=[] if cursor else places.kept_by_loop(backend))


@router.post("/uploads")
async def receive(request: Request, backend: Services) -> RedirectResponse:
    """For browsers without scripts; with them the page sends the file to the API and shows how far it is."""
    receipt = await store(request, backend, None, service.ReadingOptions())
    return RedirectResponse(f"/uploads/{receipt.upload.id}", 303)


@router.get("/uploads/{upload_id}")
def upload(backend: Services, upload_id: Identifier) -> HTMLResponse:
    return _upload_page(backend, upload_id)


def _upload_page(backend: Backend, upload_id: str, typed: TypedMapping = NO_MAPPING_TYPED) -> HTMLResponse:
    found = service.get_upload(backend, upload_id)
    in_service = service.loops_in_service(backend, found)
    audited = service.audited_since(backend, found)
    waits = found.state == "received" and folder_state(backend.settings) != "ok"
    told = {"upload": found, "in_service": in_service, "audited": audited, "typed": typed, "waits_for_folder": waits}
    return page("upload.html", backend.clock, shown_tags=SHOWN_TAGS, shown_rejects=SHOWN_REJECTS, **told)


@router.post("/uploads/{upload_id}/mapping")
async def read_again(request: Request, backend: Services, caller: Caller, upload_id: Identifier) -> Response:
    async with mapping_form(request, backend) as form, request.app.state.mapping_places:
        given = form.get("mapping")
        if given is None or is_empty(given):
            raise RequestValidationError([{"loc": ("body", "mapping"), "msg": "Field required"}])
        mapping = await mapping_of(given)
        keep = bool(form.get("keep"))
        try:
            receipt = await run_in_threadpool(service.read_again, backend, upload_id, mapping, caller.who, keep)
        except (DataError, RequestError) as error:
            if isinstance(error, NotFoundError):
                raise
            typed = TypedMapping(mapping.decode("utf-8", "replace"), keep, error.message)
            page_again = await run_in_threadpool(_upload_page, backend, upload_id, typed)
            page_again.status_code = status_of(error)
            return page_again
    return RedirectResponse(f"/uploads/{receipt.upload.id}", 303)


@router.post("/uploads/kept/forget")
def forget(
    backend: Services, loop: Annotated[str, Form(max_length=1000)], file: Annotated[str, Form(max_length=1000)] = ""
) -> RedirectResponse:
    places.forget(backend, file, loop)
    return RedirectResponse("/uploads", 303)


@router.post("/uploads/{upload_id}/audit")
def audit_its_loops(backend: Services, caller: Caller, upload_id: Identifier) -> RedirectResponse:
    wanted = LoopFilter(tags=tuple(service.loops_in_service(backend, service.get_upload(backend, upload_id))))
    run = start_audit(backend, wanted, trigger="request", started_by=caller.who)
    return RedirectResponse(f"/runs/{run.id}", 303)


@asynccontextmanager
async def mapping_form(request: Request, backend: Services) -> AsyncIterator[FormData]:
    """As our page sends it, which is multipart because a mapping gets no longer by that, or as any other form."""
    if request.headers.get("content-type", "").lower().startswith(MULTIPART):
        folder = backend.settings.uploads_dir
        async with spooled(request, folder, max_files=1, max_fields=FIELDS, like_files=("mapping",)) as form:
            yield form
        return
    longest = LARGEST_MAPPING + FORM_OVERHEAD_BYTES
    async with request.form(max_files=0, max_fields=FIELDS, max_part_size=longest) as form:
        yield form
