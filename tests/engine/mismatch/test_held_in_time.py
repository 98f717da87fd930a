"""Times of a PV that is held are those at which it was taken, from the start of the recording."""

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain
from app.engine.recording import FloatArray
from tests.engine.mismatch.test_held import GIVEN, INSTANTS, TS, N, held, moves, recorded

EVERY = 12.0  # samples


def analysed(signal: FloatArray, first: float, simulation: LinearSimulation = GIVEN) -> Explanation:
    return explain(Comparison("analyser", TS, 40.0 + moves(), held(signal, EVERY, first), simulation=simulation))


@pytest.mark.parametrize(("first", "phase"), [(5.0, 5.0), (8.0, -4.0)])
def test_traces_and_windows_begin_with_the_first_instant(first: float, phase: float) -> None:
    signal = recorded(moves())
    said = analysed(signal, first)
    traces = said.traces
    assert traces.time_s[0] == phase * TS
    assert np.diff(traces.time_s) == pytest.approx(EVERY * TS)
    assert traces.pv[1:] == pytest.approx(np.interp(traces.time_s[1:], INSTANTS, signal))
    (kept_out,) = said.fit.held_out
    assert kept_out.start_s == traces.time_s[traces.held_out][0]
    assert kept_out.end_s == min(traces.time_s[traces.held_out][-1] + EVERY * TS, N * TS)
    assert said.effects[0].windows[0].start_s == max(phase * TS, 0.0)


def test_what_acts_in_time_is_told_by_the_clock_of_the_recording() -> None:
    """Judged by a moment, and by what PV shows: the sensor steps, or is stuck."""
    first = 5.0
    step = analysed(recorded(moves()) + 4.0 * (INSTANTS >= 1500.0), first).effects[1]
    assert "sensor.step" in (step.code, *step.alternatives)
    assert step.windows[0].start_s == pytest.approx(1500.0, abs=EVERY * TS)
    signal = recorded(moves())
    signal[700:1000] = signal[700]
    stuck = next(effect for effect in analysed(signal, first).effects if effect.code == "sensor.stuck")
    assert stuck.windows[0].start_s == pytest.approx(700 * TS, abs=2.0 * EVERY * TS)
    assert (stuck.windows[0].start_s / TS - first) % EVERY == pytest.approx(0.0)
    assert stuck.parameters[0].value == pytest.approx(stuck.windows[0].start_s)
    assert stuck.windows[0].end_s <= N * TS
