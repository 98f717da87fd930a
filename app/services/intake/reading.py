"""Reading an upload: from its bytes to loops and series, in bounded memory; done twice, it has the same effect."""

import errno
import json
import logging
import shutil
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

from app.counting import megabytes
from app.errors import DataError, LoopauditError
from app.ingest import (
    Export,
    FileSummary,
    IngestOptions,
    LoopSamples,
    LoopTags,
    MappedTag,
    NoRoomToPartError,
    Rejects,
    SetPoints,
    TagMapping,
    read_export,
)
from app.ingest import warm_up as warm_up_ingest
from app.services.backend import Backend
from app.services.data_folder import folder_away
from app.services.database_errors import DATABASE_AWAY, no_room
from app.services.heartbeat import Heartbeat
from app.services.intake.places import TagPlace, kept_notes, note_read, places_of, with_kept
from app.services.intake.uploads import is_seen, path_of
from app.services.moments import FIRST_DATED, iso_utc, moment_of, ns_of
from app.services.patience import patiently
from app.services.telling.exchanged_tags import exchanged_tags
from app.services.telling.naming import named, without_commands
from app.storage import loops, receipts, series, uploads
from app.storage.samples import Samples, prepare
from app.storage.series import Place, Stretch
from app.storage.uploads import ReadingClaim, RejectRow, UploadRow

FILE_UNSEEN = "file_unseen"
BATCH_LOOPS = 200
BATCHES_AHEAD = 2  # read, but not yet written
LISTED_LOOPS = 20_000
BATCH_VALUES = 2_000_000
FAULTS_IN_ALL = 3
"""Attempts after which a fault of ours is told: it would most likely be the same at the tenth, an hour later."""

log = logging.getLogger("loopaudit.intake")

Attributes = dict[str, dict[str, Any]]
"""What a mapping says of loops, by casefolded tag."""


@dataclass(frozen=True)
class Prepared:
    """Samples of a loop with all that can be made of them before the database is asked."""

    loop: str
    samples: Samples


class ClaimLostError(Exception):
    """Another worker has the upload now; whatever it does stands."""


@dataclass(frozen=True)
class Read:
    """What reading a file came to. places: where its tags belong."""

    summary: dict[str, Any]
    tags: list[dict[str, Any]]
    rejects: Rejects
    places: list[TagPlace]


def warm_up() -> None:
    """Compiles or loads the kernels that read files."""
    warm_up_ingest()


def read_upload(backend: Backend, upload_id: int, owner: str) -> None:
    """Reads the upload if it is still to be read, nobody else reads it, and its file can be seen from here."""
    with backend.database.read() as connection:
        row = uploads.by_id(connection, upload_id)
    if row is None:
        return
    if not is_seen(backend, row.fingerprint):
        _tell_unseen(backend, row)
        return
    with backend.database.write() as connection:
        most = backend.settings.max_reading_attempts
        claim = uploads.claim(connection, upload_id, owner, backend.settings.lease_s, most)
    if claim is not None:
        _read_claimed(backend, row, claim)


def _tell_unseen(backend: Backend, row: UploadRow) -> None:
    """Another worker may see it, so that it is not claimed."""
    settings = backend.settings
    with backend.database.write() as connection:
        waits = uploads.note_unseen(connection, row.id, settings.stalled_s, settings.lease_s)
    if waits:
        text = "upload %d waits: this worker does not see its file %s; all need the same LOOPAUDIT_DATA_DIR"
        log.warning(text, row.id, path_of(backend, row.fingerprint), extra={"code": FILE_UNSEEN})


def _read_claimed(backend: Backend, row: UploadRow, claim: ReadingClaim) -> None:
    try:
        with Heartbeat(backend, lambda connection, lease_s: uploads.renew(connection, claim, lease_s)):
            result = _read_file(backend, row, claim)
        _end_read(backend, claim, result)
    except ClaimLostError:
        return
    except LoopauditError as error:
        _end(backend, claim, "failed", {"error_code": error.code, "error_text": error.message})
    except Exception as error:  # every fault of ours is told to who waits for the upload, and raised again for the log
        _stumble(backend, claim, error)
        raise


