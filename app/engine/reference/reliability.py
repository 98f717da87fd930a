"""Which search space, and how far its answer can be trusted: table 2 and the ladder of search spaces (section 4.1)."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from app.engine.armax import SearchSpace
from app.engine.recording import IntArray, UniformRecord
from app.engine.reference import yper
from app.engine.reference.hammerstein import HammersteinConfig, Identification, OneParameterResult, TwoParameterResult
from app.engine.reference.yper import YperResult
from app.errors import DataError

Reading = Literal["high_stiction", "high_no_stiction", "low_stiction", "low_no_stiction"]

Ending = Literal["agreement", "ladder_end", "record_too_short", "not_widened"]

RELIABLE: frozenset[Reading] = frozenset({"high_stiction", "low_no_stiction"})
"""The rows of table 2 where Yper and the Hammerstein verdict agree."""


@dataclass(frozen=True)
class LadderConfig:
    """The ladder of search spaces and where Yper sends a record on it.

    rungs: (na, nb, nc) limits, each order from 1 to its limit; climbed in this order.
    nominal: the first rung where Yper is low. high: the first rung where it is high, so harmonics must be explained.
    yper_threshold_pct: Yper above this is high; 0.5 is the paper's (remark 4.1).
    two_parameter: whether the last rung reached is identified with the two-parameter model too.
    two_parameter_widest: the widest rung in which that is done, however far the climb goes; None: any.
    widen: whether the climb goes on from the first rung where table 2 does not agree.
    wider_every: rungs after the first try each `wider_every`-th point of the grid of d and the lowest of the
    first; 1: the whole grid.
    """

    rungs: tuple[tuple[int, int, int], ...] = ((2, 2, 2), (5, 5, 5), (5, 5, 10), (5, 5, 25), (10, 10, 25))
    nominal: tuple[int, int, int] = (5, 5, 5)
    high: tuple[int, int, int] = (5, 5, 10)
    yper_threshold_pct: float = yper.SIGNIFICANT_PCT
    two_parameter: bool = True
    two_parameter_widest: tuple[int, int, int] | None = None
    widen: bool = True
    wider_every: int = 1

    def __post_init__(self) -> None:
        for first in (self.nominal, self.high):
            if first not in self.rungs:
                raise ValueError(f"the first rung {first} is not on the ladder {self.rungs}")
        if self.two_parameter_widest is not None and self.two_parameter_widest not in self.rungs:
            raise ValueError(f"the rung {self.two_parameter_widest} is not on the ladder {self.rungs}")


@dataclass(frozen=True, eq=False)
class Rung:
    """What one search space said. `two` is None except on the last rung reached; it names its own space."""

    space: SearchSpace
    one: OneParameterResult
    two: TwoParameterResult | None
    stiction: bool
    reading: Reading
    agrees: bool


@dataclass(frozen=True, eq=False)
class Reference:
    """The published method's answer to a record, with the climb that led to it.

    yper: scale-free, both signals at unit standard deviation; it decides. yper_raw: in engineering units, to compare.
    high: whether Yper is above the threshold of the configuration.
    rungs: every search space that was identified, in order; the last one has the final say.
    ending: why the climb ended: table 2 agreed, there was no wider rung, the record is too short for the next one, or
    the configuration did not ask for wider ones.
    """

    yper: YperResult
    yper_raw: YperResult
    high: bool
    rungs: tuple[Rung, ...]
    ending: Ending

    @property
    def last(self) -> Rung:
        return self.rungs[-1]

    @property
    def stiction(self) -> bool:
        return self.last.stiction

    @property
    def reading(self) -> Reading:
        return self.last.reading

    @property
    def reliable(self) -> bool:
        return self.last.agrees

    @property
    def widenings(self) -> int:
        """How many times the search space was enlarged."""
        return len(self.rungs) - 1

    @property
    def search_space(self) -> SearchSpace:
        return self.last.space


def read_table2(high: bool, stiction: bool) -> Reading:
    """The row of table 2: whether Yper is high, whether the Hammerstein approach says stiction."""
    if high:
        return "high_stiction" if stiction else "high_no_stiction"
    return "low_stiction" if stiction else "low_no_stiction"


def climb(
    record: UniformRecord,
    config: LadderConfig | None = None,
    hammerstein_config: HammersteinConfig | None = None,
) -> Reference:
    """Yper first, then search spaces from the rung it chooses until table 2 agrees or the ladder ends (section 4.1).

    The verdict of a rung is the published rule on the one-parameter model: stiction where the d of least RMSE is not
    zero. The two-parameter model is kept beside it and never decides; being the costlier one, it is identified
    on the last rung reached only. A record that is too short for the first rung starts on the widest one below that
    it can bear; one that is too short for the next rung ends the climb.
    Raises DataError as yper.compute and hammerstein do: flat signals, missing values, and
    DataError("record_too_short") where no rung can be identified.

    Misleads: at the paper's threshold of 0.5 % nearly every real record is high, so agreement repeats the verdict.
    Source: Srinivasan, Spinner, Rengaswamy 2015, doi 10.1021/acs.iecr.5b00939.
    """
    config = config or LadderConfig()
    hammerstein_config = hammerstein_config or HammersteinConfig()
    scale_free = yper.compute(record.pv, record.op, record.sampling_interval_s, "std")
    raw = yper.compute(record.pv, record.op, record.sampling_interval_s, "raw")
    high = scale_free.yper_pct > config.yper_threshold_pct
    first = config.rungs.index(config.high if high else config.nominal)
    identification = Identification(record, hammerstein_config)
    rungs, ending = _climb_from(identification, config, first, high, hammerstein_config)
    if config.two_parameter:
        two = identification.two_parameter(_narrower(rungs[-1].space, config))
        rungs[-1] = replace(rungs[-1], two=two)
    return Reference(yper=scale_free, yper_raw=raw, high=high, rungs=tuple(rungs), ending=ending)


def _narrower(space: SearchSpace, config: LadderConfig) -> SearchSpace:
    """The space of the last rung, or the widest one in which the two-parameter model may be identified."""
    if config.two_parameter_widest is None:
        return space
    widest = config.rungs.index(config.two_parameter_widest)
    wider = (SearchSpace(*orders) for orders in config.rungs[widest + 1 :])
    return SearchSpace(*config.two_parameter_widest) if space in wider else space


def _climb_from(
    identification: Identification,
    config: LadderConfig,
    first: int,
    high: bool,
    hammerstein_config: HammersteinConfig,
) -> tuple[list[Rung], Ending]:
    rungs = [_first_bearable(identification, config, first, high)]
    if not config.widen and not rungs[-1].agrees:
        return rungs, "not_widened"
    for orders in config.rungs[first + 1 :]:
        if rungs[-1].agrees:
            break
        points = _points_for_wider(rungs, config, hammerstein_config)
        try:
            rungs.append(_try(identification, SearchSpace(*orders), high, points))
        except DataError as refused:
            if refused.code != "record_too_short":
                raise
            return rungs, "record_too_short"
    return rungs, "agreement" if rungs[-1].agrees else "ladder_end"


def _points_for_wider(
    rungs: list[Rung], config: LadderConfig, hammerstein_config: HammersteinConfig
) -> IntArray | None:
    """The points of the grid of d that the next rung tries: some of all, and what was lowest on the first one."""
    if config.wider_every == 1:
        return None
    spread = np.arange(0, hammerstein_config.points_d, config.wider_every)
    lowest = np.argsort(rungs[0].one.rmse, kind="stable")[: max(hammerstein_config.refined, 1)]
    return np.union1d(spread, lowest)


def _first_bearable(identification: Identification, config: LadderConfig, first: int, high: bool) -> Rung:
    for orders in config.rungs[first:0:-1]:
        try:
            return _try(identification, SearchSpace(*orders), high)
        except DataError as refused:
            if refused.code != "record_too_short":
                raise
    return _try(identification, SearchSpace(*config.rungs[0]), high)


def _try(identification: Identification, space: SearchSpace, high: bool, points: IntArray | None = None) -> Rung:
    one = identification.one_parameter(space, points)
    reading = read_table2(high, one.stiction)
    return Rung(space=space, one=one, two=None, stiction=one.stiction, reading=reading, agrees=reading in RELIABLE)
