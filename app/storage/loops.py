"""The plant's loops."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import ColumnElement, Connection, LargeBinary, Select, bindparam, cast, func, or_, select, update

from app.storage.bulk import among, among_many, from_arrays, insert_new_rows
from app.storage.locks import Lock, hold
from app.storage.tables import loops
from app.storage.types import now

SETTABLE = (
    "unit",
    "type",
    "description",
    "owner",
    "importance",
    "pv_unit",
    "pv_low",
    "pv_high",
    "op_low",
    "op_high",
    "integrating",
    "moves_valve",
    "retired",
    "continues",
)
SPANS = (("pv_low", "pv_high"), ("op_low", "op_high"))
IN_SERVICE = ~loops.c.retired
"""Of loops that count: those that are retired keep what is stored of them, and are left out of what is said of all."""


@dataclass(frozen=True)
class LoopRow:
    id: int
    tag: str
    unit: str | None
    type: str | None
    description: str | None
    owner: str | None
    importance: float
    pv_unit: str | None
    pv_low: float | None
    pv_high: float | None
    op_low: float | None
    op_high: float | None
    integrating: bool | None
    moves_valve: bool | None
    retired: bool
    continues: str | None
    newest_ns: int | None
    newest_audit_id: int | None

    @property
    def pv_range(self) -> tuple[float, float] | None:
        return _range(self.pv_low, self.pv_high)

    @property
    def op_range(self) -> tuple[float, float] | None:
        return _range(self.op_low, self.op_high)


COLUMNS = [loops.c[name] for name in LoopRow.__dataclass_fields__]


def ensure(connection: Connection, tags: Iterable[str]) -> dict[str, int]:
    """The ids of the loops with these tags; loops that are not there yet are created, unless one is that is spelled in
    other letters, great or small: as in one file, it is the same. Two new spellings of a tag make one loop too."""
    wanted = sorted(set(tags))
    ids = ids_of(connection, wanted)
    ids |= _spelled_otherwise(connection, [tag for tag in wanted if tag not in ids])
    if any(tag not in ids for tag in wanted):
        _lock_new(connection)
        ids |= _spelled_otherwise(connection, [tag for tag in wanted if tag not in ids])
    if missing := [tag for tag in wanted if tag not in ids]:
        spelled: dict[str, str] = {}
        for tag in missing:
            spelled.setdefault(tag.casefold(), tag)
        insert_new_rows(connection, loops, [{"tag": tag, "created_at": now()} for tag in spelled.values()])
        created = ids_of(connection, list(spelled.values()))
        ids |= {tag: created[spelled[tag.casefold()]] for tag in missing}
    return ids


def _lock_new(connection: Connection) -> None:
    """Whoever creates loops waits for whoever does so now: of two spellings of a tag the second sees the first."""
    hold(connection, Lock.NEW_LOOPS)


def _spelled_otherwise(connection: Connection, tags: Sequence[str]) -> dict[str, int]:
    """Where an older version left several spellings of a tag, it is the one that was there first."""
    if not tags:
        return {}
    known: dict[str, int] = {}
    query, asked = in_other_letters(connection, [tag.casefold() for tag in tags])
    for row in connection.execute(query.order_by(loops.c.id), asked):
        known.setdefault(row.tag.casefold(), row.id)
    return {tag: known[tag.casefold()] for tag in tags if tag.casefold() in known}


def in_other_letters(connection: Connection, folded: list[str]) -> tuple[Select[Any], dict[str, Any]]:
    """What asks for the tags that may be one of these in small letters, and what it is told. Whether letters that are
    not of ASCII are the same is not the database's to say: all tags with some are asked for."""
    query, letters = select(loops.c.tag, loops.c.id), func.length(loops.c.tag)
    if connection.dialect.name != "postgresql":
        same = among_many(connection, func.lower(loops.c.tag), folded)
        return query.where(or_(same, func.length(cast(loops.c.tag, LargeBinary)) != letters)), {}
    same = func.lower(loops.c.tag.collate("C")).in_(from_arrays(loops, ("tag",)))
    bytes_sent = func.octet_length(func.convert_to(loops.c.tag, "UTF8"))  # in a database of LATIN1 an é is one byte
    return query.where(or_(same, bytes_sent != letters)), {"sent_tag": folded}


def ids_of(connection: Connection, tags: Sequence[str]) -> dict[str, int]:
    if connection.dialect.name != "postgresql":
        query, asked = select(loops.c.tag, loops.c.id).where(loops.c.tag.in_(tags)), {}
    else:  # a plan kept from an empty table compares each tag with each of an array; it hashes or looks up rows
        sent = from_arrays(loops, ("tag",)).subquery()
        query, asked = select(loops.c.tag, loops.c.id).join(sent, loops.c.tag == sent.c.tag), {"sent_tag": list(tags)}
    return {row.tag: row.id for row in connection.execute(query, asked)}


def as_spelled(connection: Connection, tags: Sequence[str]) -> dict[str, str]:
    """The tags of loops by those that are asked for: the same, or that of the only loop that is spelled in other
    letters, great or small. Those of no loop are left out."""
    found = {tag: tag for tag in ids_of(connection, tags)}
    if missing := [tag for tag in tags if tag not in found]:
        known: dict[str, list[str]] = {}
        for tag in connection.scalars(select(loops.c.tag)):
            known.setdefault(tag.casefold(), []).append(tag)
        found |= {tag: alike[0] for tag in missing if len(alike := known.get(tag.casefold(), [])) == 1}
    return found


