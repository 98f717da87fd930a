"""Samples of one loop: packed into the bytes of a row and back, and laid over each other."""

import hashlib
import json
import struct
import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from typing import NamedTuple

import numpy as np
import zstandard
from numpy.typing import NDArray

from app.nanoseconds import NS_PER_DAY
from app.storage.coding import AS_IT_IS, coded, coded_each, decoded, shuffled, unshuffled, width

FloatArray = NDArray[np.float64]
TimeArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

FORMAT = 2
FORMATS = (1, FORMAT)  # of format 1 the head is a list of names, and each signal stands as it is
LEVEL = 3
HEADER = struct.Struct("<BII")  # format, samples, length of the head
LONGEST_NAMES = 1 << 20
PAIR = ("pv", "op")
DAMAGED = (ValueError, TypeError, AttributeError, OverflowError, MemoryError, struct.error, zstandard.ZstdError)
"""What unpacking raises where bytes are missing or others than were written."""
_own = threading.local()


class DamagedStretchError(Exception):
    """What is stored is not what was written: a fault of the disk or of ours."""


@dataclass(frozen=True, eq=False)
class Samples:
    """A stretch of one loop's samples on one time base.

    time_ns: (n,) increasing, ns since 1970 UTC. signals: (n,) each, NaN where missing; by name: "pv", "op", "sp",
    "automatic" (1, 0, NaN), further signals by their tag. Neither is changed once its fingerprint or its packed bytes
    were asked for: they are made once. held_ns: of signals whose first value here was stated before, when. sampled:
    by signal, (n,) whether a stretch that brought it has the row, be its value refused; none: that is not known.
    apart: (n,) whether PV and OP came apart at the row. These three are not packed.
    """

    time_ns: TimeArray
    signals: Mapping[str, FloatArray]
    held_ns: Mapping[str, int] = field(default_factory=dict)
    sampled: Mapping[str, BoolArray] = field(default_factory=dict)
    apart: BoolArray | None = None

    def __len__(self) -> int:
        return len(self.time_ns)

    @cached_property
    def fingerprint(self) -> str:
        digest = _times(self.time_ns).digest.copy()
        for name in sorted(self.signals):
            digest.update(name.encode())
            digest.update(np.ascontiguousarray(self.signals[name], dtype="<f8").data)
        return digest.hexdigest()

    @cached_property
    def packed(self) -> bytes:
        return pack(self)

    def part(self, where: slice | BoolArray | NDArray[np.int64]) -> "Samples":
        signals = {name: values[where] for name, values in self.signals.items()}
        sampled = {name: rows[where] for name, rows in self.sampled.items()}
        apart = None if self.apart is None else self.apart[where]
        return Samples(self.time_ns[where], signals, sampled=sampled, apart=apart)

    def has_sampled(self, name: str) -> BoolArray:
        """(n,) whether the signal was sampled at each row, be its value refused."""
        known = self.sampled.get(name)
        return known if known is not None else np.full(len(self), name in _brought(self))


def pack(samples: Samples, codings: Iterable[tuple[str, bytes]] | None = None) -> bytes:
    """Times as differences, then each signal in the fewest bytes that give its values again. codings: what `coded`
    gives of each signal, where that is known."""
    codings = map(coded, samples.signals.values()) if codings is None else codings
    columns = dict(zip(samples.signals, codings, strict=True))
    head = json.dumps({name: coding for name, (coding, _) in columns.items()}).encode()
    times = _times(samples.time_ns).differences
    body = compressor().compress(b"".join((times, *(raw for _, raw in columns.values()))))
    return HEADER.pack(FORMAT, len(samples), len(head)) + head + body


def prepare(batch: Sequence[Samples]) -> None:
    """Makes the fingerprint and the packed bytes of each now, so that they are there when they are asked for."""
    codings = coded_each(values for samples in batch for values in samples.signals.values())
    for samples in batch:
        vars(samples)["packed"] = pack(samples, islice(codings, len(samples.signals)))
        _ = samples.fingerprint


class _Times:
    """What the fingerprint and the packed bytes take from the times alone: loops of one scan share them."""

    def __init__(self, time_ns: TimeArray) -> None:
        self.time_ns = time_ns

    @cached_property
    def digest(self) -> "hashlib.blake2b":
        return hashlib.blake2b(np.ascontiguousarray(self.time_ns, dtype="<i8").data, digest_size=20)

    @cached_property
    def differences(self) -> bytes:
        return shuffled(np.diff(self.time_ns, prepend=0))


def _times(time_ns: TimeArray) -> _Times:
    """Those of the array asked for last in this thread are kept; like any array of samples it never changes."""
    known: _Times | None = getattr(_own, "times", None)
    if known is None or known.time_ns is not time_ns:
        known = _own.times = _Times(time_ns)
    return known


def compressor() -> zstandard.ZstdCompressor:
    """One a thread, as it serves one at a time: making it costs as much as it takes to press a day. Without a checksum
    damage is mostly unseen."""
    if not hasattr(_own, "compressor"):
        _own.compressor = zstandard.ZstdCompressor(LEVEL, write_checksum=True)
    return _own.compressor


