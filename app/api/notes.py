"""What people write about a loop: notes, work orders, repairs, shelvings, and what of it is withdrawn."""

from typing import Any

from fastapi import APIRouter, Depends

from app.api.models import NoteIn, NotePage
from app.http.backend import Caller, Cursor, Identifier, Limit, Services
from app.http.parameters import json_alone
from app.http.paths import LoopTag
from app.http.problems import responses
from app.services.outward import NoteOut
from app.services.stating import notes as service

router = APIRouter(tags=["notes"])


@router.get(
    "/loops/{tag:path}/notes", response_model=NotePage, responses=responses(400, 404, 422), summary="A loop's notes"
)
def notes(backend: Services, tag: LoopTag, limit: Limit = 100, cursor: Cursor = None) -> Any:
    return service.note_page(backend, tag, limit, cursor)


@router.post(
    "/loops/{tag:path}/notes",
    status_code=201,
    response_model=NoteOut,
    responses=responses(400, 404, 415, 422),
    dependencies=[Depends(json_alone)],
    summary="Write a note, a work order or a repair, or shelve the loop",
)
def write(backend: Services, caller: Caller, tag: LoopTag, said: NoteIn) -> Any:
    written = (said.text, said.work_order, said.repaired_at, caller.who, said.shelved_until)
    return service.add_note(backend, tag, *written)


@router.delete(
    "/loops/{tag:path}/notes/{note_id}/repair",
    response_model=NoteOut,
    responses=responses(404),
    summary="Withdraw a repair",
)
def withdraw(backend: Services, caller: Caller, tag: LoopTag, note_id: Identifier) -> Any:
    """The repair that this note states counts no longer; the note stays and says who withdrew it."""
    return service.withdraw_repair(backend, tag, note_id, caller.who)


@router.delete(
    "/loops/{tag:path}/notes/{note_id}/shelving",
    response_model=NoteOut,
    responses=responses(404),
    summary="End a shelving",
)
def unshelve(backend: Services, caller: Caller, tag: LoopTag, note_id: Identifier) -> Any:
    """The loop is shelved no longer, by this note or one before it; the note stays and says who ended it."""
    return service.end_shelving(backend, tag, note_id, caller.who)
