"""Exports of a historian: received whole and stored before they are acknowledged, read by a worker afterwards."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response

from app.api.models import UploadPage
from app.errors import RequestError
from app.http.backend import Cursor, Identifier, Limit, Services
from app.http.problems import responses
from app.http.receiving import MULTIPART, FirstOfDates, ZoneName, store
from app.services.intake import uploads as service
from app.services.outward import UploadOut

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
                        "time_zone": {"type": "string", "description": "As in the query, which counts before it."},
                        "date_order": {"enum": ["day", "month"], "description": "As in the query."},
                    },
                }
            },
        },
    }
}

router = APIRouter(tags=["uploads"])


Filename = Annotated[
    str | None,
    Query(
        max_length=255,
        description="Name of the file, for a raw body: its loop's name where the content has none. Without it the name "
        "in Content-Disposition is taken.",
    ),
]
DateOrder = Annotated[
    FirstOfDates | None,
    Query(description="What stands first in dates such as 03/04/2026, where the file leaves it open."),
]
TimeZone = Annotated[ZoneName | None, Query(description="Zone of time stamps that name none (IANA).")]


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
    The same content again, packed or not, read in the same way, is the same upload; under another name it is another
    one only where the file does not name its loops, which are called by its name then. Without a name content that is
    known is always the upload that it was.
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
