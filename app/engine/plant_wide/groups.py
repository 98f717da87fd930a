"""Loops that oscillate together, and which of them is likeliest to shake the others."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.special import pdtrc

from app.engine.plant_wide.swing import BAND_EDGES_HZ, ComplexArray, Swing
from app.engine.recording import Array32, BoolArray, FloatArray, IntArray

IN_STEP = 0.7
"""Coherence from which two loops count as shaken by the same thing: among swings that wander chance reaches it in about
one pair of a thousand (17 lines under a Hann window have some 11 independent ones; (1 - 0.49)^10). Two limit cycles of
nearly one period hold so few lines that it reaches it often: there the probability of a shared period has to tell."""

AS_ONE = 0.95
"""Coherence from which one swing may be nothing but the answer to another. Of 43 simulated valves that shake others
each has 0.98 and more with them; valves that stick by themselves, at one period by coincidence, have up to 0.93."""

CHANCE = 0.01
"""A group counts as shown where chance would bring so many loops together with less than this probability."""

UNNAMED = 0.1
"""Above this probability of chance no source is named: nothing need shake such loops together, so none of them should
be looked at first for the others' sake. Below it a pair of a real plant that is known to interact has 0.03."""

ALIKE = 0.8
"""Likeness of the spectra from which loops of the same unit and period are grouped though they are not in step."""

FEWEST_CYCLES = 10.0
"""Below so many cycles everything regular looks in step with everything of about its period."""

PASSING = 1.0 / 3.0
"""Of so little of its record a swing is what one event left behind, as a step of the set point does, unless it has
FEWEST_CYCLES there: what is driven wanders over half of it, a limit cycle has all of it."""

TOGETHER = 0.5
"""How many loops so coherent chance may bring at most where as many as there are come by chance with less than CHANCE:
valves that stick in nearly pure limit cycles, and what they shake, are told from others only together."""

HANN_SHARE = 11.0 / 17.0
"""How many independent lines a line under a Hann window is."""

PURE = 0.5
"""The exponent for two swings of hardly more than a line: a frequency, one real number, is all in which they differ. Of
two within a line and a half under a Hann window a share of 0.75 (1 - c^2)^(1/2) is more coherent than c."""

GRID = 512
_LARGEST = 4000
_ONSET_RISE = 0.35
_ONSET_WEIGHT = 1.5
_NOTHING_STICKS = 0.5
_ALIKE_APART = (0.03, 0.75)  # periods of loops that look alike: by a share of them and so many lines
_SAME_TIMES = 0.05  # of the shorter record
_LEAST_APART = 1e-4  # of 1 - c^2: no two swings of a plant are one
_LEAST_SPREAD = float(np.log(20.0))


@dataclass(frozen=True, eq=False)
class Candidate:
    """An oscillating loop. stiction_probability: 0..1, or None where it was not judged. unit: plant unit, or None."""

    tag: str
    swing: Swing
    stiction_probability: float | None
    unit: str | None = None


def may_be_shaken(coherence: float, sticks: bool) -> bool:
    """Whether a loop may be shaken by one that it is so coherent with. sticks: whether its own valve likely does."""
    return coherence >= (AS_ONE if sticks else IN_STEP)


@dataclass(frozen=True)
class Suspect:
    """A member of a group, as a possible source.

    score: log-odds of stiction, less what a late onset takes off; the greatest is the likeliest source.
    onset_s: when its oscillation began on the common clock, or None where it swings from the start of the record.
    coherence: with the likeliest source, 0..1; 0 where their records do not overlap.
    lag_s: how long after the likeliest source its PV swings, within half a period to either side; None where the two
    are not in step. It says nothing on which one shakes which: a loop may answer a slow upset ahead of it.
    same_times: whether its record is of the times of the likeliest source's. Windows over other times let two loops
    that are one be as little as IN_STEP.
    """

    tag: str
    stiction_probability: float | None
    score: float
    onset_s: float | None
    coherence: float
    lag_s: float | None
    same_times: bool = True

    @property
    def sticks(self) -> bool:
        """Likelier than not."""
        return (self.stiction_probability or 0.0) > _NOTHING_STICKS

    @property
    def may_be_shaken(self) -> bool:
        """By the likeliest source. A valve that sticks swings by itself: it is shaken only if it does nothing else."""
        return may_be_shaken(self.coherence, self.sticks and self.same_times)


