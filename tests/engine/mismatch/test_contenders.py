"""What competes for a place: which block it is, what it gains, and which points of a scan it begins from."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from app.engine.mismatch.compete.competition import Contender, finalists
from app.engine.mismatch.fit.scan import Start
from app.engine.mismatch.loop.block import Parameter
from app.engine.mismatch.physics.additive import LOAD_STEP
from app.engine.mismatch.physics.valve_deadband import DEADBAND


def test_a_contender_is_the_last_part_of_its_fit_and_gains_what_that_is_likelier():
    known, beside = SimpleNamespace(block=DEADBAND), SimpleNamespace(block=LOAD_STEP)
    over = SimpleNamespace(parts=(known,), likelihood=-100.0)
    contender = Contender(SimpleNamespace(parts=(known, beside), likelihood=-60.0), over)
    assert contender.block is LOAD_STEP
    assert contender.gain == 40.0
    assert contender.score == 40.0 - LOAD_STEP.penalty


@pytest.mark.parametrize(("most", "kept"), [(None, [0, 2]), (3, [0, 2, 3]), (9, [0, 2, 3])])
def test_a_point_is_a_neighbour_within_a_share_of_the_range_of_every_parameter(most, kept):
    """The second point is 7 % of both ranges from the first; the third 9 % of one; the fourth as far of the other."""
    ranges = (Parameter("a", "s", 0.0, 100.0, 1.0), Parameter("b", "s", -1.0, 1.0, 1.0))
    block = replace(DEADBAND, parameters=lambda _: ranges, finalists=2)
    places = [(50.0, 0.0), (57.0, -0.14), (59.0, 0.0), (50.0, 0.18), (54.0, 0.04)]
    starts = tuple(Start(np.array(place), -k) for k, place in enumerate(places))
    assert [starts.index(start) for start in finalists(starts, block, None, most)] == kept