def _read_file(backend: Backend, row: UploadRow, claim: ReadingClaim) -> Read:
    with backend.database.read() as connection:
        reading = uploads.reading_of(connection, row.id)
    mapping = TagMapping.from_bytes(reading["mapping"].encode()) if reading.get("mapping") else None
    options = _options(backend, reading, row)
    placing = with_kept(backend, mapping, row.filename)
    export = read_export(path_of(backend, row.fingerprint), filename=row.filename, mapping=placing, options=options)
    set_points = SetPoints()
    try:
        with closing(_batches(export, set_points)) as batches:
            _store_all(backend, claim, batches, {} if mapping is None else _attributes(mapping))
    except NoRoomToPartError as error:
        _refuse_files_too_large(error)
        _refuse_what_never_fits(backend, row, error.parted_bytes / export.share_taken)
        raise
    with backend.database.read() as connection:
        retired = uploads.retired_of(connection, row.id)
        samples, replaced = uploads.stored_so_far(connection, claim)
    summary, refused = export.summary(), export.rejects()
    places = places_of(summary.loops, row.filename, summary.units)
    told = {
        "layout": summary.layout,
        "rows_kept": summary.rows_kept,
        "samples_added": samples,
        "samples_replaced": replaced,
        "reject_counts": dict(refused.counts),
        "notes": [
            *kept_notes(placing, places),
            *exchanged_tags(set_points.with_op()),
            *summary.notes,
            *_of_replaced(replaced),
            *_of_retired(retired),
        ],
        "tags_found": summary.tags,
        "damaged": bool(export.damage()),
        **_times(summary),
    }
    return Read(told, [_tags(loop) for loop in summary.loops[:LISTED_LOOPS]], refused, places)


def _refuse_files_too_large(error: NoRoomToPartError) -> None:
    """Raises DataError("larger_than_disk") where it is the length of a single file that is too great."""
    if error.errno == errno.EFBIG:
        text = (
            "reading it puts parts of it aside, and the system lets the service write no file as large as these get "
            "(its file system, or LimitFSIZE and `ulimit -f`); send it in parts"
        )
        raise DataError("larger_than_disk", text)


def _refuse_what_never_fits(backend: Backend, row: UploadRow, parted_bytes: float) -> None:
    """Raises DataError("larger_than_disk") where an empty disk would not hold the file and its parts, by what those had
    taken so far."""
    kept_bytes = path_of(backend, row.fingerprint).stat().st_size
    whole_bytes = shutil.disk_usage(backend.settings.uploads_dir).total
    if kept_bytes + parted_bytes > whole_bytes:
        text = (
            f"reading it takes about {megabytes(parted_bytes)} beside the {megabytes(kept_bytes)} of the file, and the "
            f"disk of the data folder has {megabytes(whole_bytes)} in all; send it in parts"
        )
        raise DataError("larger_than_disk", text)


def _times(summary: FileSummary) -> dict[str, str | None]:
    """From when to when the rows are, where they have dates, and by which clock those were written."""
    ends = {"times_from": summary.first_time_ns, "times_to": summary.last_time_ns}
    told = {name: None if at_ns is None else moment_of(at_ns) for name, at_ns in ends.items()}
    dated = {name: at if at is not None and at >= FIRST_DATED else None for name, at in told.items()}
    return {"time_zone": summary.time_zone, **{name: iso_utc(at) for name, at in dated.items()}}


def _of_replaced(replaced: int) -> Iterator[str]:
    """A correction replaces what was stored, and so does a file by a clock that is wrong."""
    if replaced:
        which = f"{replaced:,} stored samples were" if replaced > 1 else "One stored sample was"
        yield f"{which} replaced by other values; where that is no correction, times or tags of the file are wrong."


