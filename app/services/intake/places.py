"""Where the tags of a file belong: a correction that holds for later files, and a tag that was read otherwise before.

A tag that names its loop means the same in every file. One that does not (a bare `PV`) is meant as that of files of its
file's name.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from types import MappingProxyType
from typing import cast

from sqlalchemy import Connection

from app.errors import NotFoundError
from app.ingest import (
    IngestOptions,
    LoopTags,
    MappedTag,
    Signal,
    TagMapping,
    loop_of,
    names_its_loop,
    stem_of,
    unit_of,
    without_unit,
)
from app.services.backend import Backend
from app.services.telling.naming import NAMED, named
from app.storage import receipts
from app.storage import tags as stored
from app.storage.tags import OTHER, KeptTag, Key, ReadTag
from app.storage.types import now, storable

LONGEST_TAG = IngestOptions().max_name


@dataclass(frozen=True)
class TagPlace:
    """As what a file has a tag. unit: that the tag tells, empty where it tells none; the key is without it."""

    key: Key
    tag: str
    loop: str
    signal: str
    unit: str

    def as_read(self, receipt_number: int, before: ReadTag | None = None) -> ReadTag:
        """What is known of the tag now. The upload that was received last holds, whichever is read last; a unit that is
        known stays where a file tells none."""
        if before is None:
            return ReadTag(self.loop, self.signal, self.unit, receipt_number, receipt_number)
        later = receipt_number >= before.newest_number
        unit = self.unit if self.unit and (later or not before.unit) else before.unit
        if later and _place(self) != _place(before):
            return ReadTag(self.loop, self.signal, unit, receipt_number, receipt_number)
        return replace(before, unit=unit, newest_number=max(receipt_number, before.newest_number))


def key_of(tag: str, filename: str) -> Key:
    file = "" if names_its_loop(tag) else storable(stem_of(filename)).casefold()
    return file, storable(tag).casefold()


def with_kept(backend: Backend, mapping: TagMapping | None, filename: str) -> TagMapping | None:
    """The mapping of an upload with what was said of tags for later files."""
    with backend.database.read() as connection:
        rows = stored.kept(connection, storable(stem_of(filename)).casefold())
    if not rows:
        return mapping
    kept = [MappedTag(row.tag, row.loop, cast(Signal, row.signal)) for row in rows]
    return (mapping or TagMapping(MappingProxyType({}))).with_kept(kept)


@dataclass(frozen=True)
class Correction:
    """What a mapping says of the tags of a file, for later files too, by whom."""

    mapping: bytes
    filename: str
    who: str

    def keep(self, connection: Connection) -> None:
        """Raises DataError("bad_mapping")."""
        entries = TagMapping.from_bytes(self.mapping).entries.values()
        at = now()
        rows = {
            key: KeptTag(*key, storable(entry.tag), storable(entry.loop), entry.signal, at, self.who)
            for entry in entries
            if len(entry.tag) <= LONGEST_TAG  # no file has longer ones
            for key in [key_of(entry.tag, self.filename)]
        }
        if rows:
            stored.keep(connection, list(rows.values()))


def lock(connection: Connection) -> None:
    """Before anything of an upload, where a correction is kept with it: whoever ends reading one takes them so too."""
    stored.lock(connection)


def kept_by_loop(backend: Backend) -> list[list[KeptTag]]:
    """What holds for later files, by loop and the files that it holds for."""
    with backend.database.read() as connection:
        rows = stored.kept(connection)
    return [list(some) for _, some in groupby(sorted(rows, key=_listed_under), _listed_under)]


def _listed_under(row: KeptTag) -> tuple[str, str]:
    return row.loop.casefold(), row.file


def forget(backend: Backend, file: str, loop: str) -> None:
    """What was said of the tags of a loop holds for no later file, nor what was said with it of tags that it was
    exchanged with. Raises NotFoundError("nothing_kept")."""
    with backend.database.write() as connection:
        stored.lock(connection)
        rows = stored.kept(connection)
        own = [row for row in rows if _listed_under(row) == (storable(loop).casefold(), storable(file))]
        if not own:
            raise NotFoundError("nothing_kept", f"no tag mapping of {loop!r} is kept for later files")
        stored.drop(connection, _with_exchanged(own, rows))


def _with_exchanged(own: Sequence[KeptTag], rows: Sequence[KeptTag]) -> list[KeptTag]:
    """Half of what was said at once of two loops that are exchanged is wrong: a tag that goes back to the loop of its
    name finds another in its place."""
    said = {(row.kept_at, row.kept_by) for row in own}
    found = list(own)
    rest = [row for row in set(rows) - set(own) if (row.kept_at, row.kept_by) in said]
    more = list(own)
    while more:
        touched = {loop for row in more for loop in _loops_of(row)}
        more = [row for row in rest if not touched.isdisjoint(_loops_of(row))]
        rest = [row for row in rest if touched.isdisjoint(_loops_of(row))]
        found += more
    return found


def _loops_of(row: KeptTag) -> set[str]:
    """That it was said to be of, and that its name tells."""
    return {row.loop.casefold(), loop_of(row.tag, row.file).casefold()}


def places_of(loops: Iterable[LoopTags], filename: str, units: Mapping[str, str]) -> list[TagPlace]:
    """Each tag once: the first has it where a workbook has several of one name. units: by tag, where it is not its name
    that tells."""
    found: dict[Key, TagPlace] = {}
    for loop in loops:
        own = [(loop.pv, "PV"), (loop.op, "OP"), (loop.sp, "SP"), (loop.mode, "MODE")]
        for tag, signal in [*own, *((other, OTHER) for other in loop.others)]:
            if tag is not None:
                unit = unit_of(tag) or units.get(tag, "")
                key = key_of(without_unit(tag), filename)
                found.setdefault(key, TagPlace(key, tag, storable(loop.loop), signal, storable(unit)))
    return list(found.values())


def kept_notes(mapping: TagMapping | None, places: Sequence[TagPlace]) -> Iterator[str]:
    """Which tags of the file are read as was said once, and where to take that back."""
    used = [place for place in places if mapping is not None and mapping.is_kept(place.tag)]
    if used:
        shown = _some(used, lambda place: f"{place.tag} as {place.signal} of {place.loop}")
        yield f"read as was said of an earlier file, for later ones too (Uploads lists it, to be taken back): {shown}"


def note_read(connection: Connection, receipt_number: int, places: Sequence[TagPlace]) -> list[str]:
    """Keeps as what the tags were read, and says which of them were another signal, or another loop's, or had another
    unit before."""
    stored.lock(connection)
    before = stored.last_read(connection, (place.key for place in places))
    new = {it.key: it.as_read(receipt_number) for it in places if it.key not in before}
    known = [it for it in places if it.key in before]
    moved = [it for it in known if _place(it) != _place(before[it.key])]
    otherwise = [it for it in known if it.unit and it.unit != before[it.key].unit]
    now_known = {it.key: it.as_read(receipt_number, before[it.key]) for it in known}
    # That a tag is as it was matters only to an upload that was received before this one, and is still to be read.
    late = receipts.unread_before(connection, receipt_number) > 0
    changed = {key: row for key, row in now_known.items() if late or _differs(row, before[key])}
    stored.note_read(connection, new, changed)
    return list(_changes(moved, otherwise, before))


def _differs(row: ReadTag, before: ReadTag) -> bool:
    return (_place(row), row.unit) != (_place(before), before.unit)


def _changes(moved: Sequence[TagPlace], otherwise: Sequence[TagPlace], before: Mapping[Key, ReadTag]) -> Iterator[str]:
    if told := [it for it in moved if {it.signal, before[it.key].signal} != {OTHER}]:
        shown = _some(told, lambda it: f"{it.tag} is {_said(it)} here and was {_said(before[it.key])}")
        yield f"check this first, tags are not what they were in other files: {shown}. What was read of those stays."
    if told := [it for it in otherwise if before[it.key].unit and it.signal != OTHER]:
        shown = _some(
            told, lambda it: f"{it.signal} of {it.loop} is in {it.unit} here and was in {before[it.key].unit}"
        )
        yield f"check this first, units are not what they were in other files: {shown}. Values are stored as they came."


def _place(place: TagPlace | ReadTag) -> tuple[str, str]:
    return place.loop.casefold(), place.signal


def _said(place: TagPlace | ReadTag) -> str:
    what = "a further signal" if place.signal == OTHER else place.signal
    return f"{what} of {place.loop}"


def _some(places: Sequence[TagPlace], said: Callable[[TagPlace], str]) -> str:
    return named([said(place) for place in places[:NAMED]], len(places))
