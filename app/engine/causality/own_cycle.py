"""Whether the cycle of a loop is its own valve's: a valve that makes a loop cycle sticks for much of what OP moves.

What comes from elsewhere in corners and ramps, a neighbour's valve, a pump, a batch, makes the shapes of such a cycle
too. But there a stem that rests for so long tells nothing of what PV does next, because the valve followed OP.
"""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.causality.stem_search import PARTS, STRIDES, Asked, asked_of, moving_part
from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.sampled import piece_ranges, unlike
from app.engine.signals.turning import relays, stems, usual_range

SHARES, JUMPS = (0.4, 0.55, 0.7, 0.85, 1.0), (0.1, 0.6)
"""S over what OP moves in a cycle, and J over S, of the valves that are tried."""

TURNS = np.geomspace(0.03, 0.6, 8)
"""By how much of its range PV has turned, and how far it is on one side of the set point: what tells which way a load
goes, as a stem does because it turns where OP does."""

CLEAR_NATS = 0.5
"""Nats a cycle from which a cycle is clearly the valve's. Where it is likely by its shapes (0.6 to 0.85), 33 of 64
simulated valves that stick have them, and 16 of 143 healthy loops that are shaken in corners and ramps."""

TELLING, FEWEST_CYCLES, FINE = 1000, 15, 60
"""Means and cycles from which a valve that makes its loop cycle is missed where no stem tells of it, and samples a
cycle from which it is where one tells less than is clear: in a coarser cycle real valves tell less, and in a long
record the least of telling pays."""


@dataclass(frozen=True)
class OwnCycle:
    """What the stems of such valves tell of PV. nats_a_cycle: of the first that shows it, or of the best.
    all_the_time, lately: whether it has its share of what is needed in each third of the record, and in the newest two.
    means, cycles: how much of PV was looked at, at most. fine: whether a cycle has samples enough for what is clear.
    """

    nats_a_cycle: float = 0.0
    all_the_time: bool = False
    lately: bool = False
    means: int = 0
    cycles: float = 0.0
    fine: bool = False

    @property
    def shown(self) -> bool:
        return self.all_the_time and self.nats_a_cycle >= CLEAR_NATS

    @property
    def missed(self) -> bool:
        """Whether such a valve would have been seen, and was not: one that sticks by now may have begun to."""
        told = self.lately and (self.nats_a_cycle >= CLEAR_NATS or not self.fine)
        return self.means >= TELLING and self.cycles >= FEWEST_CYCLES and not told


def could_be_missed(record: UniformRecord) -> bool:
    """Whether a record may be long enough for a valve that makes its loop cycle to be seen, or missed."""
    return record.samples >= STRIDES[0] * TELLING


def own_cycle(record: UniformRecord, period_s: float) -> OwnCycle:
    """Whether a loop that cycles with this period goes as behind a valve that sticks for much of what OP moves in it.

    As `hidden_band` asks it, beside what PV itself tells of a load that goes one way for a while and then the other.
    Misleads: even, strong triangles under little noise show as an own cycle, and many quick ones are not told from it.
    A valve that sticks is missed where it lets go softly in a record with few cycles, and where noise is as large as S.
    Source: the valves are Kano's (Kano et al. 2004, Practical model and detection algorithm for valve stiction).
    """
    moving = moving_part(record)
    if moving is None:
        return OwnCycle()
    period = max(period_s / moving.sampling_interval_s, 2.0)
    moved = cycle_stems(moving.op, period)
    turned, beyond = turned_stems(moving.pv), relays(_error(moving), TURNS)
    told = (asked.beside(turned).beside(beyond) for asked in asked_of(moving))
    found: list[OwnCycle] = []
    for answer in (_on(one, moved, period) for one in told if not one.known.foretells_all):
        found.append(answer)
        if answer.shown:
            break
    best = max(found, key=lambda one: (one.all_the_time, one.lately, one.nats_a_cycle), default=OwnCycle())
    return replace(
        best,
        means=max((one.means for one in found), default=0),
        cycles=max((one.cycles for one in found), default=0.0),
        fine=period >= FINE,
    )


def cycle_stems(op: FloatArray, period: float) -> FloatArray:
    """(M, N): where valves that stick for much of what OP (N,) moves in a cycle of so many samples have their stems."""
    share = in_a_cycle(op, period) / usual_range(op)
    return np.vstack([stems(op, share * np.array(SHARES), jump) for jump in JUMPS])


def turned_stems(pv: FloatArray) -> FloatArray:
    """(M, N): by how much PV (N,) has itself turned, in the sizes that are tried."""
    return stems(pv, TURNS, JUMPS[0])


def in_a_cycle(op: FloatArray, period: float) -> float:
    """How far OP mostly moves within so many samples."""
    return float(np.median(piece_ranges(op, min(round(period), len(op)))))


def _on(asked: Asked, moved: FloatArray, period: float) -> OwnCycle:
    _, worth = asked.most_worth(moved)
    cycles = asked.means * asked.lags.stride / period
    pays = PARTS * worth > asked.needed(len(moved))
    return OwnCycle(float(worth.sum()) / cycles, bool(pays.all()), bool(pays[1:].all()), asked.means, cycles)


def _error(record: UniformRecord) -> FloatArray:
    """The control error. Where PV never gets to where SP mostly is, as in two units, or without SP, what PV does beside
    SP, less where it mostly is.
    """
    if record.sp is not None and float(record.pv.min()) <= float(np.median(record.sp)) <= float(record.pv.max()):
        return record.pv - record.sp
    left = record.pv if record.sp is None else unlike(record.pv, record.sp)
    return left - np.median(left)
