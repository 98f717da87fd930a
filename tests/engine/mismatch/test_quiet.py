"""A transmitter that froze is told beside the noise of what reads it, and a PV that rests is not."""

import numpy as np
import pytest

from app.engine.mismatch import Comparison, LinearSimulation, explain
from app.engine.mismatch.compare.comparison import record_of
from app.engine.mismatch.compare.patterns import FROZEN, find_patterns
from app.engine.mismatch.compare.preparing import prepare
from app.engine.mismatch.loop.plant import run_process
from app.engine.recording import FloatArray
from tests.engine.plain_loop import TRUE, TS, N, moves

FIRST, AFTER = 500, 640
NOISE = 0.1


def noise(sigma: float = NOISE, seed: int = 3) -> FloatArray:
    return sigma * np.random.default_rng(seed).normal(size=N)


def measured() -> FloatArray:
    return 50.0 + run_process(moves(), TRUE, TS) + noise()


def frozen(left: float) -> FloatArray:
    """PV that stands from FIRST to AFTER, beside that share of its noise."""
    pv = measured()
    pv[FIRST:AFTER] = pv[FIRST] + left * noise(seed=4)[FIRST:AFTER]
    return pv


def found(pv: FloatArray, op: FloatArray | None = None) -> list[str]:
    op = 40.0 + moves() if op is None else op
    return [pattern.reason.code for pattern in find_patterns(record_of(Comparison("loop", TS, op, pv)))]


@pytest.mark.parametrize("left", [0.01, 0.2])
def test_a_pv_that_froze_is_told_by_the_noise_that_is_gone(left: float) -> None:
    comparison = Comparison(
        "loop", TS, 40.0 + moves(), frozen(left), simulation=LinearSimulation(0.95 * TRUE.K, (TRUE.tau,), TRUE.theta)
    )
    said = explain(comparison)
    assert [effect.code for effect in said.effects] == ["sensor.stuck"]
    (window,) = said.effects[0].windows
    assert (window.start_s, window.end_s) == pytest.approx((TS * FIRST, TS * AFTER), abs=3.0 * TS)
    # Inferred, where repeated values are seen: none of 903 records without one is too few for more.
    assert said.effects[0].probability == FROZEN


def test_noise_that_comes_and_goes_is_no_frozen_sensor() -> None:
    """As that of a flow, which grows with the flow, or of one that is filtered for a while and moves on."""
    flow = 50.0 + run_process(moves(), TRUE, TS)
    share = (flow - np.min(flow)) / np.ptp(flow)
    assert found(flow + share**2 * noise()) == []
    filtered = measured()
    filtered[FIRST:AFTER] = flow[FIRST:AFTER] + 0.1 * noise()[FIRST:AFTER]
    assert found(filtered) == []


def test_a_pv_that_froze_for_much_of_the_record_shows_its_noise_nowhere_to_compare_with() -> None:
    pv = measured()
    pv[300:] = pv[300] + 0.1 * noise(seed=4)[300:]
    assert "pv_frozen" not in found(pv)


def test_where_op_rests_too_nothing_froze() -> None:
    op, pv = 40.0 + moves(), frozen(0.1)
    op[FIRST - 20 : AFTER] = op[FIRST - 20]
    assert found(pv) == ["pv_frozen"]
    assert found(pv, op) == []


@pytest.mark.parametrize("share", [0.85, 0.93])
def test_the_end_of_a_sensor_s_range_beside_a_little_noise_is_no_frozen_sensor(share: float) -> None:
    """It lets go of PV where it is: that it is a limit, the competition says."""
    pv = measured()
    assert found(np.minimum(pv, np.quantile(pv, share)) + 0.1 * noise(seed=4)) == []
    assert found(np.maximum(pv, np.quantile(pv, 1.0 - share)) + 0.1 * noise(seed=4)) == []


def test_a_valve_that_stays_put_for_a_while_before_a_fast_process_is_no_frozen_sensor() -> None:
    """What PV loses there is what the stem moves, and the noise of the meter is as it was."""
    rng = np.random.default_rng(0)
    op, pv, stem, flow, summed, sp = np.zeros(N), np.zeros(N), 0.0, 0.0, 0.0, 0.0
    for t in range(1, N):
        sp = 0.9 * sp + 0.3 * rng.standard_normal()
        summed += 0.05 * (sp - pv[t - 1])
        flow += 0.63 * (1.5 * stem - flow)
        op[t] = 0.4 * (sp - pv[t - 1]) + summed
        stem = stem if FIRST <= t < AFTER else op[t]
        pv[t] = flow + 0.02 * rng.standard_normal()
    assert found(50.0 + pv, 40.0 + op) == []


def test_a_pv_that_froze_is_told_in_a_record_of_which_less_than_half_has_no_gaps() -> None:
    """Around a gap the noise is not known, which is not to be taken for much of it."""
    known = (np.arange(N) % 8 > 0) | ((np.arange(N) >= FIRST - 200) & (np.arange(N) < AFTER + 210))
    pv = np.interp(np.arange(N), np.flatnonzero(known), frozen(0.1)[known])
    record = record_of(Comparison("loop", TS, 40.0 + moves(), pv, known=known))
    assert [pattern.reason.code for pattern in find_patterns(record)] == ["pv_frozen"]


def test_a_pv_that_stands_where_the_refit_stands_is_not_taken_for_frozen() -> None:
    """Its noise is gone, but it is where OP would have it: the loop was quiet, and the meter damped."""
    op = 40.0 + moves()
    op[FIRST - 60 : AFTER] = op[FIRST - 60] + 0.2 * np.sin(np.arange(AFTER - FIRST + 60) / 5.0)
    clean = 50.0 + run_process(op - 40.0, TRUE, TS)
    pv = clean + noise()
    pv[FIRST:AFTER] = np.mean(clean[FIRST:AFTER]) + 0.1 * noise(seed=4)[FIRST:AFTER]
    assert found(pv, op) == ["pv_frozen"]
    simulation = LinearSimulation(TRUE.K, (TRUE.tau,), TRUE.theta)
    assert prepare(Comparison("loop", TS, op, pv, simulation=simulation)).patterns == ()
