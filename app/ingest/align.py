"""A loop's signals on one time base.

Signals of one loop that were sampled together (wide files, scans of a historian) are joined on their times; where one
of them has no value it is NaN. Signals that were sampled each at its own times, or stored when they changed (compressed
data), cannot be audited row by row: PV's times are the base, and each other signal is brought to them: OP and further
signals by straight lines between their samples (that is what a swinging door keeps), SP and MODE by their last known
value (they step). Nothing is extrapolated beyond a signal's last sample except a step, and no line goes over a hole:
over a value that was refused, or an interval far longer than the long ones of a signal that is sampled evenly.

An OP that moves at nearly every scan and is stored when it changes looks sampled evenly, and its rests like holes: it
keeps the value that it rests at (see `_resting`).
`LoopSamples.resampled` names the signals that were treated so.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from app.ingest.model import FloatArray, LoopSamples, Signal, SignalBlock, TimeArray

BoolArray = NDArray[np.bool_]

SHARED_TIMES = 0.5  # of the rarer signal's times found among PV's: sampled together
HOLE_INTERVALS = 10.0  # of the long ones of a signal that is sampled evenly
LONG = 0.95  # of the intervals are not longer than a long one
FEWEST = 10  # intervals that show whether a signal is sampled evenly
EVEN = 1.5  # times the usual interval: whose long ones are shorter is sampled evenly, and not stored when it changes
SELDOM = 0.01  # of an OP's values are the one before again, at most, where it is stored when it changes
USUAL_MOVE = 0.99  # of an OP's moves are not larger than a usual one
STEPS = frozenset(("SP", "MODE"))
_OTHER: Signal = "OTHER"
_LEAST_OP, _MOST_OP = 0.0, 100.0  # per cent


def stretches(blocks: Iterable[SignalBlock]) -> Iterator[LoopSamples]:
    """Each loop of blocks that hold all of their loops; a loop's blocks are let go when it is taken."""
    loops: dict[str, list[SignalBlock]] = {}
    for block in blocks:
        loops.setdefault(block.loop, []).append(block)
    while loops:
        yield align(loops.pop(next(iter(loops))))


def align(blocks: Sequence[SignalBlock]) -> LoopSamples:
    """Joins blocks of one loop; several blocks of one signal may be given, a later one wins where times repeat."""
    by_key: dict[str, list[SignalBlock]] = {}
    for block in blocks:
        by_key.setdefault(block.tag if block.signal == "OTHER" else block.signal, []).append(block)
    joined = {key: _joined(parts) for key, parts in by_key.items()}
    base = _base(joined)
    together = {key: block for key, block in joined.items() if _sampled_together(block, base)}
    if all(_same(block.time_ns, base) for block in together.values()):
        time_ns = base
    else:
        time_ns = np.unique(np.concatenate([block.time_ns for block in together.values()]))
    apart = tuple(key for key in joined if key not in together)
    values = {key: _placed(block, time_ns, key in apart) for key, block in joined.items()}
    if "PV" in joined and "OP" in joined:
        values["OP"] = _at_rest(values["OP"], joined["OP"], time_ns, values["PV"])
    others = {key: values[key] for key, block in joined.items() if block.signal == "OTHER"}
    return LoopSamples(
        blocks[0].loop,
        time_ns,
        values.get("PV"),
        values.get("OP"),
        values.get("SP"),
        values.get("MODE"),
        MappingProxyType(others),
        apart,
    )


def realigned(stretch: LoopSamples, apart: BoolArray, sampled: Mapping[str, BoolArray]) -> LoopSamples:
    """A stretch laid together of files of which some had PV and OP apart, as if these had come in one.

    apart: (n,) whether they came apart at the row; the other rows stay as they are. sampled: by signal, or tag of a
    further one, (n,) whether it was sampled at the row, be its value refused.
    """
    bounds = np.flatnonzero(np.diff(apart)) + 1
    starts, ends = np.append(0, bounds).tolist(), np.append(bounds, len(apart)).tolist()
    spans = [slice(start, end) for start, end in zip(starts, ends, strict=True)]
    parts = [_realigned(stretch, span, sampled) if apart[span.start] else _part(stretch, span) for span in spans]
    others = {tag: _one_behind_the_other(parts, [part.others.get(tag) for part in parts]) for tag in stretch.others}
    return LoopSamples(
        stretch.loop,
        np.concatenate([part.time_ns for part in parts]),
        _one_behind_the_other(parts, [part.pv for part in parts]),
        _one_behind_the_other(parts, [part.op for part in parts]),
        _one_behind_the_other(parts, [part.sp for part in parts]),
        _one_behind_the_other(parts, [part.automatic for part in parts]),
        MappingProxyType({tag: values for tag, values in others.items() if values is not None}),
        tuple(dict.fromkeys(key for part in parts for key in part.resampled)),
    )


