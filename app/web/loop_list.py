"""The loop list: what a spreadsheet knows of the plant's loops, set in one go."""

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import HTMLResponse
from starlette.datastructures import UploadFile

from app.errors import RequestError
from app.http.backend import Services
from app.http.spooling import spooled
from app.services.backend import Backend
from app.services.outward import LoopsChangedOut
from app.services.stating.loop_list import COLUMNS, MOST_LOOPS, read, take
from app.web.rendering import page

SHOWN = 200
FIELDS = 10

router = APIRouter()


@router.get("/loop-list")
def loop_list(backend: Services) -> HTMLResponse:
    return shown(backend)


@router.post("/loop-list")
async def taken(request: Request, backend: Services) -> HTMLResponse:
    folder = backend.settings.uploads_dir
    async with spooled(request, folder, max_files=1, max_fields=FIELDS, like_files=()) as form:
        file = form.get("file")
        if not isinstance(file, UploadFile):
            raise RequestError("no_file", "the form has no part `file` with the loop list in it")
        listed = await file.read()
    done = await run_in_threadpool(lambda: take(backend, read(listed)))
    return shown(backend, done, file.filename)


def shown(backend: Backend, done: LoopsChangedOut | None = None, filename: str | None = None) -> HTMLResponse:
    told = {"done": done, "filename": filename, "shown": SHOWN}
    return page("loop_list.html", backend.clock, columns=COLUMNS, most=MOST_LOOPS, **told)
