"""Stretches of samples: written so that sending again changes nothing, read for many loops at once."""

import json
import logging
import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from sqlalchemy import ColumnElement, Connection, Select, and_, bindparam, func, select, true, tuple_, update

from app.nanoseconds import EVER_NS, NS_PER_DAY, NS_PER_H
from app.storage.ahead import newest_until
from app.storage.bulk import among_many, columns_of, from_arrays, from_json, insert_new_rows
from app.storage.samples import DamagedStretchError, Samples, compared, merged, news, refused_anew, unpack_stored
from app.storage.steps import known_before, last_known, led_in
from app.storage.tables import AS_RECEIVED, loops, series

log = logging.getLogger("loopaudit.series")

LOOPS_AT_ONCE = 8
"""Loops whose stretches are taken from the database together: a week at a value a second has some megabytes."""
STORED_AT_ONCE = 1_000_000
"""Samples that are stored of loops and compared with what is sent of them together: some 30 MB."""
LONG_PAUSE_NS = NS_PER_DAY
"""What is stored of a pause that is longer, between two samples that are sent, is not looked at."""

Key = tuple[int, str]
"""Of a stretch: its loop and its fingerprint."""


@dataclass(frozen=True, eq=False)
class Stretch:
    loop_id: int
    samples: Samples


@dataclass(frozen=True)
class Place:
    """Where an upload stands among all others.

    receipt_number: the later one was received later; 0: before they were numbered. unread_before: the greatest number
    below it of those that are still to be read; 0: none is.
    """

    receipt_number: int = 0
    unread_before: int = 0


@dataclass(frozen=True, eq=False)
class Readable:
    """What can be read of a time; None: no stretch of it. damaged: from when to when (ns, both included) the stretches
    reach that cannot be, cut to that time, in order."""

    samples: Samples | None
    damaged: tuple[tuple[int, int], ...] = ()


class Stored(NamedTuple):
    """A stretch that is stored, and the number of the upload that brought it."""

    receipt_number: int
    samples: Samples


@dataclass(frozen=True)
class Added:
    """What a write changed: stretches that were stored, samples that were not there before, and samples that took the
    place of other values."""

    stretches: int = 0
    samples: int = 0
    replaced: int = 0

    def __add__(self, other: "Added") -> "Added":
        return Added(self.stretches + other.stretches, self.samples + other.samples, self.replaced + other.replaced)


def add(
    connection: Connection, stretches: Sequence[Stretch], upload_id: int | None, place: Place | None = None
) -> Added:
    """Stores what is new in the stretches. What this upload brought before, and samples that are there already, change
    nothing; where a value differs from the stored one at its time, the one that was received later holds."""
    place = place or Place()
    prints = _not_stored(connection, stretches, upload_id, place)
    rows, added = [], Added()
    for (loop_id, fingerprint), stretch, stored in _beside_stored(connection, prints):
        fresh = _fresh(stretch.samples, stored, place)
        added += Added(samples=fresh.new, replaced=fresh.replaced)
        if len(fresh.samples):
            named = {"loop_id": loop_id, "fingerprint": fingerprint, "upload_id": upload_id}
            rows.append({**named, "receipt_number": place.receipt_number, **_columns(fresh.samples)})
    if rows:
        insert_new_rows(connection, series, rows)
        _note_newest(connection, rows)
    return added + Added(len(rows))


def windows(
    connection: Connection,
    loop_ids: Iterable[int],
    window_h: float,
    most_samples: int,
    hold_days: float = math.inf,
    until_ns: int = EVER_NS,
) -> dict[int, Samples]:
    """The newest samples of each loop, at most `window_h` hours back from its newest one and `most_samples` of them.

    A set point and a mode that were stated up to `hold_days` before are given to the first sample. A loop without
    samples is left out, and so is what comes after `until_ns`, of a loop that has any before it. What is not in a
    window is let go before the next loop is read.
    """
    back_ns = int(window_h * NS_PER_H)
    asked = sorted(set(loop_ids))
    since = newest_until(connection, until_ns, asked) - back_ns
    cut, known = {}, {}
    for loop_id, read in _back_to(connection, asked, since):
        whole = _until(read, until_ns)
        cut[loop_id] = _newest(whole, int(whole.time_ns[-1]) - back_ns, most_samples)
        known[loop_id] = known_before(whole, cut[loop_id])
    return led_in(connection, cut, known, since, hold_days)


