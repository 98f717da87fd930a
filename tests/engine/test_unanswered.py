"""A PV that stands still: a controller that works against it is evidence, a flat signal alone is none."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.audit import audit
from app.engine.recording import Recording

N = 400
SEEN = Recording(
    "FIC1",
    np.arange(N) * 10.0,
    np.full(N, 3.3),
    np.linspace(20.0, 31.0, N),
    sp=np.full(N, 4.0),
    automatic=np.ones(N, dtype=bool),
)


def test_a_controller_at_work_against_a_standing_pv_leaves_a_stuck_valve_or_a_dead_transmitter():
    said = audit(SEEN).judgement
    assert (said.verdict, said.reliability, said.stiction_probability) == ("inconclusive", "not_reliable", 0.6)
    assert said.likely_cause == "stuck_valve_or_dead_transmitter"
    assert [reason.code for reason in said.reasons] == ["pv_does_not_answer", "prior_only", "pv_flat"]


@pytest.mark.parametrize(
    "little",
    [
        {"automatic": None},
        {"sp": None},
        {"sp": np.full(N, 3.3)},
        {"op": np.where(np.arange(N) < 180, 20.0, np.where(np.arange(N) < 350, 20.1, 20.2))},
        {"pv": np.where(np.arange(N) < 3, 3.2, 3.3)},
    ],
    ids=["mode not recorded", "no set point", "PV at its set point", "OP took three values", "PV has moved"],
)
def test_a_flat_pv_with_less_than_that_is_not_auditable(little):
    said = audit(replace(SEEN, **little)).judgement
    assert (said.verdict, said.stiction_probability) == ("not_auditable", None)
    assert {"pv_does_not_answer", "pv_flat"} <= {reason.code for reason in said.reasons}


def test_units_and_signs_change_nothing():
    other = replace(SEEN, pv=1e3 - 7.0 * SEEN.pv, op=-0.01 * SEEN.op, sp=1e3 - 7.0 * SEEN.sp)
    assert audit(other).judgement == audit(SEEN).judgement


def test_an_offset_of_pv_and_sp_changes_nothing_be_it_large():
    near = replace(SEEN, sp=np.where(np.arange(N) % 5 == 0, 3.3, 3.3 + np.linspace(0.001, 0.2, N)))
    assert audit(near).judgement.verdict == "inconclusive"
    assert audit(replace(near, pv=near.pv + 1e4, sp=near.sp + 1e4)).judgement == audit(near).judgement


def test_a_set_point_that_differs_in_the_last_digits_of_a_float_is_pv():
    rounded = replace(SEEN, sp=np.full(N, float(np.float32(3.3))))
    assert audit(rounded).judgement.verdict == "not_auditable"
