"""Multipart forms whose files are spooled where the disk is watched, not in the system's folder of temporary files."""

from collections.abc import AsyncIterator, Collection
from contextlib import asynccontextmanager
from pathlib import Path
from tempfile import SpooledTemporaryFile

from starlette.datastructures import FormData, UploadFile
from starlette.exceptions import HTTPException
from starlette.formparsers import MultiPartException, MultiPartParser
from starlette.requests import Request

FORM_OVERHEAD_BYTES = 1 << 20
"""What a form may have beside that which it is sent for."""


class SpoolingParser(MultiPartParser):
    """Starlette's parser, which leaves no choice of the folder. The files have no name there: nothing is left of them
    when the process ends. Fields of `like_files` are spooled too, whether they come as files or as texts: Starlette
    keeps texts in memory, and refuses the long ones."""

    folder: Path
    like_files: Collection[str] = ()

    @property
    def begun(self) -> list[SpooledTemporaryFile[bytes]]:
        """All files, one that the end of the body cut off among them: that is in no form."""
        return self._files_to_close_on_error

    def on_headers_finished(self) -> None:
        super().on_headers_finished()
        part = self._current_part
        told = part.file
        if told is not None:
            self._files_to_close_on_error.pop().close()
        elif part.field_name not in self.like_files:
            return
        file = SpooledTemporaryFile(  # noqa: SIM115 - closed with the form, or where the form breaks off
            max_size=self.spool_max_size, dir=str(self.folder)
        )
        self._files_to_close_on_error.append(file)
        filename, headers = (told.filename, told.headers) if told else (None, None)
        part.file = UploadFile(file, size=0, filename=filename, headers=headers)  # type: ignore[arg-type]  # as Starlette


@asynccontextmanager
async def spooled(
    request: Request, folder: Path, *, max_files: int, max_fields: int, like_files: Collection[str]
) -> AsyncIterator[FormData]:
    """The request's form; its files are spooled into the folder. Raises HTTPException 400 where it is no form."""
    if "content-type" not in request.headers:
        raise HTTPException(400, "the body is no multipart form, and no content type says what it is")
    parser = SpoolingParser(request.headers, request.stream(), max_files=max_files, max_fields=max_fields)
    parser.folder, parser.like_files = folder, like_files
    try:
        form = await parser.parse()
    except MultiPartException as error:
        raise HTTPException(400, error.message) from error
    try:
        yield form
    finally:
        await form.close()
        for file in parser.begun:
            file.close()