def _one_behind_the_other(parts: Sequence[LoopSamples], own: Sequence[FloatArray | None]) -> FloatArray | None:
    """A signal's values, part by part; None where no part has it."""
    if all(values is None for values in own):
        return None
    pairs = zip(parts, own, strict=True)
    return np.concatenate([np.full(part.samples, np.nan) if values is None else values for part, values in pairs])


def _part(stretch: LoopSamples, span: slice) -> LoopSamples:
    pv, op, sp, automatic = (
        None if values is None else values[span] for values in (stretch.pv, stretch.op, stretch.sp, stretch.automatic)
    )
    others = {tag: values[span] for tag, values in stretch.others.items()}
    return LoopSamples(stretch.loop, stretch.time_ns[span], pv, op, sp, automatic, MappingProxyType(others))


def _realigned(stretch: LoopSamples, span: slice, sampled: Mapping[str, BoolArray]) -> LoopSamples:
    """Of a span; as it is where PV or OP have no value in it."""
    part = _part(stretch, span)
    if part.pv is None or part.op is None or not (np.any(np.isfinite(part.pv)) and np.any(np.isfinite(part.op))):
        return part
    signals: dict[Signal, FloatArray | None] = {"PV": part.pv, "OP": part.op, "SP": part.sp, "MODE": part.automatic}
    own = [(name, name, values) for name, values in signals.items() if values is not None]
    blocks = []
    for tag, signal, values in (*own, *((tag, _OTHER, values) for tag, values in part.others.items())):
        given = np.isfinite(values)
        given |= sampled[tag][span] if tag in sampled else False
        blocks.append(SignalBlock(tag, stretch.loop, signal, part.time_ns[given], values[given]))
    return align([block for block in blocks if len(block.time_ns)])


def _joined(parts: list[SignalBlock]) -> SignalBlock:
    if len(parts) == 1:
        return parts[0]
    time_ns = np.concatenate([part.time_ns for part in parts])
    value = np.concatenate([part.value for part in parts])
    if not np.all(time_ns[1:] > time_ns[:-1]):
        time_ns, value = _sorted_once(time_ns, value)
    return SignalBlock(parts[0].tag, parts[0].loop, parts[0].signal, time_ns, value)


def _sorted_once(time_ns: TimeArray, value: FloatArray) -> tuple[TimeArray, FloatArray]:
    """In order of time; of several values for one time the last that is one."""
    given = np.isfinite(value)
    order = np.lexsort((np.arange(len(value)), given, time_ns))
    time_ns, value = time_ns[order], value[order]
    last = np.concatenate((time_ns[1:] != time_ns[:-1], [True]))
    return time_ns[last], value[last]


def _base(joined: Mapping[str, SignalBlock]) -> TimeArray:
    for key in ("PV", "OP"):
        if key in joined:
            return joined[key].time_ns
    return max((block.time_ns for block in joined.values()), key=len)


def _same(first: TimeArray, second: TimeArray) -> bool:
    return first is second or (len(first) == len(second) and bool(np.array_equal(first, second)))


def _sampled_together(block: SignalBlock, base: TimeArray) -> bool:
    """Half of the rarer one's times are the other's; what is written only when it changes is not sampled together: a
    set point, or a signal that is stored unevenly at times of an even scan."""
    times = block.time_ns
    if _same(times, base) or not len(times) or not len(base):
        return True
    stored = block.signal in STEPS or (_is_even(base) and not _is_even(times))
    if stored and len(times) < SHARED_TIMES * len(base):
        return False
    if times[0] > base[-1] or times[-1] < base[0]:
        return True  # another stretch of a long file: nothing to bring over
    shared = len(np.intersect1d(times, base, assume_unique=True))
    return shared >= SHARED_TIMES * min(len(times), len(base))


def _is_even(time_ns: TimeArray) -> bool:
    steps = np.diff(time_ns)
    return len(steps) < FEWEST or bool(np.quantile(steps, LONG) <= EVEN * np.median(steps))


def _placed(block: SignalBlock, time_ns: TimeArray, resample: bool) -> FloatArray:
    if _same(block.time_ns, time_ns):
        return block.value
    if resample:
        return _held(block, time_ns) if block.signal in STEPS else _between(block, time_ns)
    placed = np.full(len(time_ns), np.nan)
    placed[np.searchsorted(time_ns, block.time_ns)] = block.value
    return placed


def carried(values: FloatArray) -> FloatArray:
    """(n,) with the last known value in the place of each missing one; NaN before the first."""
    known = np.isfinite(values)
    if np.all(known) or not np.any(known):
        return values
    at = np.maximum.accumulate(np.where(known, np.arange(len(values)), -1))
    return np.where(at >= 0, values[np.maximum(at, 0)], np.nan)