@dataclass(frozen=True)
class Group:
    """Loops that oscillate together, the likeliest source first.

    in_step: amplitude and phase wander together; False: same unit, period and spectrum.
    chance_probability: that so many of the candidates share a period by chance, if periods are spread evenly (in their
    logarithm) over what the candidates have, at least a factor of 20; in step, that they are as coherent besides. Pairs
    among many loops mostly are chance, unless what they share wanders.
    accounted: whether what the likeliest source does may be what the others share. It is not where none of them can be
    shaken by it, and where they are AS_ONE with each other and not with it.
    source: tag of the likeliest source; None where the loops share their period by chance with more than UNNAMED,
    where no member is likelier to stick than not, and where that one does not account for the others: the source is
    then outside of the loops that were judged, or there are several.
    """

    period_s: float
    in_step: bool
    chance_probability: float
    suspects: tuple[Suspect, ...]
    accounted: bool = True

    @property
    def by_chance(self) -> bool:
        return not self.in_step or self.chance_probability > CHANCE

    @property
    def source(self) -> str | None:
        best = self.suspects[0]
        told = best.sticks and self.accounted and self.chance_probability <= UNNAMED
        return best.tag if told else None

    @property
    def shaken(self) -> tuple[Suspect, ...]:
        """The members that swing in step with the source, so that it may be what gives their swing its shape. A valve
        that sticks makes a wave of corners and ramps, and a healthy loop that answers it looks as if its own stuck.
        """
        if self.source is None or not self.in_step:
            return ()
        return tuple(suspect for suspect in self.suspects[1:] if suspect.may_be_shaken)


@dataclass(frozen=True, eq=False)
class _Waves:
    """Narrow-band PV of every candidate: values (M, GRID) complex, zero outside of its record. together: (M,) by number
    those whose records hang together in time, grids_s: (numbers, GRID) their times. An old record would stretch one
    grid for all until few points are left of each.
    """

    grids_s: FloatArray
    values: ComplexArray
    inside: BoolArray
    together: IntArray

    def time_s(self, row: int) -> FloatArray:
        """(GRID,)"""
        return self.grids_s[self.together[row]]

    @cached_property
    def power(self) -> Array32:
        """(M, GRID)"""
        return np.abs(self.values) ** 2

    @cached_property
    def known(self) -> Array32:
        """(M, GRID) 1 inside of its record, 0 outside."""
        return self.inside.astype(np.float32)

    def coherence(self, one: int, others: IntArray) -> ComplexArray:
        """(K,) normalised inner product of `one` with `others` (K,) over the times that both have; abs: coherence,
        angle: lag.
        """
        product = np.conj(self.values[others] @ self.values[one].conj()).astype(np.complex128)
        power = (self.power[others] @ self.known[one]).astype(np.float64) * (self.known[others] @ self.power[one])
        met = (power > 0.0) & (self.together[others] == self.together[one])
        return np.divide(product, np.sqrt(power), out=np.zeros_like(product), where=met)


@dataclass(frozen=True, eq=False)
class _Company:
    """What chance brings to each of the candidates. expected: (M,) how many others within a line and a half of its
    frequency; so_near: (M,) within what loops that look alike are gathered from. lines: (M,) over how many independent
    lines its power is spread. start_s, end_s: (M,) of its record.
    """

    expected: FloatArray
    so_near: FloatArray
    lines: FloatArray
    start_s: FloatArray
    end_s: FloatArray

    @classmethod
    def of(cls, chosen: Sequence[Candidate]) -> "_Company":
        period, slack = _periods(chosen, 0.0, 1.5)
        density = (len(chosen) - 1) * 2.0 / max(float(np.log(period.max() / period.min())), _LEAST_SPREAD)
        _, apart = _periods(chosen, *_ALIKE_APART)
        power = [np.abs(c.swing.lines) ** 2 for c in chosen]
        lines = np.array([HANN_SHARE * np.sum(p) ** 2 / np.sum(p * p) for p in power])
        start = np.array([c.swing.start_s for c in chosen])
        end = start + np.array([c.swing.length_s for c in chosen])
        return cls(density * slack, density * apart, lines, start, end)

    @cached_property
    def lines_a_second(self) -> FloatArray:
        """(M,) of its record."""
        return self.lines / (self.end_s - self.start_s)

    def of_one_period(self, one: int, count: int) -> float:
        """Poisson probability of so many others of its period or more, as near as loops that look alike may be."""
        return float(pdtrc(count - 1, self.so_near[one]))

    def by_chance(self, one: int, rows: IntArray, links: ComplexArray) -> float:
        """The least probability that as many others as coherent with it come by chance, of those linked to it."""
        others = rows != one
        return float(np.min(_as_many(self._as_coherent(one, rows[others], links[others]))))

    def beyond_chance(self, one: int, rows: IntArray, links: ComplexArray) -> IntArray:
        """The rows linked to one that hardly come by chance, each for itself or several together: where several do, the
        nearest of them alone would tell as little as one, and belong to them all the same."""
        loops = self._as_coherent(one, rows, links)
        near = loops[loops <= TOGETHER]
        shown = len(near) > 0 and float(_as_many(near).min()) <= CHANCE
        return rows[loops <= (TOGETHER if shown else UNNAMED)]

    def _as_coherent(self, one: int, others: IntArray, links: ComplexArray) -> FloatArray:
        """(K,) how many others chance brings to the period of one, as coherent with it as each of `others` (K,) is.

        Of swings that wander by themselves over n independent lines a share of (1 - c^2)^(n - 1) is more coherent than
        c; n is less where the two were recorded together for a part of the time only. A limit cycle is hardly more than
        one line: to be coherent with it tells little, unless as nearly as two of one frequency are.
        """
        end_s = np.minimum(self.end_s[others], self.end_s[one])
        together = np.maximum(0.0, end_s - np.maximum(self.start_s[others], self.start_s[one]))
        lines = np.minimum(self.lines_a_second[others], self.lines_a_second[one]) * together
        apart = np.maximum(1.0 - np.minimum(1.0, np.abs(links)) ** 2, _LEAST_APART)
        return np.asarray(apart ** np.maximum(lines - 1.0, PURE) * self.expected[one])


