"""OP beside the traces of an explanation."""

import numpy as np

from app.services.explaining.plot import as_many


def test_op_keeps_step_with_traces_at_an_interval_that_is_no_whole_number_of_samples() -> None:
    np.testing.assert_array_equal(as_many(np.arange(10.0), 4), [0.0, 2.0, 5.0, 7.0])
    np.testing.assert_array_equal(as_many(np.arange(10.0), 10), np.arange(10.0))
