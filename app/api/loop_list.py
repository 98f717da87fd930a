"""Many loops changed in one request, as JSON or as the list that a spreadsheet has."""

from typing import Any

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from pydantic import ValidationError

from app.api.models import LoopPatch
from app.errors import DataError, RequestError, in_our_words
from app.http.backend import Services
from app.http.problems import responses
from app.json_texts import given_json
from app.services.backend import Backend
from app.services.outward import LoopsChangedOut
from app.services.stating import loop_list
from app.services.stating.loop_list import LoopList
from app.services.stating.properties import refusal

router = APIRouter(tags=["loops"])

CSV, JSON = "text/csv", "application/json"
LOOP = LoopPatch.model_json_schema()
LINE = LOOP | {"required": ["tag"], "properties": {"tag": {"type": "string"}, **LOOP["properties"]}}
LIST = {"type": "object", "required": ["loops"], "properties": {"loops": {"type": "array", "items": LINE}}}
BODY = {
    "requestBody": {"required": True, "content": {JSON: {"schema": LIST}, CSV: {"schema": {"type": "string"}}}},
}


@router.patch(
    "/loops",
    response_model=LoopsChangedOut,
    openapi_extra=BODY,
    responses=responses(413, 415, 422),
    summary="Say more about many loops",
)
async def change_many(request: Request, backend: Services) -> Any:
    """Each loop is for itself: what cannot be set of one is refused with its code, and the others are changed.

    As JSON `{"loops": [{"tag": ..., ...}]}`, where null forgets; or as CSV with the column `tag` (or `loop`) and those
    to set, where an empty cell leaves things as they are (`GET /v1/loops?format=csv` answers such a list). At most
    20,000 loops.
    """
    kind = request.headers.get("content-type", JSON).split(";")[0].strip().lower()
    body = await request.body()
    async with request.app.state.mapping_places:  # taken apart it has many times its size, as a mapping
        return await run_in_threadpool(_taken, backend, body, kind)


def _taken(backend: Backend, body: bytes, kind: str) -> LoopsChangedOut:
    if kind not in READ:
        raise RequestError("media_type", f"a list of loops comes as {JSON} or {CSV}, not as {kind[:60]!r}")
    return loop_list.take(backend, READ[kind](body))


def _from_json(body: bytes) -> LoopList:
    try:
        sent = given_json(body)
    except (ValueError, RecursionError) as error:
        raise DataError("bad_loop_list", f"the loop list is not JSON: {error}") from error
    lines = sent.get("loops") if isinstance(sent, dict) else None
    if not isinstance(lines, list) or not all(isinstance(line, dict) for line in lines):
        raise DataError("bad_loop_list", "the loop list is an object with `loops`, a list of objects that have a tag")
    found = LoopList([], [], [])
    for line in lines:
        tag = line.pop("tag", None)
        if not isinstance(tag, str):
            found.refused.append(refusal(str(tag)[:60], "no_tag", "a loop of the list has no tag that is a text"))
            continue
        try:
            found.wanted.append((tag, LoopPatch.model_validate(line).model_dump(exclude_unset=True)))
        except ValidationError as error:
            found.refused.append(refusal(tag, "bad_value", _told(error)))
    return found


def _told(error: ValidationError) -> str:
    return "; ".join(f"{'.'.join(map(str, item['loc']))}: {in_our_words(item['msg'])}" for item in error.errors()[:3])


READ = {JSON: _from_json, CSV: loop_list.read}