def between(
    connection: Connection, loop_id: int, start_ns: int, end_ns: int, hold_days: float = math.inf
) -> Samples | None:
    """A loop's samples from `start_ns` to `end_ns`, both included; None where there is no stretch at all.

    A set point and a mode that were stated up to `hold_days` before are given to the first sample.
    """
    parts = [unpack_stored(row.id, row.packed) for row in _packed(connection, loop_id, start_ns, end_ns)]
    if not parts:
        return None
    samples = merged(parts)
    inside = _inside(samples, start_ns, end_ns)
    known = known_before(samples, inside)
    return led_in(connection, {loop_id: inside}, {loop_id: known}, start_ns, hold_days)[loop_id]


def readable(connection: Connection, loop_id: int, start_ns: int, end_ns: int, hold_days: float = math.inf) -> Readable:
    """As `between`, for those who look: a stretch that is damaged is left out and told, the others are given.

    A damaged one is not told where as many samples with PV and OP are there all the same, because it was sent again.
    """
    parts, damaged = [], []
    for row in _packed(connection, loop_id, start_ns, end_ns):
        try:
            parts.append(unpack_stored(row.id, row.packed))
        except DamagedStretchError:
            log.exception("samples of loop %s are damaged and left out", loop_id)
            damaged.append(row)
    whole = merged(parts) if parts else None
    lost = [row for row in damaged if whole is None or _both(whole, row.start_ns, row.end_ns) < row.samples]
    told = sorted((max(row.start_ns, start_ns), min(row.end_ns, end_ns)) for row in lost)
    if whole is None:
        return Readable(None, tuple(told))
    inside = _inside(whole, start_ns, end_ns)
    known = {loop_id: known_before(whole, inside)}
    try:
        inside = led_in(connection, {loop_id: inside}, known, start_ns, hold_days)[loop_id]
    except DamagedStretchError:
        log.exception("what held before is damaged and left out")
    return Readable(inside, tuple(told))


def _packed(connection: Connection, loop_id: int, start_ns: int, end_ns: int) -> Sequence[Any]:
    columns = (series.c.id, series.c.start_ns, series.c.end_ns, series.c.samples, series.c.packed)
    query = select(*columns).where(*_touches(loop_id, start_ns, end_ns)).order_by(*AS_RECEIVED)
    return connection.execute(query).all()


def _inside(samples: Samples, start_ns: int, end_ns: int) -> Samples:
    return samples.part((samples.time_ns >= start_ns) & (samples.time_ns <= end_ns))


def _both(samples: Samples, start_ns: int, end_ns: int) -> int:
    """How many samples from `start_ns` to `end_ns` have PV and OP."""
    inside = _inside(samples, start_ns, end_ns)
    missing = np.full(len(inside), np.nan)
    pv, op = (inside.signals.get(name, missing) for name in ("pv", "op"))
    return int(np.count_nonzero(np.isfinite(pv) & np.isfinite(op)))


def count_between(connection: Connection, loop_id: int, start_ns: int, end_ns: int) -> int:
    """How many samples the stretches hold that `between` would read; some of them may lie outside."""
    query = select(func.sum(series.c.samples)).where(*_touches(loop_id, start_ns, end_ns))
    return int(connection.scalar(query) or 0)


