"""Every window that an explanation tells lies within its recording."""

import numpy as np
import pytest

from app.engine.mismatch import Comparison, explain
from tests.engine.mismatch.test_held import GIVEN, TS, N, held, moves, recorded


def every_window(comparison: Comparison, second: Comparison | None = None) -> list[tuple[float, float]]:
    said = explain(comparison, second)
    assert said.effects
    judged = () if said.validation is None else said.validation.held_out
    told = [*said.located.windows, *said.fit.held_out, *judged]
    told += [window for effect in said.effects for window in effect.windows]
    told += [(e.value, e.value) for effect in said.effects for e in effect.parameters if e.name == "end"]
    return [(w.start_s, w.end_s) if not isinstance(w, tuple) else w for w in told]


@pytest.mark.parametrize(
    ("every", "first", "is_stuck"), [(12.0, 0.0, True), (7.25, 3.0, True), (40.0, 33.0, True), (40.0, 33.0, False)]
)
def test_windows_of_a_held_pv_end_with_the_recording(every: float, first: float, is_stuck: bool) -> None:
    """The last value may be held on beyond the last sample, and a sensor be stuck until then."""
    pv = recorded(moves())
    if is_stuck:
        pv[N - 400 :] = pv[N - 400]
    comparison = Comparison("analyser", TS, 40.0 + moves(), held(pv, every, first), simulation=GIVEN)
    for start_s, end_s in every_window(comparison, comparison):
        assert 0.0 <= start_s <= end_s <= N * TS


def test_windows_of_a_pv_that_is_not_held_end_with_the_recording() -> None:
    pv = recorded(moves())
    pv[N - 400 :] = pv[N - 400]
    told = every_window(Comparison("stuck", TS, 40.0 + moves(), pv, simulation=GIVEN))
    assert max(end_s for _, end_s in told) == N * TS
    assert np.min(told) >= 0.0
