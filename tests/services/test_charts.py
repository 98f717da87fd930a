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