def newest_before(connection: Connection, loop_id: int, newest_ns: int, until_ns: int) -> int:
    """The time of a loop's newest sample that is not after `until_ns`; of one that has none before it, `newest_ns`, its
    newest of all, all the same. A stretch that reaches over that time is looked into."""
    if newest_ns <= until_ns:
        return newest_ns
    mine = (series.c.loop_id == loop_id, series.c.start_ns <= until_ns)
    before = connection.scalar(select(func.max(series.c.end_ns)).where(*mine, series.c.end_ns <= until_ns))
    reaching = select(series.c.id, series.c.packed).where(*mine, series.c.end_ns > until_ns)
    found = [] if before is None else [int(before)]
    for row in connection.execute(reaching).all():
        with suppress(DamagedStretchError):  # told where its samples are read
            times = unpack_stored(row.id, row.packed).time_ns
            found.append(int(times[np.searchsorted(times, until_ns, side="right") - 1]))
    return max(found, default=newest_ns)


def pieces(connection: Connection, loop_id: int, start_ns: int, end_ns: int, most: int) -> list[tuple[int, int]]:
    """The time from `start_ns` to `end_ns`, cut where stretches begin, so that `between` reads about `most` samples of
    each piece."""
    query = select(series.c.start_ns, series.c.samples).where(*_touches(loop_id, start_ns, end_ns))
    cuts, held = [start_ns], 0
    for begin_ns, samples in connection.execute(query.order_by(series.c.start_ns)):
        if held + samples > most and begin_ns > cuts[-1]:
            cuts.append(begin_ns)
            held = 0
        held += samples
    return list(zip(cuts, [*(cut - 1 for cut in cuts[1:]), end_ns], strict=True))


def _touches(loop_id: int, start_ns: int, end_ns: int) -> tuple[ColumnElement[bool], ...]:
    return series.c.loop_id == loop_id, series.c.end_ns >= start_ns, series.c.start_ns <= end_ns


def _not_stored(
    connection: Connection, stretches: Sequence[Stretch], upload_id: int | None, place: Place
) -> dict[Key, Stretch]:
    """Stretches that this upload did not bring before, by the key under which they are stored.

    What another upload brought may have been corrected since, and the correction be taken back now: such a stretch is
    looked at again, under a key of this receipt. So is one while an upload is unread that came before: it may be about
    to bring the same, and the key would be taken by the older of the two.
    """
    prints = {(s.loop_id, s.samples.fingerprint): s for s in stretches if len(s.samples)}
    own = {key: (key[0], f"{key[1]}:{upload_id}.{place.receipt_number}") for key in prints}
    known = _known(connection, [*prints, *own.values()])
    found = {}
    for key, stretch in prints.items():
        if own[key] not in known and known.get(key) != (upload_id, place.receipt_number):
            found[own[key] if key in known or place.unread_before else key] = stretch
    return found


def _known(connection: Connection, keys: list[Key]) -> dict[Key, tuple[int | None, int]]:
    """Which upload brought the stretches that are stored under these keys, and its number then."""
    if not keys:
        return {}
    names = ("loop_id", "fingerprint")
    key = [series.c[name] for name in names]
    query = select(*key, series.c.upload_id, series.c.receipt_number)
    if connection.dialect.name != "postgresql":
        found = connection.execute(query.where(tuple_(*key).in_(keys)))
    else:
        sent = from_arrays(series, names).subquery()
        asked = columns_of([dict(zip(names, values, strict=True)) for values in keys])
        same = and_(*(series.c[name] == sent.c[name] for name in names))
        found = connection.execute(query.join(sent, same), asked)
    return {(row.loop_id, row.fingerprint): (row.upload_id, row.receipt_number) for row in found}


def _beside_stored(
    connection: Connection, prints: Mapping[Key, Stretch]
) -> Iterator[tuple[Key, Stretch, list[Stored]]]:
    """Each stretch with what is stored of its loop at its times, by loop: in one order for all writers, of whom none
    then waits for another in a circle. Of what is stored, some loops' is in memory at a time."""
    sent: dict[int, list[Key]] = defaultdict(list)
    for key in prints:
        sent[key[0]].append(key)
    touched = _touched(connection, prints.values())
    for some in _parted(sorted(sent), touched):
        stored = _stored(connection, [one.id for loop_id in some for one in touched.get(loop_id, ())])
        for loop_id in some:
            for key in sent[loop_id]:
                yield key, prints[key], stored.get(loop_id, [])