def _held(block: SignalBlock, time_ns: TimeArray) -> FloatArray:
    given = np.isfinite(block.value)
    times, values = block.time_ns[given], block.value[given]
    if not len(times):
        return np.full(len(time_ns), np.nan)
    at = np.searchsorted(times, time_ns, side="right") - 1
    return np.where(at >= 0, values[np.maximum(at, 0)], np.nan)


def _between(block: SignalBlock, time_ns: TimeArray) -> FloatArray:
    given = np.isfinite(block.value)
    times, values = block.time_ns[given], block.value[given]
    if not len(times):
        return np.full(len(time_ns), np.nan)
    line = np.interp(
        (time_ns - times[0]).astype(np.float64), (times - times[0]).astype(np.float64), values, np.nan, np.nan
    )
    before = np.searchsorted(times, time_ns, side="right") - 1
    in_hole = _holes(block.time_ns, block.value)[before] & (times[before] < time_ns)
    return np.where(in_hole, np.nan, line)


def _holes(time_ns: TimeArray, value: FloatArray) -> BoolArray:
    """By known value: whether nothing is known between it and the next one: a value was refused, or the samples of an
    even scan stay out. Of a signal that is stored when it changes a long interval tells that it rested or ran straight.
    """
    at = np.flatnonzero(np.isfinite(value))
    steps = np.diff(time_ns[at])
    hole = np.diff(at) > 1
    if len(steps) and _is_even(time_ns[at]):
        hole |= steps > HOLE_INTERVALS * np.quantile(steps, LONG)
    return np.append(hole, False)


def _at_rest(placed: FloatArray, op: SignalBlock, time_ns: TimeArray, pv: FloatArray) -> FloatArray:
    """OP at the loop's times (n,), from one stored value to the next with that which it rests at where PV is known."""
    if _same(op.time_ns, time_ns):
        return placed
    known = np.isfinite(op.value)
    times, values = op.time_ns[known], op.value[known]
    resting = _resting(op.value, times, time_ns[np.isfinite(pv)])
    if not np.any(resting):
        return placed
    before = np.searchsorted(times, time_ns, side="right") - 1
    held = np.isnan(placed) & np.isfinite(pv) & (before >= 0) & resting[before]
    return np.where(held, values[before], placed)


def _resting(op: FloatArray, times: TimeArray, pv_times: TimeArray) -> BoolArray:
    """By known value of OP (m,), whether it stood at it until the next one. Scanned as PV is, it was stored when it
    changed: no value comes twice in turn, as a scan stores them, so that samples that stay out do not tell a hole. It
    stood where PV went on meanwhile, no value was refused, and it left by no more than a usual move: more is what it
    would have moved unseen. Behind its last value it may rest, or be stored no more: it rests where it had done so for
    long at the same value, as at a limit, or where it ends at one of per cent. Elsewhere there is a hole: of 34
    recorded loops, OP taken away for the last 40 %, 4 had another verdict where it was held, none with the hole."""
    at = np.flatnonzero(np.isfinite(op))
    values = op[at]
    if len(times) <= FEWEST or len(pv_times) <= FEWEST:
        return np.zeros(len(times), dtype=bool)
    steps, pv_steps, moves = np.diff(times), np.diff(pv_times), np.abs(np.diff(values))
    usual, pv_usual = float(np.median(steps)), float(np.median(pv_steps))
    scanned = steps <= EVEN * usual
    alike = pv_usual / EVEN <= usual <= EVEN * pv_usual
    if not alike or np.mean(moves[scanned] == 0) > SELDOM:
        return np.zeros(len(times), dtype=bool)
    out = np.flatnonzero(pv_steps > HOLE_INTERVALS * np.quantile(pv_steps, LONG))
    until = np.append(times[1:], pv_times[-1])
    goes_on = np.searchsorted(pv_times[out], until) == np.searchsorted(pv_times[out + 1], times, "right")
    next_to = np.diff(np.append(at, len(op))) == 1
    rests = goes_on[:-1] & next_to[:-1] & (moves <= np.quantile(moves, USUAL_MOVE))
    for_long = values[:-1][rests & (steps > HOLE_INTERVALS * usual)]
    stays = bool(np.isin(values[-1], for_long)) or _ends_at_limit(values)
    return np.append(rests, goes_on[-1] & next_to[-1] & stays)


def _ends_at_limit(op: FloatArray) -> bool:
    """Whether OP ends at a limit of per cent beyond which it never was: what passes by hardly stops there."""
    return bool((op[-1] == _LEAST_OP and op[-1] == op.min()) or (op[-1] == _MOST_OP and op[-1] == op.max()))
