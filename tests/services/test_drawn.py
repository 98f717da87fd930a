"""What is drawn of a record, part by part: signs, order and bounds that a person reads a valve by."""

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from app.services.plant import charts
from app.services.plant.charts import SCATTERED, _drawn, _errors, _Record, _scatter, _size, judged_stretch
from app.services.plant.standing import judged_part
from app.storage.samples import Samples


def record(n: int, pv: np.ndarray, sp: np.ndarray | None, inside: np.ndarray, judged: np.ndarray) -> _Record:
    times = np.arange(n, dtype=np.int64) * 10**9
    return _Record(Samples(times, {}), pv, np.arange(float(n)), sp, inside, judged, np.zeros(n, np.bool_))


def test_an_error_is_set_point_less_pv_in_the_window_alone() -> None:
    n = 200
    pv = np.where(np.arange(n) < 100, 40.0 - np.arange(n) % 2, 90.0)
    inside = np.arange(n) < 100
    told = _errors(record(n, pv, np.full(n, 50.0), inside, inside))
    assert told is not None
    assert min(told["middle"]) == pytest.approx(10.0, abs=0.02)
    assert max(told["middle"]) == pytest.approx(11.0, abs=0.02)
    assert sum(told["share_pct"]) == pytest.approx(100.0)


def test_of_many_points_of_what_was_judged_the_newest_are_drawn_in_a_row() -> None:
    n = 3 * SCATTERED
    everywhere, judged = np.full(n, True), np.arange(n) < 2 * SCATTERED
    told = _scatter(record(n, np.arange(float(n)), None, everywhere, judged))
    assert (told["samples"], told["shown"]) == (2 * SCATTERED, SCATTERED)
    assert told["op"] == list(range(SCATTERED, 2 * SCATTERED))


def test_a_size_is_drawn_with_its_widest_interval_and_only_where_the_record_tells_it() -> None:
    size: dict[str, Any] = {"identifiable": True, "S": 2.0}
    size["S_intervals"] = [{"low": 1.9, "high": 2.1}, {"low": 1.5, "high": 2.5}]
    assert _size({"stiction_size": size}) == {"S": 2.0, "low": 1.5, "high": 2.5}
    assert _size({"stiction_size": size | {"identifiable": False}}) is None
    assert _size({}) is None


def test_a_stretch_speaks_for_a_record_whose_verdict_was_reached_by_stretches() -> None:
    part = {"start_s": 60.0, "end_s": 120.0}
    reached = {"reasons": [{"code": "no_oscillation"}], "identified": part}
    assert judged_part(reached) is None
    assert judged_part(reached | {"reasons": [*reached["reasons"], {"code": "stretches"}]}) == part


def test_the_stretch_is_where_it_was_in_the_window_that_was_judged() -> None:
    """All its times are from the beginning of what was given to the engine, which is before the window."""
    detail = {"reasons": [{"code": "stretches"}], "window": {"start_s": 600.0}}
    detail |= {"identified": {"start_s": 900.0, "end_s": 1500.0}}
    window = ["2026-01-01T00:10:00.000Z", "2026-01-01T01:00:00.000Z"]
    assert judged_stretch(window, detail) == ["2026-01-01T00:15:00Z", "2026-01-01T00:25:00Z"]
    assert judged_stretch(None, detail) is None


@pytest.mark.parametrize(("audit_id", "of_run"), [("4", 4), (None, 9)])
def test_what_is_drawn_is_what_the_run_was_given(
    monkeypatch: pytest.MonkeyPatch, audit_id: str | None, of_run: int
) -> None:
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr(charts, "find", lambda *_: SimpleNamespace(id=3, newest_audit_id=9))
    input_of = {"input_of": lambda _, loop_id, run: asked.append((loop_id, run))}
    monkeypatch.setattr(charts, "verdicts", SimpleNamespace(**input_of))
    backend: Any = SimpleNamespace(database=SimpleNamespace(read=nullcontext))
    assert _drawn(backend, "FIC1", audit_id, {}).record is None
    assert asked == [(3, of_run)]
