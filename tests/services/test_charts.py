"""What the charts of a loop show where its record holds what cannot be drawn."""

from collections.abc import Callable

import numpy as np
import pytest

from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.backend import Backend
from app.services.plant.charts import charts
from app.storage import loops, series
from app.storage.samples import Samples
from app.storage.series import Stretch

START_NS, MINUTE = 1_750_000_000_000_000_000, 60_000_000_000
STEPS = np.arange(300)


@pytest.fixture
def charts_of(backend: Backend, warm_kernels: None) -> Callable[..., dict]:
    def told(pv: np.ndarray, sp: np.ndarray) -> dict:
        op = 50 + 5 * np.sin(STEPS / 6)
        samples = Samples(START_NS + STEPS.astype(np.int64) * MINUTE, {"pv": pv, "op": op, "sp": sp})
        with backend.database.write() as connection:
            series.add(connection, [Stretch(loops.ensure(connection, ["FIC1"])["FIC1"], samples)], None)
        run = start_audit(backend)
        audit_chunk(backend, int(run.id), "test")
        return charts(backend, "FIC1")

    return told


@pytest.mark.parametrize("far", [1e308, -1e300, np.inf])
def test_a_marker_of_bad_values_is_missing(charts_of: Callable[..., dict], far: float) -> None:
    pv = 20 + np.sin(STEPS / 6 - 0.8)
    pv[[7, 90]] = far, -far
    told = charts_of(pv, np.full(300, 20.0))
    assert [k for k, value in enumerate(told["trend"]["pv"]) if value is None] == [7, 90]
    assert len(told["pv_op"]["pv"]) == 298
    assert sum(told["errors"]["share_pct"]) == pytest.approx(100.0)


def test_nothing_but_markers(charts_of: Callable[..., dict]) -> None:
    told = charts_of(np.where(STEPS % 2, 1e308, -1e308), np.full(300, 20.0))
    assert (told["errors"], told["spectra"], told["pv_op"]) == (None, None, {"op": [], "pv": []})


def test_an_error_of_a_rounding_has_no_distribution(charts_of: Callable[..., dict]) -> None:
    pv = np.full(300, 20.0)
    pv[5] = np.nextafter(20.0, 21.0)
    assert charts_of(pv, np.full(300, 10.0))["errors"] is None


def test_lines_break_where_nothing_was_recorded(backend: Backend, charts_of: Callable[..., dict]) -> None:
    pv = 20 + np.sin(STEPS / 6 - 0.8)
    charts_of(pv, np.full(300, 20.0))
    later = Samples(START_NS + (STEPS + 400).astype(np.int64) * MINUTE, {"pv": pv, "op": 50 + np.cos(STEPS / 6)})
    with backend.database.write() as connection:
        series.add(connection, [Stretch(loops.ensure(connection, ["FIC1"])["FIC1"], later)], None)
    run = start_audit(backend)
    audit_chunk(backend, int(run.id), "test")
    trend = charts(backend, "FIC1")["trend"]
    assert [k for k, value in enumerate(trend["pv"]) if value is None] == [300]
    assert [trend[name][300] for name in ("op", "sp")] == [None, None]
    assert trend["time"] == sorted(trend["time"])
    assert len(trend["time"]) == 601


def test_signals_of_two_files_that_share_no_times_are_drawn_over_one_another(
    backend: Backend, warm_kernels: None
) -> None:
    times = START_NS + STEPS.astype(np.int64) * MINUTE
    with backend.database.write() as connection:
        loop = loops.ensure(connection, ["FIC1"])["FIC1"]
        series.add(connection, [Stretch(loop, Samples(times, {"pv": 20 + np.sin(STEPS / 6)}))], None)
        series.add(connection, [Stretch(loop, Samples(times + MINUTE // 2, {"op": 50 + np.cos(STEPS / 6)}))], None)
    run = start_audit(backend)
    audit_chunk(backend, int(run.id), "test")
    told = charts(backend, "FIC1")
    assert None not in told["trend"]["pv"] + told["trend"]["op"]
    assert len(told["trend"]["time"]) == len(told["pv_op"]["pv"]) == 299