def _as_many(expected: FloatArray) -> FloatArray:
    """(K,) for loops of which chance brings so many each, `expected` (K,): the probability that as many come by it as
    stand up to there, the fewest first.
    """
    ranked = np.argsort(expected, kind="stable")
    probability = np.empty(len(expected))
    probability[ranked] = pdtrc(np.arange(len(expected)), expected[ranked])
    return probability


@dataclass(eq=False)
class _Free:
    """Which candidates have no group yet."""

    left: BoolArray
    groups: list[tuple[bool, list[int]]] = field(default_factory=list)

    def take(self, members: list[int], in_step: bool) -> None:
        self.left[members] = False
        self.groups.append((in_step, members))


def groups(candidates: Sequence[Candidate]) -> tuple[Group, ...]:
    """Groups of two or more candidates; those that are no chance first, those in step first, the larger ones first.

    Three passes, the strongest oscillation as the seed each time. First: the same period (within 5 % and the resolution
    of the record) and coherence with the seed of 0.7 or more in the narrow band about it, more than chance brings among
    so many loops. Then the same whatever chance brings. Then, of what is left: the same unit (loops without one count
    as of one), the same period (within 3 % and resolution) and spectra alike from a third of the frequency upwards.
    Cost: M x GRID complex numbers, and M products of that length, up to M^2 where all have one period; of more than
    4,000 candidates the strongest are taken, and none of fewer than ten cycles, nor one that swings for a moment only:
    set points that step at one time are answered alike. Misleads on pairs of pure sines: two
    periods that a record cannot tell apart are in step as far as it shows.
    Sources: Thornhill, Shah, Huang, Vishnubhotla 2002, Spectral principal component analysis of dynamic process data,
    Control Eng. Practice 10, 833-846 (spectra alike); Thornhill 2005, Finding the source of nonlinearity in a process
    with plant-wide oscillation, IEEE Trans. Control Syst. Technol. 13, 434-443 (the source is where nonlinearity is
    strongest).
    """
    enough = [c for c in candidates if c.swing.cycles >= FEWEST_CYCLES]
    chosen = sorted(enough, key=lambda c: (-c.swing.strength * min(c.swing.regularity, 3.0), c.tag))[:_LARGEST]
    if len(chosen) < 2:
        return ()
    waves = _waves([c.swing for c in chosen])
    free = _Free(np.array([_lasts(waves, row, one.swing.cycles) for row, one in enumerate(chosen)]))
    company = _Company.of(chosen)
    # In a large plant some are coherent enough by chance to hide which belong together: those that are not come first.
    _gather_in_step(chosen, waves, free, company.beyond_chance)
    _gather_in_step(chosen, waves, free, lambda _, rows, __: rows)
    _gather_alike(chosen, free)
    found = [_group(chosen, waves, company, members, in_step) for in_step, members in free.groups]
    return tuple(sorted(found, key=lambda g: (g.by_chance, not g.in_step, -len(g.suspects), g.suspects[0].tag)))


