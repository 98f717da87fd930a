"""An export on its way in, as a raw body or as a multipart form: written in blocks as it arrives."""

import re
from collections.abc import AsyncIterator
from dataclasses import dataclass, replace
from typing import Annotated, Literal
from urllib.parse import unquote

from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from fastapi.exceptions import RequestValidationError
from pydantic import Field, TypeAdapter, ValidationError
from starlette.datastructures import FormData, UploadFile

from app.errors import RequestError
from app.http.backend import Services, caller
from app.http.spooling import spooled
from app.services.intake import uploads as service
from app.services.results import Receipt

BLOCK_BYTES = 1 << 20
LARGEST_MAPPING = 16 << 20  # 14,000 loops of four tags each: 5 MiB as CSV with every column, 11 MiB as JSON
MAPPINGS_AT_ONCE = 2  # taken apart, a mapping has up to twenty times its size
MULTIPART = "multipart/form-data"
PARTS = ("file", "mapping")
ZoneName = Annotated[str, Field(max_length=60)]
FirstOfDates = Literal["day", "month"]
FIELDS: dict[str, TypeAdapter[str]] = {
    "time_zone": TypeAdapter(Annotated[ZoneName, Field(pattern=r"^[^\x00]*$")]),  # as no query may have one
    "date_order": TypeAdapter(FirstOfDates),
}
"""What a form may say in place of the query, and what it has to be."""
NAMED = re.compile(r""";\s*filename\s*=\s*(?:"((?:[^"\\]|\\.)*)"|([^\s;"]+))""", re.IGNORECASE)
NAMED_IN_UTF8 = re.compile(r";\s*filename\*\s*=\s*utf-8'[^']*'([^\s;]+)", re.IGNORECASE)
MOST_FILES = 8  # more than are taken, so that the refusal names the part that there is too often


@dataclass(frozen=True)
class Description:
    """What a client says about an upload."""

    filename: str | None
    content_type: str | None
    reading: service.ReadingOptions


async def store(request: Request, backend: Services, filename: str | None, reading: service.ReadingOptions) -> Receipt:
    content_type = request.headers.get("content-type", "application/octet-stream")
    if not content_type.lower().startswith(MULTIPART):
        described = Description(filename or told_name(request), content_type, reading)
        return await received(backend, described, request.stream())
    async with spooled(
        request, backend.settings.uploads_dir, max_files=MOST_FILES, max_fields=10, like_files=("mapping",)
    ) as form:
        refuse_several(form)
        part, mapping = form.get("file"), form.get("mapping")
        if not isinstance(part, UploadFile):
            raise RequestError("no_file", "the multipart form has no part `file` with a file in it")
        name, reading = filename or part.filename, with_fields(reading, form)
        if mapping is None or is_empty(mapping):
            return await received(backend, Description(name, part.content_type, reading), blocks(part))
        async with request.app.state.mapping_places:
            mapped = replace(reading, mapping=await mapping_of(mapping))
            return await received(backend, Description(name, part.content_type, mapped), blocks(part))


def told_name(request: Request) -> str | None:
    """The file's name in the header of a raw body, RFC 6266: in UTF-8 where it has both."""
    told = request.headers.get("content-disposition", "")
    if found := NAMED_IN_UTF8.search(told):
        return unquote(found[1])
    found = NAMED.search(told)
    if found is None:
        return None
    name = found[2] or re.sub(r"\\(.)", r"\1", found[1])
    return name.encode("latin-1").decode("utf-8", "replace") if not name.isascii() else name


def refuse_several(form: FormData) -> None:
    for name in (*PARTS, *FIELDS):
        if len(form.getlist(name)) > 1:
            text = f"the multipart form has several parts `{name}`; an upload takes one: send each file by itself"
            raise RequestError("several_files", text)


def with_fields(reading: service.ReadingOptions, form: FormData) -> service.ReadingOptions:
    """With what the query leaves open as the form's fields say it: passed over, they would be read otherwise in
    silence. A field that was left blank says nothing."""
    told = vars(reading) | {name: in_field(form, name) for name in FIELDS if getattr(reading, name) is None}
    return service.ReadingOptions(**told)


def in_field(form: FormData, name: str) -> str | None:
    value = form.get(name)
    if value is None or is_empty(value):
        return None
    try:
        return FIELDS[name].validate_python(value)
    except ValidationError as wrong:
        raise RequestValidationError([{**one, "loc": ("body", name)} for one in wrong.errors()]) from wrong


def is_empty(part: UploadFile | str) -> bool:
    """Of a field that was left blank."""
    return not part if isinstance(part, str) else not (part.size or part.filename)


async def mapping_of(part: UploadFile | str) -> bytes:
    """Raises RequestError where it is larger than any plant's."""
    mapping = part.encode("utf-8", "replace") if isinstance(part, str) else await part.read(LARGEST_MAPPING + 1)
    if len(mapping) > LARGEST_MAPPING:
        text = f"a mapping may have at most {LARGEST_MAPPING:,} bytes; send the export in parts, each with its own"
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
