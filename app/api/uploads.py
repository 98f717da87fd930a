"""Exports of a historian: received whole and stored before they are acknowledged, read by a worker afterwards."""

import asyncio
from collections.abc import AsyncIterator
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from fastapi.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile

from app.api.backend import Cursor, Limit, Services
from app.api.models import UploadOut, UploadPage
from app.api.problems import responses
from app.errors import RequestError
from app.services import uploads as service

BLOCK_BYTES = 1 << 20
NAMELESS = "upload.csv"
MULTIPART = "multipart/form-data"
BINARY = {"schema": {"type": "string", "format": "binary"}}
BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            "text/csv": BINARY,
            "application/gzip": BINARY,
            "application/octet-stream": BINARY,
            MULTIPART: {
                "schema": {
                    "type": "object",
                    "required": ["file"],
                    "properties": {"file": {"type": "string", "format": "binary"}},
                }
            },
        },
    }
}

router = APIRouter(tags=["uploads"])

Filename = Annotated[str | None, Query(max_length=255, description="Name of the file, for a raw body.")]


@router.post(
    "/uploads",
    status_code=202,
    response_model=UploadOut,
    openapi_extra=BODY,
    responses=responses(400, 408, 413, 415, 422, 507),
    summary="Send a historian export",
)
async def receive(request: Request, response: Response, backend: Services, filename: Filename = None) -> Any:
    """Takes an export as raw body, or as multipart `file`; gzip by content or by Content-Encoding.

    202 means that the bytes are stored. The same content again is the same upload.
    """
    refuse_encodings(request)
    try:
        async with asyncio.timeout(backend.settings.upload_timeout_s):
            receipt = await store(request, backend, filename)
    except TimeoutError:
        limit = backend.settings.upload_timeout_s
        raise RequestError("upload_timeout", f"the upload did not arrive within {limit:.0f} s") from None
    response.headers["Location"] = f"/v1/uploads/{receipt.upload.id}"
    return receipt.upload


@router.get("/uploads", response_model=UploadPage, responses=responses(400, 422), summary="The uploads, newest first")
def uploads(backend: Services, limit: Limit = 100, cursor: Cursor = None) -> Any:
    return service.list_uploads(backend, limit, cursor)


@router.get(
    "/uploads/{upload_id}", response_model=UploadOut, responses=responses(404), summary="What became of an upload"
)
def upload(backend: Services, upload_id: str) -> Any:
    return service.get_upload(backend, upload_id)


def refuse_encodings(request: Request) -> None:
    """gzip is told by the bytes themselves, so its header needs no handling; other encodings are not understood."""
    encoding = request.headers.get("content-encoding", "identity").strip().lower()
    if encoding not in ("gzip", "x-gzip", "identity", ""):
        raise RequestError("content_encoding", f"Content-Encoding {encoding[:40]!r} is not understood; gzip or none is")


async def store(request: Request, backend: Services, filename: str | None) -> service.Receipt:
    content_type = request.headers.get("content-type", "application/octet-stream")
    if not content_type.lower().startswith(MULTIPART):
        return await received(backend, filename or NAMELESS, content_type, request.stream())
    async with request.form(max_files=1, max_fields=10) as form:
        part = form.get("file")
        if not isinstance(part, UploadFile):
            raise RequestError("no_file", "the multipart form has no part `file` with a file in it")
        name = filename or part.filename or NAMELESS
        return await received(backend, name, part.content_type or content_type, blocks(part))


async def blocks(part: UploadFile) -> AsyncIterator[bytes]:
    while block := await part.read(BLOCK_BYTES):
        yield block


async def received(
    backend: Services, filename: str, content_type: str, chunks: AsyncIterator[bytes]
) -> service.Receipt:
    """Writes what arrives in blocks, away from the event loop: other requests go on while a disk is slow."""
    receiving = service.receive(backend, filename=filename, content_type=content_type)
    with receiving:
        buffer = bytearray()
        async for chunk in chunks:
            buffer += chunk
            if len(buffer) >= BLOCK_BYTES:
                await run_in_threadpool(receiving.write, bytes(buffer))
                buffer.clear()
        await run_in_threadpool(receiving.write, bytes(buffer))
        return await run_in_threadpool(receiving.commit)