def _of_retired(tags: list[str]) -> Iterator[str]:
    if tags:
        which = f"{len(tags):,} of its loops are" if len(tags) > 1 else "One of its loops is"
        yield f"{which} retired: what came of them is stored, and not audited with the plant ({named(tags)})."


def _tags(loop: LoopTags) -> dict[str, Any]:
    return {"loop": loop.loop, "pv": loop.pv, "op": loop.op, "sp": loop.sp, "mode": loop.mode, "others": loop.others}


def _options(backend: Backend, reading: dict[str, Any], row: UploadRow) -> IngestOptions:
    """The clock is that of the upload's coming: read twice, it is read in the same way."""
    order = reading.get("date_order") or backend.settings.date_order
    return IngestOptions(
        time_zone=reading.get("time_zone") or backend.settings.time_zone,
        day_first=None if order == "auto" else order == "day",
        now_ns=ns_of(row.received_at),
        max_rejects=backend.settings.max_rejects,
        buffered_values=backend.settings.buffered_samples,
        spill_folder=backend.settings.uploads_dir,
    )


def _batches(export: Export, set_points: SetPoints) -> Generator[list[LoopSamples]]:
    """Stretches with a signal of a loop, so many at a time as one transaction should write."""
    batch: list[LoopSamples] = []
    values = 0
    for stretch in export.loops():
        own = (stretch.pv, stretch.op, stretch.sp, stretch.automatic)
        if all(signal is None for signal in own) or stretch.samples == 0:
            continue
        set_points.look(stretch)
        batch.append(stretch)
        values += 4 * stretch.samples
        if len(batch) >= BATCH_LOOPS or values >= BATCH_VALUES:
            yield batch
            batch, values = [], 0
    if batch:
        yield batch


def _store_all(backend: Backend, claim: ReadingClaim, batches: Iterator[list[LoopSamples]], said: Attributes) -> None:
    """A batch is prepared in a thread and written in another while the next one is read.
    said: what a mapping says of loops."""
    writing: deque[Future[None]] = deque()

    def store(prepared: Future[list[Prepared]]) -> None:
        patiently(partial(_store, backend, claim, prepared.result(), said), backend.settings.lease_s)

    with (
        ThreadPoolExecutor(1, thread_name_prefix="preparing") as preparing,
        ThreadPoolExecutor(1, thread_name_prefix="storing") as storing,
    ):
        try:
            for batch in batches:
                writing.append(storing.submit(store, preparing.submit(_prepared, batch)))
                if len(writing) > BATCHES_AHEAD:
                    writing.popleft().result()
            while writing:
                writing.popleft().result()
        finally:
            while writing:
                writing.popleft().cancel()


def _prepared(batch: list[LoopSamples]) -> list[Prepared]:
    """Fingerprints and packed bytes are made before the transaction, which stays short; samples of which a part is
    stored already are packed anew in it: only then is it known what is new."""
    ready = [Prepared(stretch.loop, _samples(stretch)) for stretch in batch]
    prepare([it.samples for it in ready])
    return ready


def _store(backend: Backend, claim: ReadingClaim, batch: list[Prepared], said: Attributes) -> None:
    with backend.database.write() as connection:
        if not uploads.renew(connection, claim, backend.settings.lease_s):
            raise ClaimLostError
        ids = loops.ensure(connection, (stretch.loop for stretch in batch))
        stretches = [Stretch(ids[stretch.loop], stretch.samples) for stretch in batch]
        place = Place(claim.receipt_number, receipts.unread_before(connection, claim.receipt_number))
        added = series.add(connection, stretches, claim.upload_id, place)
        uploads.note_stored(connection, claim, added.samples, added.replaced)
        uploads.note_loops(connection, claim.upload_id, ids.values())
        if told := {ids[tag]: said[key] for tag in ids if (key := tag.casefold()) in said}:
            loops.fill_in(connection, told)