def _parted(loop_ids: Iterable[int], touched: Mapping[int, list["_Touched"]]) -> Iterator[list[int]]:
    """Loops whose stored stretches are taken from the database together."""
    some: list[int] = []
    held = 0
    for loop_id in loop_ids:
        more = sum(one.samples for one in touched.get(loop_id, ()))
        if some and held + more > STORED_AT_ONCE:
            yield some
            some, held = [], 0
        some.append(loop_id)
        held += more
    if some:
        yield some


class _Touched(NamedTuple):
    """A stretch that is stored, not yet read."""

    id: int
    samples: int


def _touched(connection: Connection, stretches: Collection[Stretch]) -> dict[int, list[_Touched]]:
    """Which stored stretches may have a sample at a time of one that is sent, by loop: those that reach into a time in
    which it has samples. One that only lies between two of its samples is none of them."""
    spans = [span for stretch in stretches for span in _spans(stretch)]
    if not spans:
        return {}
    query, told = _reaching_into(connection, spans)
    found: dict[int, list[_Touched]] = defaultdict(list)
    for loop_id, stretch_id, samples in connection.execute(query, told):
        found[loop_id].append(_Touched(stretch_id, samples))
    return found


def _reaching_into(connection: Connection, spans: list[dict[str, int]]) -> tuple[Select[Any], dict[str, Any]]:
    """What asks for the stretches, by index span by span however little the database knows of them, and what it is
    told."""
    names, columns = ("loop_id", "start_ns", "end_ns"), (series.c.loop_id, series.c.id, series.c.samples)
    on_postgresql = connection.dialect.name == "postgresql"
    sent = (from_arrays(series, names) if on_postgresql else from_json(names)).subquery("sent")
    same = (series.c.loop_id == sent.c.loop_id, series.c.end_ns >= sent.c.start_ns, series.c.start_ns <= sent.c.end_ns)
    if not on_postgresql:
        told = {"sent_rows": json.dumps([[span[name] for name in names] for span in spans])}
        return select(*columns).distinct().join(sent, and_(*same)), told
    # Taken for one join, the planner read the whole table: it holds a time that is asked for to be most of a record.
    one = select(*columns).where(*same).correlate(sent).offset(0).lateral("one")
    return select(one).distinct().select_from(sent).join(one, true()), columns_of(spans)


def _spans(stretch: Stretch) -> Iterator[dict[str, int]]:
    """From when to when it has samples, cut where it has none for long: a historian gives the value of a year ago of a
    signal that has not changed since, or whose transmitter is dead."""
    times = stretch.samples.time_ns
    begins = np.concatenate(([0], np.flatnonzero(np.diff(times) > LONG_PAUSE_NS) + 1))
    ends = np.append(begins[1:] - 1, len(times) - 1)
    for begin, end in zip(times[begins].tolist(), times[ends].tolist(), strict=True):
        yield {"loop_id": stretch.loop_id, "start_ns": begin, "end_ns": end}


def _stored(connection: Connection, stretch_ids: list[int]) -> dict[int, list[Stored]]:
    """These stretches by loop, in the order in which they were received.

    A damaged stretch is taken for absent: what is sent is stored, and so is what came of other loops with it.
    """
    found: dict[int, list[Stored]] = defaultdict(list)
    if not stretch_ids:
        return found
    query = select(series.c.loop_id, series.c.id, series.c.receipt_number, series.c.packed).order_by(*AS_RECEIVED)
    for row in connection.execute(query.where(among_many(connection, series.c.id, stretch_ids))).all():
        try:
            found[row.loop_id].append(Stored(row.receipt_number, unpack_stored(row.id, row.packed)))
        except DamagedStretchError:
            log.exception("samples of loop %s are damaged; what is sent of that time is stored anew", row.loop_id)
    return found


class _Fresh(NamedTuple):
    """What is to be stored of a stretch, how many of its samples were not there, and how many replace other values."""

    samples: Samples
    new: int
    replaced: int = 0


