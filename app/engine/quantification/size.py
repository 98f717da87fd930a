"""The size of stiction as it is stated: S with its intervals, and whether the record can tell it."""

from dataclasses import dataclass

from app.engine.evidence import Finding


@dataclass(frozen=True)
class Interval:
    """Holds the truth in `level_pct` of a hundred loops. low, high: unit of OP."""

    level_pct: float
    low: float
    high: float


@dataclass(frozen=True)
class StictionSize:
    """S of a sticky valve, in the unit of OP, and what can be said of J.

    S: median of the values that the record leaves possible. S_intervals: 50, 80 and 95 %.
    identifiable: whether every check of `findings` passed; if not, S is hardly more than a guess from OP's range.
    op_range: R, the range that OP covers in a lively cycle, unit of OP.
    findings: the checks of the rule, each with its statistic and threshold.

    J is not estimated, because PV and OP do not show it. If the stem jumps between two positions, PV is a square wave
    through the process, whose height is J times the process gain; valves of J = 0 and of J = S, each with its own gain,
    predict simulated records about equally well. All that is known is 0 <= J <= S, overshoot left aside.
    """

    S: float
    S_intervals: tuple[Interval, ...]
    identifiable: bool
    op_range: float
    findings: tuple[Finding, ...]

    def interval(self, level_pct: float = 95.0) -> Interval:
        """Raises KeyError for a level that is not stated."""
        return {interval.level_pct: interval for interval in self.S_intervals}[level_pct]
