"""A signal that is lost jumps to what is recorded in its place and back; a stuck sensor keeps its last value."""

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, explain, simulate_again
from app.engine.mismatch.compare.patterns import LOST, find_patterns
from app.engine.mismatch.loop.experiment import experiment
from app.engine.recording import FloatArray
from tests.engine.plain_loop import GIVEN, TS, N, moves, recorded

FIRST, AFTER = 600, 680


def asked(pv: FloatArray) -> Explanation:
    return explain(Comparison("loop", TS, 40.0 + moves(), pv, simulation=GIVEN))


@pytest.mark.parametrize("value", [42.0, 55.0, 100.0])
def test_a_lost_signal_is_not_surely_a_stuck_sensor(value: float) -> None:
    """At the end of the range, at the lowest value of the record, and on PV's way."""
    pv = recorded(moves())
    pv[FIRST:AFTER] = value
    said = asked(pv)
    assert [effect.code for effect in said.effects] == ["sensor.dropout"]
    assert said.effects[0].alternatives == ("sensor.stuck", "disturbance.step")
    assert said.effects[0].probability == LOST
    assert [(w.start_s, w.end_s) for w in said.effects[0].windows] == [(TS * FIRST, TS * AFTER)]
    assert {e.name: e.value for e in said.effects[0].parameters} == pytest.approx(
        {"start": TS * FIRST, "end": TS * AFTER, "value": value}
    )
    assert [reason.code for reason in said.effects[0].evidence] == ["pv_dropped"]
    assert simulate_again(said.model, 40.0 + moves())[FIRST:AFTER] == pytest.approx(value)


def test_a_sensor_that_keeps_its_last_value_is_stuck() -> None:
    pv = recorded(moves())
    pv[FIRST:AFTER] = pv[FIRST]
    said = asked(pv)
    assert [(effect.code, effect.alternatives) for effect in said.effects] == [("sensor.stuck", ())]
    assert [(w.start_s, w.end_s) for w in said.effects[0].windows] == [(TS * (FIRST + 1), TS * AFTER)]


def test_a_sensor_that_sticks_amid_a_fast_move_is_stuck() -> None:
    """PV is farther on when it comes free, and not back: steps as large as of a signal that is lost."""
    pv = recorded(moves())
    at = int(np.argmax(np.abs(np.diff(pv)))) + 1
    rising = np.sign(pv[at] - pv[at - 1])
    pv[at - 1 :] += 4.0 * rising
    pv[at + 80 :] += 4.0 * rising
    pv[at : at + 80] = pv[at]
    (found,) = find_patterns(experiment(TS, 40.0 + moves(), pv))
    assert found.part.block.code == "sensor.stuck"


def test_a_limit_that_pv_reaches_on_its_way_is_no_lost_signal() -> None:
    pv = np.maximum(recorded(moves()), np.quantile(recorded(moves()), 0.15))
    assert [effect.code for effect in asked(pv).effects] == ["sensor.saturation"]
    assert len(pv) == N
