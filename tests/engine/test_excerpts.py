"""What is kept of OP and SP: values at instants that are the same in all loops of one sampling."""

import numpy as np
import pytest

from app.engine.plant_wide.excerpts import LENGTH, MOST, excerpts_of
from app.engine.recording import Recording

ORIGIN_S = 1_750_000_000.0
RAMP = np.arange(2000.0)


def recording(op, sp=None, interval_s=1.0):
    return Recording("FIC101", interval_s * np.arange(len(op)), np.zeros(len(op)), op, sp)


@pytest.mark.parametrize("samples", [128, 400, 1440, 86_400])
@pytest.mark.parametrize("interval_s", [0.5, 1.0, 60.0])
def test_a_few_excerpts_are_spread_over_a_record_of_any_length(samples, interval_s):
    found = excerpts_of(recording(np.arange(float(samples)), interval_s=interval_s), ORIGIN_S)
    assert found.interval_s == interval_s
    assert found.op.shape == (len(found.numbers), LENGTH)
    assert 1 <= len(found.numbers) <= MOST
    assert samples < 400 or np.ptp(found.numbers) * LENGTH > samples / 3


def test_an_excerpt_lies_where_its_number_says():
    found = excerpts_of(recording(RAMP), ORIGIN_S)
    begin = found.numbers * LENGTH - ORIGIN_S
    assert found.op.tolist() == [[start + k for k in range(LENGTH)] for start in begin]


def test_the_excerpts_of_a_longer_record_are_among_those_of_a_shorter_one():
    whole = recording(np.arange(86_400.0))
    day, hours = excerpts_of(whole, 0.0), excerpts_of(whole.part(slice(40_000, 60_000)), 0.0)
    inside = [n for n in day.numbers if 40_000 <= n * LENGTH < 60_000 - LENGTH]
    assert inside
    assert set(inside) <= set(hours.numbers)


@pytest.mark.parametrize(("interval_s", "kept_s"), [(0.98, 1.0), (3.0, 5.0), (13.0, 15.0), (7200.0, 3600.0)])
def test_an_odd_interval_is_kept_at_the_next_usual_one(interval_s, kept_s):
    assert excerpts_of(recording(RAMP, interval_s=interval_s), 0.0).interval_s == kept_s


def test_a_value_holds_until_the_next_also_over_a_hole():
    op = np.where((RAMP >= 1024) & (RAMP < 1056), np.nan, RAMP)
    found = excerpts_of(recording(op), 0.0)
    at = found.numbers.tolist().index(16)
    assert found.op[at, :33].tolist() == [1023.0] * 32 + [1056.0]


@pytest.mark.parametrize("standing", [50.0, 0.0, -1e9, np.nan])
def test_a_signal_that_stands_has_none(standing):
    still = np.full(2000, standing)
    found = excerpts_of(recording(RAMP, still), 0.0)
    assert found.sp is None
    assert found.op is not None
    assert excerpts_of(recording(still, still), 0.0) is None
    assert excerpts_of(recording(still), 0.0) is None


def test_a_record_shorter_than_an_excerpt_has_none():
    assert excerpts_of(recording(RAMP[: LENGTH - 1]), 0.0) is None
    assert excerpts_of(recording(RAMP[:1]), 0.0) is None
    assert excerpts_of(recording(RAMP[: LENGTH + 5]), 1.0) is None
