"""What is kept of OP and SP comes back from storage as it was, on another scale."""

import numpy as np
import pytest

from app.engine.plant_wide.excerpts import LENGTH, Excerpts
from app.services.audit_json.excerpts import as_json, from_json

NUMBERS = np.array([3, 7], np.int64)


def stored(values):
    return from_json(as_json(Excerpts(5.0, NUMBERS, values, None)))


@pytest.mark.parametrize("scale", [1.0, -3.0, 1e-300, 1e300, 1.7e308])
def test_what_comes_back_lies_on_a_line_over_what_was_kept(scale):
    values = np.random.default_rng(1).uniform(-1.0, 1.0, (2, LENGTH))
    found = stored(scale * values)
    assert (found.interval_s, found.numbers.tolist(), found.sp) == (5.0, [3, 7], None)
    assert found.op.shape == (2, LENGTH)
    assert 1.0 - np.corrcoef(found.op.ravel(), values.ravel())[0, 1] * np.sign(scale) < 1e-8


def test_values_too_near_to_each_other_for_their_difference_come_back_as_one():
    assert np.ptp(stored(np.where(np.arange(2 * LENGTH) % 2, 0.0, 5e-324).reshape(2, LENGTH)).op) == 0.0