def _gather_in_step(
    chosen: Sequence[Candidate],
    waves: _Waves,
    free: _Free,
    told: Callable[[int, IntArray, ComplexArray], IntArray],
) -> None:
    """told: which of the loops that are coherent with a seed, by row (K,) and coherence (K,), are taken."""
    period, slack = _periods(chosen, 0.05, 1.5)
    for seed in range(len(chosen)):
        if not free.left[seed]:
            continue
        near = free.left & (np.abs(np.log(period / period[seed])) <= np.maximum(slack, slack[seed]))
        near[seed] = False
        if near.any():
            rows = np.flatnonzero(near)
            links = waves.coherence(seed, rows)
            linked = np.abs(links) >= IN_STEP
            if len(together := told(seed, rows[linked], links[linked])):
                free.take([seed, *together.tolist()], in_step=True)


def _gather_alike(chosen: Sequence[Candidate], free: _Free) -> None:
    period, slack = _periods(chosen, *_ALIKE_APART)
    units = np.array([c.unit or "" for c in chosen])
    bands = np.array([c.swing.bands for c in chosen])
    for seed in range(len(chosen)):
        if not free.left[seed]:
            continue
        near = free.left & (np.abs(np.log(period / period[seed])) <= np.maximum(slack, slack[seed]))
        near &= units == units[seed]
        near[seed] = False
        alike = np.flatnonzero(near)[likeness(bands[seed], bands[near], period[seed]) >= ALIKE]
        if len(alike):
            free.take([seed, *alike.tolist()], in_step=False)


def likeness(one: FloatArray, others: FloatArray, period_s: float) -> FloatArray:
    """Cosine between band amplitudes one (B,) and others (M, B), from a third of the frequency of `period_s` upwards.

    What drifts more slowly than that does not count. Returns (M,), 0..1.
    """
    counted = BAND_EDGES_HZ[1:] >= 1.0 / (3.0 * period_s)
    one, others = one[counted], others[:, counted]
    norm = np.linalg.norm(one) * np.linalg.norm(others, axis=1)
    return np.divide(others @ one, norm, out=np.zeros(len(others)), where=norm > 0.0)


def _periods(chosen: Sequence[Candidate], tolerance: float, lines: float) -> tuple[FloatArray, FloatArray]:
    """Periods, and how far apart (as a ratio) they may be: a tolerance and so many lines of the spectrum."""
    period = np.array([c.swing.period_s for c in chosen])
    return period, np.array([tolerance + lines / c.swing.cycles for c in chosen])


def _waves(swings: Sequence[Swing]) -> _Waves:
    start = np.array([s.start_s for s in swings])
    end = start + np.array([s.length_s for s in swings])
    together = _together(start, end)
    reach = ((start[own].min(), end[own].max()) for n in range(together.max() + 1) for own in [together == n])
    grids_s = np.array([np.linspace(first, last, GRID, endpoint=False) for first, last in reach])
    values = np.zeros((len(swings), GRID), dtype=np.complex64)
    inside = np.zeros(values.shape, dtype=bool)
    for row, swing in enumerate(swings):
        time_s = grids_s[together[row]]
        inside[row] = (time_s >= start[row]) & (time_s < end[row])
        values[row, inside[row]] = _wave(swing, time_s[inside[row]])
    return _Waves(grids_s, values, inside, together)


def _together(start: FloatArray, end: FloatArray) -> IntArray:
    """(M,) numbers of stretches of time that no record reaches out of, for records from start (M,) to end (M,)."""
    order = np.argsort(start, kind="stable")
    reached = np.maximum.accumulate(end[order])
    number = np.empty(len(start), dtype=np.int64)
    number[order] = np.cumsum(np.concatenate(([False], start[order][1:] >= reached[:-1])))
    return number


def _wave(swing: Swing, time_s: FloatArray) -> ComplexArray:
    """Narrow-band PV (n,) of a swing at times (n,): the sum of its lines."""
    turn = np.exp(2j * np.pi * (time_s - swing.start_s) / swing.length_s)
    total = np.zeros(len(time_s), dtype=np.complex128)
    for line in swing.lines[::-1]:
        total = total * turn + line
    return total * turn**swing.first_line