def by_tag(connection: Connection, tag: str, to_change: bool = False) -> LoopRow | None:
    """to_change: nobody else changes it until the transaction ends."""
    query = select(*COLUMNS).where(loops.c.tag == tag)
    return _one(connection, query.with_for_update(key_share=True, of=loops) if to_change else query)


def by_ids(connection: Connection, ids: Iterable[int]) -> dict[int, LoopRow]:
    found = connection.execute(select(*COLUMNS).where(among(connection, loops.c.id, ids)))
    return {row.id: LoopRow(*row) for row in found}


def to_change(connection: Connection, ids: Iterable[int]) -> dict[int, LoopRow]:
    """Loops that nobody else changes until the transaction ends, in one order for all who ask for many."""
    query = select(*COLUMNS).where(among(connection, loops.c.id, ids)).order_by(loops.c.id)
    return {row.id: LoopRow(*row) for row in connection.execute(query.with_for_update(key_share=True, of=loops))}


@dataclass(frozen=True)
class ListFilter:
    """Which loops to list: all that are given must hold. retired: None, whether they are retired or not."""

    unit: str | None = None
    owner: str | None = None
    search: str | None = None
    retired: bool | None = None


def page(
    connection: Connection, limit: int, after_tag: str | None = None, wanted: ListFilter | None = None
) -> list[LoopRow]:
    """Loops in the order of their tags, after `after_tag`."""
    wanted = wanted or ListFilter()
    query = select(*COLUMNS).order_by(loops.c.tag).limit(limit)
    if after_tag is not None:
        query = query.where(loops.c.tag > after_tag)
    if wanted.unit is not None:
        query = query.where(loops.c.unit == wanted.unit)
    if wanted.owner is not None:
        query = query.where(loops.c.owner == wanted.owner)
    if wanted.search:
        query = query.where(found_by(wanted.search))
    if wanted.retired is not None:
        query = query.where(loops.c.retired if wanted.retired else IN_SERVICE)
    return [LoopRow(*row) for row in connection.execute(query)]


def found_by(words: str) -> ColumnElement[bool]:
    """Whether these words are a part of a loop's tag, of what it controls, or of who looks after it."""
    looked_at = (loops.c.tag, loops.c.description, loops.c.owner)
    return or_(*(column.icontains(words, autoescape=True) for column in looked_at))


def change(connection: Connection, loop_id: int, changes: dict[str, Any]) -> None:
    connection.execute(update(loops).where(loops.c.id == loop_id).values(**changes))


def change_each(connection: Connection, changed: Mapping[int, Mapping[str, Any]]) -> None:
    """By loop, the value of each of `SETTABLE`."""
    if changed:
        given: dict[str, Any] = {name: bindparam(f"new_{name}") for name in SETTABLE}
        told = [
            {"loop": loop_id, **{f"new_{name}": values[name] for name in SETTABLE}}
            for loop_id, values in changed.items()
        ]
        connection.execute(update(loops).where(loops.c.id == bindparam("loop")).values(**given), told)


def _one(connection: Connection, query: Select[Any]) -> LoopRow | None:
    row = connection.execute(query).one_or_none()
    return None if row is None else LoopRow(*row)


def _range(low: float | None, high: float | None) -> tuple[float, float] | None:
    return None if low is None or high is None else (low, high)


def fill_in(connection: Connection, told: Mapping[int, Mapping[str, Any]]) -> None:
    """Sets what a mapping tells about loops, where nobody has set it yet. A span is one value: of ends from two sources
    none may be below the other."""
    lacking = [loop_id for loop_id, row in by_ids(connection, told).items() if _unset(row, told[loop_id])]
    rows = to_change(connection, lacking)  # looked at anew: somebody may have set it meanwhile
    for loop_id, row in rows.items():
        if unset := _unset(row, told[loop_id]):
            change(connection, loop_id, unset)


def _unset(row: LoopRow, told: Mapping[str, Any]) -> dict[str, Any]:
    """Of what is told, what the loop does not have; of a span of which it has an end, the other only where the end that
    it has is told as well."""
    held = [{end: value for end in span if (value := getattr(row, end)) is not None} for span in SPANS]
    other = {name for span, ends in zip(SPANS, held, strict=True) if _differs(ends, told) for name in span}
    return {name: value for name, value in told.items() if name not in other and getattr(row, name) is None}


def _differs(ends: Mapping[str, float], told: Mapping[str, Any]) -> bool:
    return any(told.get(name) != value for name, value in ends.items())


def count(connection: Connection) -> int:
    """Without those that are retired."""
    return connection.scalar(select(func.count()).select_from(loops).where(IN_SERVICE)) or 0


def retired(connection: Connection) -> tuple[int, ...]:
    return tuple(connection.scalars(select(loops.c.id).where(loops.c.retired).order_by(loops.c.id)))


def count_retired(connection: Connection) -> int:
    return connection.scalar(select(func.count()).select_from(loops).where(loops.c.retired)) or 0


def types(connection: Connection) -> list[str]:
    """The types that loops of the plant have."""
    query = select(loops.c.type).where(loops.c.type.is_not(None)).distinct().order_by(loops.c.type)
    return list(connection.scalars(query))


def owners(connection: Connection) -> list[str]:
    """Who looks after the loops in service."""
    query = select(loops.c.owner).where(loops.c.owner.is_not(None), IN_SERVICE).distinct().order_by(loops.c.owner)
    return list(connection.scalars(query))


def any_before(connection: Connection, moment: datetime) -> bool:
    """Whether a loop with samples, which is not retired, was known before `moment`."""
    known = (loops.c.created_at < moment, loops.c.newest_ns.is_not(None), IN_SERVICE)
    return connection.scalar(select(loops.c.id).where(*known).limit(1)) is not None
