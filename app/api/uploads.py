"""Exports of a historian: received whole and stored before they are acknowledged, read by a worker afterwards."""

from collections.abc import AsyncIterator
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request, Response
from fastapi.concurrency import run_in_threadpool
from starlette.datastructures import FormData, UploadFile

from app.api.backend import Cursor, Identifier, Limit, Services, caller
from app.api.models import UploadOut, UploadPage
from app.api.problems import responses
from app.api.spooling import spooled
from app.errors import RequestError
from app.services.intake import uploads as service
from app.services.results import Receipt

BLOCK_BYTES = 1 << 20
LARGEST_MAPPING = 16 << 20  # 14,000 loops of four tags each: 5 MiB as CSV with every column, 11 MiB as JSON
MAPPINGS_AT_ONCE = 2  # taken apart, a mapping has up to twenty times its size
MULTIPART = "multipart/form-data"
PARTS = ("file", "mapping")
MOST_FILES = 8  # more than are taken, so that the refusal names the part that there is too often
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
                    "properties": {
                        "file": {"type": "string", "format": "binary"},
                        "mapping": {"type": "string", "format": "binary", "description": "Tags to loops, CSV or JSON."},
                    },
                }
            },
        },
    }
}

router = APIRouter(tags=["uploads"])


@dataclass(frozen=True)
class Description:
    """What a client says about an upload."""

    filename: str | None
    content_type: str | None
    reading: service.ReadingOptions


Filename = Annotated[
    str | None,
    Query(max_length=255, description="Name of the file, for a raw body: its loop's name where the content has none."),
]
DateOrder = Annotated[
    Literal["day", "month"] | None,
    Query(description="What stands first in dates such as 03/04/2026, where the file does not tell."),
]
TimeZone = Annotated[str | None, Query(max_length=60, description="Zone of time stamps that name none (IANA).")]


@router.post(
    "/uploads",
    status_code=202,
    response_model=UploadOut,
    openapi_extra=BODY,
    responses=responses(400, 408, 413, 415, 422, 507),
    summary="Send a historian export",
)
async def receive(
    request: Request,
    response: Response,
    backend: Services,
    filename: Filename = None,
    time_zone: TimeZone = None,
    date_order: DateOrder = None,
) -> Any:
    """Takes an export as raw body, or as multipart `file` (with the plant's tag `mapping`, where there is one).

    gzip is told by the content. 202 means that the bytes are stored.
    The same content again, read in the same way, is the same upload; under another name it is another one only where
    the file does not name its loops, which are called by its name then.
    """
    refuse_encodings(request)
    receipt = await store(request, backend, filename, service.ReadingOptions(time_zone, date_order=date_order))
    response.headers["Location"] = f"/v1/uploads/{receipt.upload.id}"
    return receipt.upload


@router.get("/uploads", response_model=UploadPage, responses=responses(400, 422), summary="The uploads, newest first")
def uploads(backend: Services, limit: Limit = 100, cursor: Cursor = None) -> Any:
    return service.list_uploads(backend, limit, cursor)


@router.get(
    "/uploads/{upload_id}", response_model=UploadOut, responses=responses(404), summary="What became of an upload"
)
def upload(backend: Services, upload_id: Identifier) -> Any:
    return service.get_upload(backend, upload_id)


def refuse_encodings(request: Request) -> None:
    """gzip is told by the bytes themselves, so its header needs no handling; other encodings are not understood."""
    encoding = request.headers.get("content-encoding", "identity").strip().lower()
    if encoding not in ("gzip", "x-gzip", "identity", ""):
        raise RequestError("content_encoding", f"Content-Encoding {encoding[:40]!r} is not understood; gzip or none is")


async def store(request: Request, backend: Services, filename: str | None, reading: service.ReadingOptions) -> Receipt:
    content_type = request.headers.get("content-type", "application/octet-stream")
    if not content_type.lower().startswith(MULTIPART):
        described = Description(filename, content_type, reading)
        return await received(backend, described, request.stream())
    async with spooled(
        request, backend.settings.uploads_dir, max_files=MOST_FILES, max_fields=10, like_files=("mapping",)
    ) as form:
        refuse_several(form)
        part, mapping = form.get("file"), form.get("mapping")
        if not isinstance(part, UploadFile):
            raise RequestError("no_file", "the multipart form has no part `file` with a file in it")
        name = filename or part.filename
        if mapping is None or is_empty(mapping):
            return await received(backend, Description(name, part.content_type, reading), blocks(part))
        async with request.app.state.mapping_places:
            mapped = replace(reading, mapping=await mapping_of(mapping))
            return await received(backend, Description(name, part.content_type, mapped), blocks(part))


def refuse_several(form: FormData) -> None:
    for name in PARTS:
        if len(form.getlist(name)) > 1:
            text = f"the multipart form has several parts `{name}`; an upload takes one: send each file by itself"
            raise RequestError("several_files", text)


def is_empty(part: UploadFile | str) -> bool:
    """Of a field that was left blank."""
    return not part if isinstance(part, str) else not (part.size or part.filename)


async def mapping_of(part: UploadFile | str) -> bytes:
    """Raises RequestError where it is larger than any plant's."""
    mapping = part.encode("utf-8", "replace") if isinstance(part, str) else await part.read(LARGEST_MAPPING + 1)
    if len(mapping) > LARGEST_MAPPING:
        text = f"a mapping may have at most {LARGEST_MAPPING} bytes; send the export in parts, each with its own"
        raise RequestError("mapping_too_large", text)
    return mapping


async def blocks(part: UploadFile) -> AsyncIterator[bytes]:
    while block := await part.read(BLOCK_BYTES):
        yield block


async def received(backend: Services, described: Description, chunks: AsyncIterator[bytes]) -> Receipt:
    """Writes what arrives in blocks, away from the event loop: other requests go on while a disk is slow or a
    mapping long."""
    who = caller().who
    with await run_in_threadpool(service.receive, backend, **vars(described), received_by=who) as receiving:
        buffer = bytearray()
        async for chunk in chunks:
            buffer += chunk
            if len(buffer) >= BLOCK_BYTES:
                await run_in_threadpool(receiving.write, bytes(buffer))
                buffer.clear()
        await run_in_threadpool(receiving.write, bytes(buffer))
        return await run_in_threadpool(receiving.commit)