def _group(chosen: Sequence[Candidate], waves: _Waves, company: _Company, members: list[int], in_step: bool) -> Group:
    onsets = [_onset_s(waves, row) for row in members]
    first_s = min(float(waves.time_s(row)[0]) for row in members)
    begun = [first_s if onset is None else onset for onset in onsets]
    resolution_s = max(chosen[row].swing.length_s / len(chosen[row].swing.lines) for row in members)
    scores = [
        _score(chosen[row], late_s=start - min(begun), resolution_s=resolution_s)
        for row, start in zip(members, begun, strict=True)
    ]
    # Of equal scores (beyond 0.99 all are) the likelier one, then the stronger swing, which stands first among members.
    place = max(range(len(members)), key=lambda k: (scores[k], chosen[members[k]].stiction_probability or 0.0))
    best = members[place]
    period_s = float(np.median([chosen[row].swing.period_s for row in members]))
    rows = np.sort(members)
    links = waves.coherence(best, rows)
    by_row = dict(zip(rows.tolist(), links.tolist(), strict=True))
    suspects = [
        Suspect(
            chosen[row].tag,
            chosen[row].stiction_probability,
            score,
            onset,
            1.0 if row == best else round(min(1.0, abs(by_row[row])), 3),
            _lag_s(by_row[row], period_s) if in_step else None,
            _same_times(chosen[row].swing, chosen[best].swing),
        )
        for row, score, onset in zip(members, scores, onsets, strict=True)
    ]
    chance = company.by_chance(best, rows, links) if in_step else company.of_one_period(members[0], len(members) - 1)
    others = sorted((s for k, s in enumerate(suspects) if k != place), key=lambda s: (-s.score, s.tag))
    shaken = [row for row, suspect in zip(members, suspects, strict=True) if row != best and suspect.may_be_shaken]
    alike = [row for row in shaken if _same_times(chosen[row].swing, chosen[best].swing)]
    accounted = not in_step or (bool(shaken) and _accounts_for(waves, best, alike))
    return Group(period_s, in_step, chance, (suspects[place], *others), accounted)


def _same_times(one: Swing, other: Swing) -> bool:
    apart_s = abs(one.start_s - other.start_s) + abs(one.length_s - other.length_s)
    return apart_s <= _SAME_TIMES * min(one.length_s, other.length_s)


def _accounts_for(waves: _Waves, source: int, shaken: list[int]) -> bool:
    """Whether what the source does may be all that these rows share: not where one of them, the strongest, is as one
    with the others and the source is not. Less than two tell nothing of that."""
    if len(shaken) < 2:
        return True
    among, rest = shaken[0], np.sort(shaken[1:])
    of_source, of_one_of_them = (float(np.median(np.abs(waves.coherence(one, rest)))) for one in (source, among))
    return of_source >= AS_ONE or of_one_of_them < AS_ONE


def _score(candidate: Candidate, late_s: float, resolution_s: float) -> float:
    """Log-odds of stiction, less up to 1.5 for an oscillation that began later than another member's.

    A delay below what the lines resolve (their inverse band width) does not count.
    """
    probability = candidate.stiction_probability
    odds = 0.0 if probability is None else float(np.log(_clipped(probability) / (1.0 - _clipped(probability))))
    later = max(0.0, late_s / resolution_s - 1.0)
    return odds - min(_ONSET_WEIGHT, later * _ONSET_WEIGHT / 2.0)


def _clipped(probability: float) -> float:
    return min(max(probability, 0.01), 0.99)


def _lasts(waves: _Waves, row: int, cycles: float) -> bool:
    """Whether a swing has enough cycles where it swings; so many of its record have its power: (sum p)^2 / (n sum p^2).
    True where there is too little to tell.
    """
    envelope, _ = _envelope(waves, row)
    power = envelope**2
    if not power.any():
        return True
    share = float(np.sum(power) ** 2 / (len(power) * np.sum(power**2)))
    return share >= PASSING or share * cycles >= FEWEST_CYCLES


def _onset_s(waves: _Waves, row: int) -> float | None:
    """When the envelope first stays above half of its usual height; None where it is there from the start."""
    envelope, time_s = _envelope(waves, row)
    usual = float(np.median(envelope[len(envelope) // 2 :])) if len(envelope) else 0.0
    if usual <= 0.0 or envelope[0] > _ONSET_RISE * usual:
        return None
    below = np.flatnonzero(envelope < 0.5 * usual)
    early = below[below < len(envelope) // 2]
    return float(time_s[early[-1]]) if len(early) else None


def _envelope(waves: _Waves, row: int) -> tuple[FloatArray, FloatArray]:
    """How high a swing is, and when, (n,) each; empty of a record that has less than 32 points of the grid.

    The Hann window that the lines were taken with is taken out again; the outermost eighths, where it is near zero,
    are not looked at.
    """
    inside = np.flatnonzero(waves.inside[row])
    n = len(inside)
    if n < 32:
        return np.empty(0), np.empty(0)
    seen = slice(n // 8, n - n // 8)
    height = np.abs(waves.values[row, inside]).astype(np.float64)
    return height[seen] / np.hanning(n)[seen], waves.time_s(row)[inside[seen]]


def _lag_s(link: complex, period_s: float) -> float:
    return round(float(np.angle(link)) / (2.0 * np.pi) * period_s, 3)
