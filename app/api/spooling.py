"""Multipart forms whose files are spooled where the disk is watched, not in the system's folder of temporary files."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from tempfile import SpooledTemporaryFile

from starlette.datastructures import FormData, UploadFile
from starlette.exceptions import HTTPException
from starlette.formparsers import MultiPartException, MultiPartParser
from starlette.requests import Request


class SpoolingParser(MultiPartParser):
    """Starlette's parser, which leaves no choice of the folder. The files have no name there: nothing is left of them
    when the process ends."""

    folder: Path

    def on_headers_finished(self) -> None:
        super().on_headers_finished()
        part = self._current_part
        if part.file is None:
            return
        self._files_to_close_on_error.pop().close()
        file = SpooledTemporaryFile(  # noqa: SIM115 - closed with the form, or where the form breaks off
            max_size=self.spool_max_size, dir=str(self.folder)
        )
        self._files_to_close_on_error.append(file)
        told = part.file
        part.file = UploadFile(file, size=0, filename=told.filename, headers=told.headers)  # type: ignore[arg-type]  # as Starlette


@asynccontextmanager
async def spooled(request: Request, folder: Path, *, max_files: int, max_fields: int) -> AsyncIterator[FormData]:
    """The request's form; its files are spooled into the folder. Raises HTTPException 400 where it is no form."""
    parser = SpoolingParser(request.headers, request.stream(), max_files=max_files, max_fields=max_fields)
    parser.folder = folder
    try:
        form = await parser.parse()
    except MultiPartException as error:
        raise HTTPException(400, error.message) from error
    try:
        yield form
    finally:
        await form.close()