def _samples(stretch: LoopSamples) -> Samples:
    own = {"pv": stretch.pv, "op": stretch.op, "sp": stretch.sp, "automatic": stretch.automatic}
    signals = {name: values for name, values in own.items() if values is not None}
    return Samples(stretch.time_ns, {**signals, **{f"tag:{tag}": values for tag, values in stretch.others.items()}})


LONGEST_UNIT = 40
OF_LOOP = {"type": "loop_type", "unit": "area", "description": "description", "owner": "owner"}
"""What a mapping says of a loop in the rows of its tags."""


def _attributes(mapping: TagMapping) -> Attributes:
    """Of a loop, which may be spelled in two ways: the spans and the unit of its signals, its type and plant unit. The
    first row that says it decides; one end of a span is not taken from one tag, and the other from another.
    """
    found: dict[str, dict[str, Any]] = {}
    for entry in mapping.entries.values():
        told = found.setdefault(entry.loop.casefold(), {})
        if entry.signal in ("PV", "OP"):
            low, high = f"{entry.signal.lower()}_low", f"{entry.signal.lower()}_high"
            if told.get(low) is None and told.get(high) is None:
                told[low], told[high] = entry.number("low"), entry.number("high")
        if entry.signal == "PV":
            told["pv_unit"] = told.get("pv_unit") or _word(entry, "unit")
        for name, column in OF_LOOP.items():
            told[name] = told.get(name) or _word(entry, column)
    return {
        loop: {name: value for name, value in told.items() if value not in (None, "")} for loop, told in found.items()
    }


def _word(entry: MappedTag, column: str) -> str:
    return without_commands(entry.attributes.get(column, ""))


def _units_of_pv(places: Sequence[TagPlace]) -> dict[str, str]:
    """By loop, as the file tells them: they hold where neither a mapping nor anybody says otherwise."""
    return {place.loop: place.unit for place in places if place.signal == "PV" and 0 < len(place.unit) <= LONGEST_UNIT}


def _end_read(backend: Backend, claim: ReadingClaim, result: Read) -> None:
    """What changed of its tags is told and kept at once, however many files end now."""
    listed = [RejectRow(reject.line, reject.code, reject.text, reject.tag) for reject in result.rejects.listed]

    def write() -> None:
        with backend.database.write() as connection:
            changed = note_read(connection, claim.receipt_number, result.places)
            units = _units_of_pv(result.places)
            ids = loops.ids_of(connection, sorted(units))
            loops.fill_in(connection, {ids[tag]: {"pv_unit": unit} for tag, unit in units.items() if tag in ids})
            summary = {**result.summary, "notes": [*changed, *result.summary["notes"]]}
            told = {"summary_json": json.dumps(summary), "tags_json": json.dumps(result.tags)}
            if not uploads.end(connection, claim, "done", told):
                raise ClaimLostError
            uploads.replace_rejects(connection, claim.upload_id, listed)

    patiently(write, backend.settings.lease_s)


def _end(backend: Backend, claim: ReadingClaim, state: str, values: dict[str, Any]) -> None:
    def write() -> None:
        with backend.database.write() as connection:
            uploads.end(connection, claim, state, values)

    patiently(write, backend.settings.lease_s)


def _stumble(backend: Backend, claim: ReadingClaim, error: Exception) -> None:
    for_room = no_room(error)
    if for_room or folder_away(backend.settings, error):
        with suppress(*DATABASE_AWAY), backend.database.write() as connection:  # whose disk may be the full one
            uploads.wait(connection, claim, backend.settings.stalled_s, for_room=for_room)
        return
    if isinstance(error, DATABASE_AWAY):
        return  # for too long: no fault of the file, and nothing can be written; it is read when the lease is over
    if claim.attempt >= min(FAULTS_IN_ALL, backend.settings.max_reading_attempts):
        text = f"reading this file failed by a fault of the service ({type(error).__name__}); the log has the details"
        _end(backend, claim, "failed", {"error_code": "fault", "error_text": text})
        return
    with backend.database.write() as connection:
        uploads.hand_back(connection, claim)
