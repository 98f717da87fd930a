"""Where a mask is True without a break."""

import numpy as np
import pytest

from app.engine.signals.runs import runs_of


@pytest.mark.parametrize(
    ("mask", "starts", "ends"),
    [
        ([], [], []),
        ([0, 0], [], []),
        ([1, 1, 1], [0], [3]),
        ([1, 0, 0, 1, 1, 0], [0, 3], [1, 5]),
        ([0, 1, 0, 1], [1, 3], [2, 4]),
    ],
)
def test_a_run_is_from_its_first_sample_to_the_one_behind_its_last(mask, starts, ends):
    found = runs_of(np.array(mask, dtype=np.bool_))
    assert [at.tolist() for at in found] == [starts, ends]
