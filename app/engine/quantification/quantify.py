"""S of a sticky valve from one record: a likelihood over a grid of valves, and intervals that hold as stated."""

import numpy as np

from app.engine.codes import CheckCode
from app.engine.evidence import Finding, Measured, Outcome
from app.engine.fitness.signals import resolution
from app.engine.oscillation import Oscillation
from app.engine.quantification.config import QuantificationConfig
from app.engine.quantification.kernel import residuals
from app.engine.quantification.size import Interval, StictionSize
from app.engine.quantification.weighing import Weights, weigh
from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.sampled import piece_ranges

LEVELS_PCT = (50.0, 80.0, 95.0)
_LIVELY = 0.8
_FEWEST_SAMPLES = 100


def quantify(
    record: UniformRecord,
    oscillation: Oscillation,
    as_sampled: bool = True,
    config: QuantificationConfig | None = None,
) -> StictionSize | None:
    """S in the unit of OP with intervals, for a record whose valve is believed to stick.

    record: PV and OP, (N,), any unit. as_sampled: False if a historian's compression shows; the size is then not
    identifiable. Returns None if there is no period, if fewer than 100 samples are left after thinning, or if PV or OP
    does not vary. A change of unit, offset or sign of PV or OP changes only the unit of the answer. The set point does
    not matter, moving or not, because PV is predicted from OP.

    OP goes through He's and Kano's valve over a grid of S and J / S; PV is regressed on its own last samples and the
    stem's. The residual is nearly white, so the sum of squares is a likelihood even in closed loop. The error of a free
    run is not, because its disturbances come back through OP. The likelihood over the grid, weakened for what no model
    has, becomes a distribution of S, marginal over form and jump.

    Misleads: S is defined by the model. He's stem sticks after each slip, Kano's moves on with OP. If OP overshoots
    much after a slip, they read the same record as different S, and the interval covers both. A second oscillation
    larger than the limit cycle makes R the wrong measure. If noise goes through the controller, S is raised for the
    scans between the samples (`QuantificationConfig.unseen`): too much if the record has every scan, too little if
    dozens lie between two samples.
    Source: prediction errors and closed loop: Ljung, System Identification, 1999, chapters 7 and 13; the valves as in
    `app.engine.valve`.
    """
    config = config or QuantificationConfig()
    if oscillation.samples_per_cycle is None:
        return None
    per_cycle = oscillation.samples_per_cycle
    stride = max(1, int(per_cycle / config.samples_per_cycle))
    length = int(min(record.samples, (config.most_cycles + 1) * per_cycle, config.most_samples * stride))
    length -= length % stride
    pv, op = record.pv[-length:], record.op[-length:]
    op_range = lively_range(op, round(per_cycle))
    if length // stride < _FEWEST_SAMPLES or not op_range > 0.0 or not np.ptp(pv[::stride]) > resolution(pv):
        return None
    weights = _weights(pv[::stride], (op - op.mean()) / op_range, stride, config)
    return _size(weights, op_range, oscillation, as_sampled, config)


def lively_range(op: FloatArray, per_cycle: int) -> float:
    """The range that op (n,) covers at most in four of five cycles; over the whole if there are no two cycles."""
    ranges = piece_ranges(op, per_cycle)
    lively = float(np.quantile(ranges, _LIVELY)) if len(ranges) > 1 else 0.0
    return lively or float(np.ptp(op))


def _weights(pv: FloatArray, op: FloatArray, stride: int, config: QuantificationConfig) -> Weights:
    pv = np.ascontiguousarray(pv - pv.mean())
    pv = pv / pv.std()
    low, high, count = config.S_shares
    shares = np.geomspace(low, high, count)
    op = np.ascontiguousarray(op)

    def errors(S: FloatArray, jumps: FloatArray, kano: bool) -> FloatArray:
        """(S, jumps) for each jump J / S of one valve form."""
        J = np.outer(S, jumps)
        found = residuals(pv, op, stride, np.repeat(S, len(jumps)), J.ravel(), kano, config.lags_pv, config.lags_v)
        return found.reshape(J.shape)

    linear = float(errors(np.zeros(1), np.zeros(1), False)[0, 0])
    he = errors(shares, np.array(config.he_jumps), False)
    kano = errors(shares, np.array(config.kano_jumps), True)
    first = max(config.lags_pv, config.lags_v + (stride == 1))
    total = float(pv[first:] @ pv[first:])
    return weigh(np.hstack((he, kano)), linear, total, len(pv) - first, shares, config)


def _size(
    weights: Weights, op_range: float, oscillation: Oscillation, as_sampled: bool, config: QuantificationConfig
) -> StictionSize:
    findings = _findings(weights, oscillation, as_sampled, config)
    return StictionSize(
        S=op_range * weights.share(0.5),
        S_intervals=tuple(
            Interval(
                level,
                op_range * weights.share(0.5 - level / 200.0),
                op_range * weights.share(0.5 + level / 200.0),
            )
            for level in LEVELS_PCT
        ),
        identifiable=all(finding.outcome == "pass" for finding in findings),
        op_range=op_range,
        findings=findings,
    )


def _findings(
    weights: Weights, oscillation: Oscillation, as_sampled: bool, config: QuantificationConfig
) -> tuple[Finding, ...]:
    """The rule of what is identifiable, from the record alone."""
    width = float(np.log(weights.share(0.9) / weights.share(0.1)))
    per_cycle = oscillation.samples_per_cycle or 0.0
    at_least: tuple[tuple[CheckCode, float, float, str], ...] = (
        ("size_regularity", oscillation.regularity, config.min_regularity, "regularity of the oscillation"),
        ("size_cycles", oscillation.cycles, config.min_cycles, "cycles in the record"),
        ("size_samples_per_cycle", per_cycle, config.min_samples_per_cycle, "samples a cycle"),
        ("size_evidence", weights.evidence, config.min_evidence, "log-likelihood gained by stiction"),
        ("size_as_sampled", float(as_sampled), 1.0, "PV and OP as they were sampled, not rebuilt by a historian"),
    )
    return (
        *(_finding(code, text, Measured(value, ">=", limit)) for code, value, limit, text in at_least),
        _finding("size_width", "log width of the 80 % interval", Measured(width, "<=", config.most_width)),
    )


def _finding(code: CheckCode, text: str, found: Measured) -> Finding:
    told = f"{text}: {found.statistic:.3g} against {found.threshold:g}"
    outcome: Outcome = "pass" if found.passed else "fail"
    return Finding(code, outcome, told, float(found.statistic), found.threshold, operator=found.operator)
