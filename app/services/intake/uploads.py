"""Uploads: stored and synced before they are acknowledged, the same content once: under another name too, unless that
says what the content does not."""

import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from sqlalchemy import Connection

from app.errors import NotFoundError, RequestError
from app.folders import sync_folder
from app.ingest import TagMapping, mapping_text, stem_of, takes_its_name, without_controls
from app.services.backend import Backend
from app.services.cursors import decode, identifier, page_of
from app.services.intake import places
from app.services.intake.drafts import new_draft
from app.services.intake.places import Correction
from app.services.intake.synced import SyncedFile
from app.services.moments import iso_utc
from app.services.outward import RejectOut, UploadOut
from app.services.results import Page, Receipt
from app.settings import Settings
from app.storage import lost, uploads
from app.storage.types import storable
from app.storage.uploads import UploadRow

COPY_BYTES = 1 << 20
LONGEST_NAME = 255
NAMELESS_DIGITS = 12
STORED = re.compile("[0-9a-f]{64}")


@dataclass(frozen=True)
class ReadingOptions:
    """How an export is to be read: `mapping` is a plant's tag mapping (CSV or JSON), `time_zone` an IANA name,
    `date_order` (day, month) what stands first in dates that do not tell."""

    time_zone: str | None = None
    mapping: bytes | None = None
    date_order: str | None = None

    def as_json(self) -> str:
        mapping = None if self.mapping is None else mapping_text(self.mapping)
        order = {} if self.date_order is None else {"date_order": self.date_order}
        return json.dumps({"time_zone": self.time_zone, "mapping": mapping, **order}, sort_keys=True)

    def check(self) -> None:
        """Raises LoopauditError where the options cannot be used, before the file is taken."""
        if self.mapping is not None:
            TagMapping.from_bytes(self.mapping)
        if self.time_zone is not None:
            try:
                ZoneInfo(self.time_zone)
            except (ZoneInfoNotFoundError, ValueError, OSError) as error:
                raise RequestError("unknown_time_zone", f"{self.time_zone!r} is no IANA time zone") from error


class Receiving:
    """An upload that is coming in: `write` its bytes, then `commit`. Left without commit, nothing remains of it."""

    def __init__(self, backend: Backend, values: dict[str, Any]) -> None:
        self._backend = backend
        self._values = values
        self._draft = new_draft(backend.settings)
        self._file = SyncedFile(self._draft)

    def write(self, data: bytes) -> None:
        """Raises RequestError("upload_too_large") beyond the limit of the settings."""
        most = self._backend.settings.max_upload_bytes
        if self._file.size + len(data) > most:
            raise RequestError("upload_too_large", f"an upload may have at most {most:,} bytes; send it in parts")
        self._file.write(data)

    def take(self, file: IO[bytes]) -> None:
        """Writes the rest of a file."""
        while part := file.read(COPY_BYTES):
            self.write(part)

    def commit(self, correction: Correction | None = None) -> Receipt:
        """Bytes and row are on disk when this returns, and so is the correction that came with it, or none of them.
        Raises RequestError("empty_upload") without any bytes."""
        if self._file.size == 0:
            raise RequestError("empty_upload", "the upload has no bytes")
        of_bytes = self._file.sync()
        fingerprints = [of_bytes] if self._file.content is None else [self._file.content, of_bytes]
        named: bool | None = None
        while (registered := self._register(fingerprints, named, correction)) is None:
            named = self._takes_its_name()
        receipt, unread = registered
        if not unread and (again := _read_anew(self._backend, receipt.upload)):
            receipt, unread = Receipt(again, receipt.created), True
        if unread:
            self._backend.queue.read_upload(int(receipt.upload.id))
        return receipt

    def _register(
        self, fingerprints: list[str], named: bool | None, correction: Correction | None
    ) -> tuple[Receipt, bool] | None:
        """What is answered, and whether it is to be read. fingerprints: of the content, then those by which it may be
        known from earlier. named: whether the name belongs to the content; where that has to be known and is not
        (None), nothing is done."""
        with self._backend.database.write() as connection:
            if correction is not None:
                places.lock(connection)
            for fingerprint in sorted(fingerprints):
                uploads.lock_bytes(connection, fingerprint)  # retention may be about to drop old bytes of that name
            values = self._named(connection, fingerprints, named)
            if values is None:
                return None
            self._keep(values["fingerprint"])
            row, created = uploads.receive(connection, values)
            again = uploads.try_again(connection, row.id) or uploads.seen_again(connection, [row.id])
            if correction is not None:
                correction.keep(connection)
            return Receipt(_whole(connection, str(row.id)), created), created or again

    def _named(self, connection: Connection, fingerprints: list[str], named: bool | None) -> dict[str, Any] | None:
        """The values of its row: as what it is known, or by its name; None where `named` has to be known."""
        reading_json = self._values["reading_json"]
        known = {it: uploads.keys_of(connection, it, reading_json) for it in fingerprints}
        fingerprint = next((it for it in fingerprints if known[it]), fingerprints[0])
        name = self._values["filename"] or f"upload-{fingerprint[:NAMELESS_DIGITS]}"
        key, keys = _content_key(fingerprint, reading_json, name), known[fingerprint]
        if keys and key not in keys and self._values["filename"]:
            if named is None:
                return None
            key = key if named else keys[0]
        elif keys and key not in keys:
            key = keys[0]  # without a name nothing says that it is of another loop
        own = {"filename": name, "fingerprint": fingerprint, "size_bytes": self._file.size, "content_key": key}
        return {**self._values, **own}

    def _takes_its_name(self) -> bool:
        mapping = json.loads(self._values["reading_json"]).get("mapping")
        return takes_its_name(self._draft, mapping and TagMapping.from_bytes(mapping.encode()))

    def _keep(self, fingerprint: str) -> None:
        self._draft.rename(path_of(self._backend, fingerprint))
        sync_folder(self._backend.settings.uploads_dir)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        try:
            self._file.close()  # which writes what is left, and may find the disk full
        except OSError:
            if error is None:
                raise
        finally:
            self._draft.unlink(missing_ok=True)


