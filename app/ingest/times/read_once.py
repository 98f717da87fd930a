"""Stamps of an hour that comes twice in autumn, of which a file has one pass alone: whether its rows tell which."""

from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from app.ingest.model import TimeArray
from app.ingest.times.time_reader import from_utc
from app.nanoseconds import NS_PER_S

_AROUND_S = 3600  # beside the hour, for what its rows go on from
_GRID_NS = 1800 * NS_PER_S  # clocks are set at whole and half hours of UTC
_HOLE_STEPS, _LONG = 3, 0.95  # a hole is so many times as long as the long ones among the steps
_SHOWN = 3


@dataclass(frozen=True)
class Turn:
    """A clock is set back at `at_ns` (UTC), by `span_s`."""

    zone: str
    at_ns: int
    span_s: int

    @property
    def start_ns(self) -> int:
        """Where what is looked at begins."""
        return self.at_ns - (self.span_s + _AROUND_S) * NS_PER_S

    @property
    def length_s(self) -> int:
        return 2 * (self.span_s + _AROUND_S)

    @property
    def passes_s(self) -> tuple[int, int, int]:
        """Begin of the first pass, of the second one, and the end, from the start on."""
        return _AROUND_S, _AROUND_S + self.span_s, _AROUND_S + 2 * self.span_s

    def inside(self, seconds: NDArray[np.intp]) -> NDArray[np.intp]:
        begin, _, end = self.passes_s
        return seconds[(seconds >= begin) & (seconds < end)]

    def both(self, seconds: NDArray[np.intp]) -> bool:
        """Whether seconds from the start on, in order, lie in both passes."""
        inside = self.inside(seconds)
        return len(inside) > 0 and bool(inside[0] < self.passes_s[1] <= inside[-1])


@dataclass
class TurnsMet:
    """The seconds in which rows lie about each turn, as blocks come."""

    _seen: dict[Turn, NDArray[np.bool_]] = field(default_factory=dict)
    _told: dict[Turn, bool] = field(default_factory=dict)  # whether there is a block with both passes

    def saw(self, time_ns: TimeArray, zone: str, of_tag: bool = False) -> None:
        """time_ns: (n,) in order, UTC. zone: of the clock that they were read from. of_tag: all that a tag has; one tag
        in the one pass and one in the other tell nothing then."""
        if zone == "UTC" or not len(time_ns):
            return
        first, last = (datetime.fromtimestamp(int(time_ns[at]) // NS_PER_S, UTC).year for at in (0, -1))
        for turn in (turn for year in range(first, last + 1) for turn in _turns(zone, year)):
            bounds = np.array([turn.start_ns, turn.start_ns + turn.length_s * NS_PER_S])
            begin, end = np.searchsorted(time_ns, bounds)
            if begin < end:
                seen = self._seen.setdefault(turn, np.zeros(turn.length_s, dtype=bool))
                seconds = (time_ns[begin:end] - turn.start_ns) // NS_PER_S
                seen[seconds] = True
                self._told[turn] = self._told.get(turn, False) or not of_tag or turn.both(seconds)

    def notes(self) -> list[str]:
        found = ((turn, self._in_doubt(turn, np.flatnonzero(seen))) for turn, seen in self._seen.items())
        return [_note(turn, which) for turn, which in found if which][:_SHOWN]

    def _in_doubt(self, turn: Turn, seconds: NDArray[np.intp]) -> str:
        """As which stamps were read, though the rows do not tell it; empty where they do, or there are none."""
        if turn.both(seconds):
            return "" if self._told[turn] else "first ones of some tags and the second ones of others"
        return _pass_in_doubt(turn, seconds)


def puts_clocks_back(zone: str, first_ns: int, last_ns: int) -> bool:
    """Whether the clocks of a zone are, in one of the years from one time to another (UTC)."""
    first, last = (datetime.fromtimestamp(at // NS_PER_S, UTC).year for at in (first_ns, last_ns))
    return zone != "UTC" and any(_turns(zone, year) for year in range(first, last + 1))


@lru_cache(maxsize=1 << 10)
def _turns(zone: str, year: int) -> tuple[Turn, ...]:
    """Those of a year in which what a clock showed comes again."""
    first, end = (int(datetime(of, 1, 1, tzinfo=UTC).timestamp()) * NS_PER_S for of in (year, year + 1))
    grid = np.arange(first, end + 1, _GRID_NS)
    back_ns = -np.diff(from_utc(grid, zone) - grid)
    return tuple(Turn(zone, int(grid[at + 1]), int(back_ns[at]) // NS_PER_S) for at in np.flatnonzero(back_ns > 0))


def _pass_in_doubt(turn: Turn, seconds: NDArray[np.intp]) -> str:
    """Of rows in one pass. They tell it where they go on without a hole from earlier stamps into the first one, or
    from the second one into later stamps, and not both."""
    begin, middle, end = turn.passes_s
    inside = turn.inside(seconds)
    if not len(inside):
        return ""
    is_first = bool(inside[0] < middle)
    steps = np.diff(seconds)
    hole_s = min(_HOLE_STEPS * float(np.quantile(steps, _LONG)) if len(steps) else 0.0, turn.span_s / 2)
    before, after = seconds[seconds < begin], seconds[seconds >= end]
    entry_s = inside[0] - before[-1] - (0 if is_first else turn.span_s) if len(before) else np.inf
    leaving_s = after[0] - inside[-1] - (turn.span_s if is_first else 0) if len(after) else np.inf
    entered, left = entry_s <= hole_s, leaving_s <= hole_s
    whole = len(inside) == 1 or np.diff(inside).max() <= hole_s
    if whole and entered != left and entered == is_first:
        return ""
    return "first ones" if is_first else "second ones"


def _note(turn: Turn, which: str) -> str:
    start_ns = int(from_utc(np.array([turn.at_ns]), turn.zone)[0])
    start, end = (datetime.fromtimestamp(at // NS_PER_S, UTC) for at in (start_ns, start_ns + turn.span_s * NS_PER_S))
    return (
        f"stamps from {start:%H:%M} to {end:%H:%M} on {start:%Y-%m-%d} come twice in {turn.zone}: those here were read "
        f"as the {which}, which their rows do not tell for sure"
    )