def unpack(packed: bytes) -> Samples:
    """The samples that `pack` was given. Raises ValueError where the bytes are not of a format this version knows, and
    one of `DAMAGED` where they are not what was packed."""
    version, n, length = HEADER.unpack_from(packed)
    if version not in FORMATS or length > LONGEST_NAMES:
        raise ValueError(f"packed samples of format {version}, this version knows {FORMATS}")
    start = HEADER.size + length
    told = json.loads(packed[HEADER.size : start])
    codings: dict[str, str] = told if version == FORMAT else dict.fromkeys(told, AS_IT_IS)
    size = n * (8 + sum(map(width, codings.values())))
    body = zstandard.ZstdDecompressor().decompress(packed[start:], max_output_size=size)
    if len(body) != size:
        raise ValueError(f"{len(body)} bytes of samples, {size} are needed")
    time_ns, end = np.cumsum(unshuffled(body[: 8 * n], "<i8")), 8 * n
    signals = {}
    for name, coding in codings.items():
        begin, end = end, end + n * width(coding)
        signals[name] = decoded(coding, body[begin:end])
    return Samples(time_ns, signals)


def unpack_stored(stretch_id: int, packed: bytes) -> Samples:
    """The samples of a row of `series`. Raises DamagedStretchError, which names it, where they cannot be read."""
    try:
        return unpack(packed)
    except DAMAGED as error:
        text = f"stretch {stretch_id} of the stored samples cannot be read ({type(error).__name__}: {error})"
        raise DamagedStretchError(text) from error


def merged(stretches: Sequence[Samples]) -> Samples:
    """Stretches in the order in which they came, laid over each other: of two values at one time the later one holds.

    A missing value never hides one that is there.
    """
    if len(stretches) == 1:
        return stretches[0]
    times = np.unique(np.concatenate([stretch.time_ns for stretch in stretches]))
    names = list(dict.fromkeys(name for stretch in stretches for name in stretch.signals))
    signals = {name: np.full(len(times), np.nan) for name in names}
    for stretch in stretches:
        places = np.searchsorted(times, stretch.time_ns)
        for name, values in stretch.signals.items():
            known = ~np.isnan(values)
            signals[name][places[known]] = values[known]
    sampled = {name: np.zeros(len(times), dtype=np.bool_) for name in names}
    apart = np.full(len(times), all(name in signals for name in PAIR))
    for stretch in stretches:
        places = np.searchsorted(times, stretch.time_ns)
        for name in _brought(stretch):
            sampled[name][places] |= stretch.has_sampled(name)
        if all(name in _known(stretch) for name in PAIR):
            _no_more_apart(apart, places, stretch)
    return Samples(times, signals, sampled=sampled, apart=apart if np.any(apart) else None)


def _known(stretch: Samples) -> list[str]:
    """The signals that have a value."""
    return [name for name, values in stretch.signals.items() if not np.all(np.isnan(values))]


def _brought(stretch: Samples) -> list[str]:
    """The signals that have a value; all where none has: then their values were refused. A column that is always empty
    beside another one brings nothing."""
    return _known(stretch) or list(stretch.signals)


def _no_more_apart(apart: BoolArray, places: NDArray[np.int64], joint: Samples) -> None:
    """joint: has PV and OP from its first to its last sample, unless it pauses for days. places: of its rows."""
    ends = np.append(np.flatnonzero(np.diff(joint.time_ns) > NS_PER_DAY), len(joint) - 1)
    begins = np.append(0, ends[:-1] + 1)
    own = np.ones(len(places), dtype=np.bool_) if joint.apart is None else ~joint.apart
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        together = places[begin : end + 1][own[begin : end + 1]]
        if len(together):
            apart[together[0] : together[-1] + 1] = False


class Compared(NamedTuple):
    """Of samples that are sent beside what is stored, (n,) each. new: at a time, or of a signal, of which nothing is
    there. other: another value is there in its place; one where none is replaces nothing."""

    new: BoolArray
    other: BoolArray


def compared(sent: Samples, stored: Samples) -> Compared:
    if not len(stored):
        return Compared(np.ones(len(sent), dtype=np.bool_), np.zeros(len(sent), dtype=np.bool_))
    places = np.minimum(np.searchsorted(stored.time_ns, sent.time_ns), len(stored) - 1)
    there = stored.time_ns[places] == sent.time_ns
    new, other = ~there, np.zeros(len(sent), dtype=np.bool_)
    for name, values in sent.signals.items():
        differs = there & ~np.isnan(values)
        before = stored.signals.get(name)
        if before is not None:
            differs &= values != before[places]
            replaced = np.flatnonzero(differs)
            replaced = replaced[~np.isnan(before[places[replaced]])]
            other[replaced] = True
        new |= differs
    return Compared(new & ~other, other)


def news(sent: Samples, stored: Samples) -> BoolArray:
    """Which samples of `sent` are not in `stored` yet: new times, new signals, other values."""
    found = compared(sent, stored)
    return found.new | found.other


def refused_anew(sent: Samples, stored: Samples) -> BoolArray:
    """Which samples of `sent`, of PV or OP alone, were refused where nothing of that signal is in `stored` yet: not to
    know them would be to take it for unchanged there."""
    brought = _brought(sent)
    if len(brought) != 1 or brought[0] not in PAIR or not len(stored):
        return np.zeros(len(sent), dtype=np.bool_)
    places = np.minimum(np.searchsorted(stored.time_ns, sent.time_ns), len(stored) - 1)
    return np.isnan(sent.signals[brought[0]]) & ~stored.has_sampled(brought[0])[places]