def _fresh(sent: Samples, stored: list[Stored], place: Place) -> _Fresh:
    """What was received later hides what is sent. What holds already is stored once more where an upload is unread that
    came in between: it may bring another value, which then must not hold."""
    if not stored:
        return _Fresh(sent, len(sent))
    later = [one.samples for one in stored if one.receipt_number > place.receipt_number]
    shown = sent if not later else _over(sent, later)
    whole = merged([one.samples for one in stored])
    found = compared(shown, whole)
    sure = [one.samples for one in stored if one.receipt_number >= place.unread_before]
    if len(sure) == len(stored):
        kept = found.new | found.other | refused_anew(sent, whole)
    elif sure:
        known = merged(sure)
        kept = news(shown, known) | refused_anew(sent, known)
    else:
        kept = np.ones(len(sent), dtype=bool)
    new, replaced = (int(np.count_nonzero(which)) for which in (found.new, found.other))
    return _Fresh(sent if kept.all() else sent.part(kept), new, replaced)


def _over(sent: Samples, later: list[Samples]) -> Samples:
    """What holds at the times of `sent` with all that came later laid over it."""
    whole = merged([sent, *later])
    return whole.part(np.searchsorted(whole.time_ns, sent.time_ns))


def _columns(samples: Samples) -> dict[str, Any]:
    return {
        "start_ns": int(samples.time_ns[0]),
        "end_ns": int(samples.time_ns[-1]),
        "samples": len(samples),
        "packed": samples.packed,
        **last_known(samples),
    }


def _note_newest(connection: Connection, rows: list[dict[str, Any]]) -> None:
    newest: dict[int, int] = {}
    for row in rows:
        newest[row["loop_id"]] = max(newest.get(row["loop_id"], row["end_ns"]), row["end_ns"])
    told = [{"id": loop_id, "newest_ns": end_ns} for loop_id, end_ns in sorted(newest.items())]
    if connection.dialect.name == "postgresql":
        sent = from_arrays(loops, ("id", "newest_ns")).subquery()
        later = (loops.c.newest_ns.is_(None)) | (loops.c.newest_ns < sent.c.newest_ns)
        raised = update(loops).where(loops.c.id == sent.c.id, later).values(newest_ns=sent.c.newest_ns)
        connection.execute(raised, columns_of(told))
        return
    connection.execute(
        update(loops)
        .where(loops.c.id == bindparam("loop"))
        .where((loops.c.newest_ns.is_(None)) | (loops.c.newest_ns < bindparam("newest"))),
        # `newest_ns` is set by name below: a bind of the same name as a column is refused.
        [{"loop": row["id"], "newest": row["newest_ns"], "newest_ns": row["newest_ns"]} for row in told],
    )


def _back_to(connection: Connection, loop_ids: list[int], since: ColumnElement[int]) -> Iterator[tuple[int, Samples]]:
    """Loop by loop, what its stretches hold that reach over that time."""
    query = (
        select(series.c.loop_id, series.c.id, series.c.packed)
        .join(loops, loops.c.id == series.c.loop_id)
        .where(series.c.end_ns >= since)
        .order_by(series.c.loop_id, *AS_RECEIVED)
    )
    for start in range(0, len(loop_ids), LOOPS_AT_ONCE):
        some = query.where(series.c.loop_id.in_(loop_ids[start : start + LOOPS_AT_ONCE]))
        rows = connection.execute(some).all()  # a cursor that a fault leaves open would keep SQLite locked
        for loop_id, stretches in groupby(rows, key=attrgetter("loop_id")):
            yield loop_id, merged([unpack_stored(row.id, row.packed) for row in stretches])


def _until(samples: Samples, until_ns: int) -> Samples:
    """All of it, where there is none before."""
    if samples.time_ns[-1] <= until_ns or samples.time_ns[0] > until_ns:
        return samples
    return samples.part(samples.time_ns <= until_ns)


def _newest(samples: Samples, since_ns: int, most_samples: int) -> Samples:
    """A copy, where it is not all of them: a view would hold on to what it leaves out."""
    first = max(int(np.searchsorted(samples.time_ns, since_ns)), len(samples) - most_samples)
    return samples.part(np.arange(len(samples)) >= first) if first > 0 else samples
