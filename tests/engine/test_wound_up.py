"""An OP that has come to stand at its limit while PV does not come back is said first, and what was before clears no
valve."""

from functools import lru_cache

import numpy as np
import pytest

from app.engine.audit import audit
from app.engine.fitness import assess
from app.engine.recording import Recording
from app.engine.simulate import LoopSpec, Pid, Signal, SimulatedLoop, first_order, simulate_loop

N, TS = 8000, 5.0
SINCE = 6000


@lru_cache(maxsize=1)
def free() -> SimulatedLoop:
    """Under a load that wanders."""
    spec = LoopSpec(
        plant=first_order(1.0, 50.0, 10.0), controller=Pid(1.0, 50.0), load=Signal(noise_sd=2.0, noise_tau_s=3000.0),
        noise=Signal(noise_sd=0.1), pv_start=20.0, op_start=50.0, op_limits=(0.0, 100.0),
    )  # fmt: skip
    return simulate_loop(spec, TS * N, TS, 8)


def record(*, limit: float = 100.0, ramp: int = 400, pv_away: float = -4.0, stands: int = N) -> Recording:
    """From SINCE on OP goes to its limit, and PV stays away."""
    pv, op = free().pv.copy(), free().op.copy()
    way = np.minimum(np.arange(N - SINCE) / max(ramp, 1), 1.0)
    end = slice(SINCE, min(SINCE + ramp + stands, N))
    op[end] = (op[SINCE] + (limit - op[SINCE]) * way)[: end.stop - SINCE]
    pv[end] += pv_away
    return Recording("loop", TS * np.arange(N), np.round(pv, 2), np.round(op, 2), np.full(N, 20.0))


@pytest.mark.parametrize(("limit", "pv_away"), [(100.0, -4.0), (0.0, 4.0)])
def test_it_is_said_first_and_clears_no_valve(limit, pv_away):
    judgement = audit(record(limit=limit, pv_away=pv_away)).judgement
    assert (judgement.verdict, judgement.reliability) == ("inconclusive", "not_reliable")
    assert judgement.reasons[0].code == "wound_up"
    assert "for most of the last 2.2 h" in judgement.reasons[0].text
    assert judgement.likely_cause == "saturated_op"


def test_units_and_signs_are_free():
    given = record()
    other = Recording("loop", given.time_s, 7.0 - 0.1 * given.pv, -3.0 * given.op, 7.0 - 0.1 * given.sp)
    assert assess(other).wound_up_s == assess(given).wound_up_s


@pytest.mark.parametrize("missing", [slice(SINCE + 900, SINCE + 901), slice(0, 700), slice(None)])
def test_a_set_point_that_is_missing_for_a_while_hides_nothing(missing):
    given = record()
    sp = given.sp.copy()
    sp[missing] = np.nan
    assert assess(Recording("loop", given.time_s, given.pv, given.op, sp)).wound_up_s == assess(given).wound_up_s


def test_without_a_set_point_pv_is_away_from_where_it_was():
    given = record()
    assert assess(Recording("loop", given.time_s, given.pv, given.op)).wound_up_s == assess(given).wound_up_s


@pytest.mark.parametrize(
    "reason",
    [
        {"ramp": 0},  # by hand, or a unit that is shut down
        {"pv_away": 0.0},  # and PV is where it belongs
        {"stands": 50},  # and came back
        {"limit": 51.0},  # and is within its range
    ],
    ids=str,
)
def test_an_op_that_stands_may_have_its_reason(reason):
    assert assess(record(**reason)).wound_up_s is None


@pytest.mark.parametrize("change", [lambda pv: pv + 70.0, lambda pv: 7.0 - pv, lambda pv: 1.8 * pv + 32.0])
def test_a_set_point_in_another_unit_than_pv_changes_nothing(change):
    given = record()
    other = Recording("loop", given.time_s, change(given.pv), given.op, given.sp)
    assert assess(other).wound_up_s == assess(given).wound_up_s
    kept = record(pv_away=0.0)
    assert assess(Recording("loop", kept.time_s, change(kept.pv), kept.op, kept.sp)).wound_up_s is None


def test_an_op_that_came_back_is_not_wound_up() -> None:
    """A unit that was down for half a day and has run since for hours was told to stand at its limit."""
    assert assess(record(stands=1600)).wound_up_s is not None
    assert assess(record(stands=1100)).wound_up_s is None
