"""Legs of OP: alike in a limit cycle, unlike under noise; and the rest of a set point that steps."""

import numpy as np
import pytest

from app.engine.features import extract, observe, shape_windows
from app.engine.features.legs import legs
from app.engine.features.steady import at_rest
from app.engine.oscillation import detect
from app.engine.recording import UniformRecord

N = 900


def record(pv: np.ndarray, op: np.ndarray, sp: np.ndarray | None = None) -> UniformRecord:
    return UniformRecord(1.0, pv, op, sp, np.zeros(len(pv), dtype=bool))


def triangle(period: float) -> np.ndarray:
    return 2.0 * np.abs(2.0 * ((np.arange(N) / period) % 1.0) - 1.0) - 1.0


def of(loop: UniformRecord):
    return legs(shape_windows(loop, detect(loop))[0])


def test_even_legs_have_no_spread_and_one_path():
    found = of(record(np.sign(triangle(60.0) + 0.2), triangle(60.0)))
    assert found.leg_size_spread < 0.05
    assert found.leg_time_spread < 0.05
    assert found.path > 0.9


def test_wandering_legs_have_spread_and_no_path():
    rng = np.random.default_rng(2)
    pv, op = (np.convolve(rng.normal(size=N + 20), np.hanning(21), mode="valid") for _ in range(2))
    found = of(record(pv, op))
    assert found.leg_size_spread > 0.2
    assert found.path < 0.6


def stepping(rest: int) -> UniformRecord:
    rng = np.random.default_rng(4)
    sp = np.where(np.arange(N) < rest, 0.0, 5.0 + np.arange(N) // 50)
    return record(sp + 0.3 * rng.normal(size=N), 2.0 * sp + rng.normal(size=N), sp)


def test_the_rest_of_a_stepping_set_point_is_found():
    rest = at_rest(stepping(400))
    assert (rest.samples, rest.start_s) == (400, 0.0)
    assert np.ptp(rest.sp) == 0.0


@pytest.mark.parametrize("loop", [stepping(100), record(triangle(60.0), triangle(60.0))], ids=["short", "no set point"])
def test_no_rest_is_made_up(loop):
    assert at_rest(loop) is None


def test_the_rest_is_looked_at_beside_the_whole():
    loop = stepping(400)
    whole, rest, both = (f(r, detect(r)) for f, r in ((extract, loop), (extract, at_rest(loop)), (observe, loop)))
    np.testing.assert_allclose(both.values, (whole.values + rest.values) / 2)
    assert len(both.table) == len(whole.table) + len(rest.table)