def _read_anew(backend: Backend, upload: UploadOut) -> UploadOut | None:
    """The upload, to be read again because what it brought was dropped or cannot be read; None: it is all there."""
    if upload.state != "done" or not (upload.samples_added or upload.samples_replaced):
        return None
    id_ = int(upload.id)
    with backend.database.read() as connection:
        gone = not lost.has_stretches(connection, id_)
        damaged = lost.damaged_of(connection, id_)
    if not gone and not damaged:
        return None
    with backend.database.write() as connection:
        if not uploads.read_anew(connection, id_):
            return None
        lost.drop_stretches(connection, damaged)
        return _whole(connection, upload.id)


def receive(
    backend: Backend,
    *,
    filename: str | None = None,
    content_type: str | None = None,
    reading: ReadingOptions | None = None,
    received_by: str | None = None,
) -> Receiving:
    """Begins an upload; `filename` names the loop, or the one tag, of a file that names none itself. Without a name it
    is called by its content, so that two of them are never taken for one loop.
    """
    reading = reading or ReadingOptions()
    reading.check()
    values = {
        "filename": _name(filename or ""),
        "content_type": None if content_type is None else storable(content_type),
        "reading_json": reading.as_json(),
        "received_by": received_by,
    }
    return Receiving(backend, values)


def _name(given: str) -> str:
    """The name without its folder; empty where nothing but dots, blanks and the suffix of an export would be left."""
    told = without_controls(given.replace("\\", "/").replace("\x00", ""))
    name = Path(storable(told)).name[-LONGEST_NAME:]
    return name if stem_of(f"x{name}")[1:].strip(". ") else ""


def receive_file(backend: Backend, path: Path) -> Receipt:
    with receive(backend, filename=path.name) as receiving, path.open("rb") as file:
        receiving.take(file)
        return receiving.commit()


def read_again(
    backend: Backend, upload_id: str, mapping: bytes, received_by: str | None = None, keep: bool = False
) -> Receipt:
    """The bytes of an upload once more, with its tags mapped as `mapping` (CSV or JSON) says, and others as it was sent
    with: an upload of its own. keep: whether what `mapping` says holds for later files too."""
    with backend.database.read() as connection:
        row = uploads.by_id(connection, identifier(upload_id))
        if row is None:
            raise NotFoundError("unknown_upload", f"there is no upload {upload_id!r}")
        told = uploads.reading_of(connection, row.id)
    path = path_of(backend, row.fingerprint)
    if not path.is_file():
        raise NotFoundError("bytes_gone", "the file of this upload is no longer kept; send it again with its mapping")
    reading = ReadingOptions(told.get("time_zone"), _over(mapping, told.get("mapping")), told.get("date_order"))
    with receive(backend, filename=row.filename, reading=reading, received_by=received_by) as receiving:
        with path.open("rb") as file:
            receiving.take(file)
        return receiving.commit(Correction(mapping, row.filename, received_by or "") if keep else None)


def _over(mapping: bytes, earlier: str | None) -> bytes:
    """Raises DataError("bad_mapping")."""
    if earlier is None:
        return mapping
    return TagMapping.from_bytes(mapping).over(TagMapping.from_bytes(earlier.encode())).as_bytes()


def loops_in_service(backend: Backend, upload: UploadOut) -> list[str]:
    """The loops of an upload without those that are retired."""
    with backend.database.read() as connection:
        gone = set(uploads.retired_of(connection, int(upload.id)))
    return [tag for tag in upload.loops if tag not in gone]


def audited_since(backend: Backend, upload: UploadOut) -> dict[str, int]:
    """Of how many of its loops in service the newest verdict is one of after it was read, by run, the newest first."""
    with backend.database.read() as connection:
        return {str(run): count for run, count in uploads.audited_since(connection, int(upload.id)).items()}


def get_upload(backend: Backend, upload_id: str) -> UploadOut:
    with backend.database.read() as connection:
        return _whole(connection, upload_id)


def list_uploads(backend: Backend, limit: int = 100, cursor: str | None = None) -> Page[UploadOut]:
    """Uploads, the newest first, without their loops, refused rows and tags, which are counted."""
    before = decode(cursor, (int,))
    with backend.database.read() as connection:
        rows = uploads.page(connection, limit + 1, before[0] if before else None)
        counted = uploads.count_loops(connection, [row.id for row in rows])
    return page_of(rows, limit, lambda row: _view(row, counted.get(row.id, 0)), lambda row: (row.id,))


def _whole(connection: Connection, upload_id: str) -> UploadOut:
    row = uploads.by_id(connection, identifier(upload_id))
    if row is None:
        raise NotFoundError("unknown_upload", f"there is no upload {upload_id!r}")
    found = uploads.loops_of(connection, row.id)
    refused = [RejectOut(**vars(reject)) for reject in uploads.rejects_of(connection, row.id)]
    return replace(_view(row, len(found)), loops=found, rejects=refused, tags=uploads.tags_of(connection, row.id))


def path_of(backend: Backend, fingerprint: str) -> Path:
    return backend.settings.uploads_dir / fingerprint


def is_seen(backend: Backend, fingerprint: str) -> bool:
    """Whether the file can be seen from here: not on a share that answers with an error (a stale handle), nor in a
    folder that another user may not look into."""
    try:
        return path_of(backend, fingerprint).is_file()
    except OSError:
        return False


def stored_files(settings: Settings) -> Iterator[Path]:
    """The exports that are kept, by name. What else lies in their folder (lost+found, somebody's old ones) is no
    upload's, and is left alone. Raises RequestError where the folder cannot be looked into: nothing is known of them.
    """
    try:
        there = sorted(settings.uploads_dir.iterdir())
    except OSError as error:
        text = f"{settings.uploads_dir} cannot be looked into: {error.strerror}; the exports belong there"
        raise RequestError("no_exports_folder", text) from error
    return (file for file in there if STORED.fullmatch(file.name) and file.is_file())


def _content_key(fingerprint: str, reading_json: str, filename: str) -> str:
    """The name is part of it, because it is the tag where the content names none: FIC201.SP.csv may have the bytes of
    FIC202.SP.csv. Content that names its tags keeps the key of the name under which it came first."""
    return hashlib.sha256(f"{fingerprint} {reading_json} {stem_of(filename)}".encode()).hexdigest()


def _view(row: UploadRow, loops_found: int) -> UploadOut:
    summary = row.summary
    return UploadOut(
        id=str(row.id),
        state=row.state,  # type: ignore[arg-type]  # the table allows no other
        filename=row.filename,
        size_bytes=row.size_bytes,
        fingerprint=row.fingerprint,
        received_at=iso_utc(row.received_at) or "",
        sent_again_at=iso_utc(row.sent_again_at),
        ended_at=iso_utc(row.ended_at),
        reason=row.error_text,
        error_code=row.error_code,
        waits_for_room_since=iso_utc(row.waits_since) if row.state == "received" else None,
        waits_for_file_since=iso_utc(row.unseen_since) if row.state in ("received", "reading") else None,
        layout=summary.get("layout"),
        loops=[],
        loops_found=loops_found,
        rows_kept=summary.get("rows_kept", 0),
        rows_refused=sum(summary.get("reject_counts", {}).values()),
        samples_added=summary.get("samples_added", 0),
        samples_replaced=summary.get("samples_replaced", 0),
        reject_counts=summary.get("reject_counts", {}),
        rejects=[],
        notes=summary.get("notes", []),
        tags_found=summary.get("tags_found", 0),
        times_from=summary.get("times_from"),
        times_to=summary.get("times_to"),
        time_zone=summary.get("time_zone"),
        damaged=summary.get("damaged", False),
    )
