"""What the charts of a loop show where its record holds what cannot be drawn."""

from collections.abc import Callable
from datetime import datetime, timedelta

import numpy as np
import pytest

from app.services.audit_json.spectra import STORED_FREQUENCIES
from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.backend import Backend
from app.services.moments import iso_utc, moment_of
from app.services.plant import charts as charts_module
from app.services.plant.charts import charts, closer
from app.services.plant.loop_verdicts import verdict_detail
from app.services.reports.documents import loop_report
from app.storage import loops, series
from app.storage.samples import Samples
from app.storage.series import Stretch
from tests.services.spoiled import loop_id_of, spoil

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
    assert (told["errors"], told["spectra"]) == (None, None)
    assert told["pv_op"] == {"samples": 0, "shown": 0, "op": [], "pv": [], "standing": []}


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
    # However close one looks: what is shown of the time around the hole may be the two samples beside it alone.
    for first, last, broken in ((310, 390, 1), (299, 400, 2), (295, 310, 6)):
        at = (moment_of(START_NS + k * MINUTE) for k in (first, last))
        part = closer(backend, "FIC1", *at)["trend"]
        assert [k for k, value in enumerate(part["pv"]) if value is None] == [broken]


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
    assert (len(told["trend"]["time"]), len(told["pv_op"]["pv"])) == (299, 298)  # the first PV comes before any OP


@pytest.fixture
def detail_with(monkeypatch: pytest.MonkeyPatch) -> Callable[[dict], None]:
    """Verdicts of which this is stored instead."""

    def stored(other: dict) -> None:
        monkeypatch.setattr(charts_module, "verdict_detail", lambda *asked: verdict_detail(*asked) | other)

    return stored


def test_a_record_of_uneven_samples_has_the_lines_of_its_signals_alone(
    backend: Backend, detail_with: Callable[[dict], None], warm_kernels: None
) -> None:
    """By the number of the sample a sine of 400 s has a second line, and another period."""
    second = np.cumsum(np.where(np.arange(1200) % 2, 2, 10))
    wave = 2.0 * np.pi * second / 400.0
    samples = Samples(
        START_NS + second.astype(np.int64) * 1_000_000_000, {"pv": 20 + np.sin(wave - 0.8), "op": 50 + 5 * np.sin(wave)}
    )
    with backend.database.write() as connection:
        series.add(connection, [Stretch(loops.ensure(connection, ["FIC1"])["FIC1"], samples)], None)
    run = start_audit(backend)
    audit_chunk(backend, int(run.id), "test")
    detail_with({"spectra": None})
    told = charts(backend, "FIC1")["spectra"]
    assert len(told["frequency_hz"]) <= STORED_FREQUENCIES
    pv, frequency = np.array(told["pv_amplitude"]), np.array(told["frequency_hz"])
    assert frequency[np.argmax(pv)] == pytest.approx(1.0 / 400.0, abs=frequency[1] - frequency[0])
    assert np.max(pv[np.abs(frequency * 400.0 - 1.0) > 0.2]) < 0.05 * np.max(pv)


@pytest.mark.parametrize("size", [{}, {"stiction_size": None}, {"stiction_size": {"S": 3.0, "S_intervals": []}}])
def test_the_valve_is_shown_with_the_size_that_is_stored(
    charts_of: Callable[..., dict], detail_with: Callable[[dict], None], size: dict
) -> None:
    """Verdicts of before the size was told have none; the size has no J."""
    two = {"S": [1.0, 2.0], "J": [0.0, 1.5], "best": 1, "rmse": [1.0, 0.5]}
    one = {"d": [0.0], "rmse": [1.0], "best": 0}
    detail_with({"rungs": [{"one_parameter": one, "two_parameter": two}], "stiction_size": None} | size)
    told = charts_of(20 + np.sin(STEPS / 6 - 0.8), np.full(300, 20.0))
    assert told["valve"] == ({"S": 3.0, "J": 0.0} if size.get("stiction_size") else {"S": 2.0, "J": 1.5})


def test_where_no_stiction_was_looked_for_there_is_neither_a_curve_nor_a_valve(
    charts_of: Callable[..., dict], detail_with: Callable[[dict], None]
) -> None:
    detail_with({"rungs": [], "stiction_size": None})
    told = charts_of(20 + np.sin(STEPS / 6 - 0.8), np.full(300, 20.0))
    assert (told["rmse_d"], told["rmse_sj"], told["valve"]) == (None, None, None)
    assert "valve" not in told["trend"]


def test_a_part_of_the_trend_has_all_samples_of_it_and_one_beyond_either_end(
    backend: Backend, charts_of: Callable[..., dict], monkeypatch: pytest.MonkeyPatch
) -> None:
    pv = 20 + np.sin(STEPS / 6 - 0.8)
    monkeypatch.setattr(charts_module, "POINTS", 40)
    whole = charts_of(pv, np.full(300, 20.0))["trend"]
    assert (whole["samples"], whole["shown"]) == (300, len(whole["time"]))
    assert whole["shown"] <= 42
    at = [moment_of(START_NS + k * MINUTE) for k in (100, 120)]
    part = closer(backend, "FIC1", *at)["trend"]
    assert (part["samples"], part["shown"]) == (23, 23)
    assert part["pv"] == pytest.approx(pv[99:122])
    assert part["time"][1] == iso_utc(at[0])


@pytest.mark.parametrize("days", [-400, 400])
def test_a_part_without_samples_has_none(backend: Backend, charts_of: Callable[..., dict], days: int) -> None:
    charts_of(20 + np.sin(STEPS / 6), np.full(300, 20.0))
    at = moment_of(START_NS) + timedelta(days=days)
    assert len(closer(backend, "FIC1", at, at + timedelta(hours=1))["trend"]["time"]) <= 1


def swinging(samples: int) -> tuple[np.ndarray, np.ndarray]:
    """PV stands at 30 or 10 while OP (a triangle of 40 samples) travels, and jumps where OP has come far enough."""
    step = np.arange(samples)
    op = 50 + 5 * np.abs(step % 40 / 10 - 2) - 5
    return np.where(step % 40 // 20, 30.0, 10.0) + 0.01 * np.sin(step), op


def audited_charts(backend: Backend, pv: np.ndarray, op: np.ndarray) -> dict:
    times = START_NS + np.arange(len(pv)).astype(np.int64) * MINUTE
    with backend.database.write() as connection:
        loop = loops.ensure(connection, ["FIC1"])["FIC1"]
        series.add(connection, [Stretch(loop, Samples(times, {"pv": pv, "op": op}))], None)
    audit_chunk(backend, int(start_audit(backend).id), "test")
    return charts(backend, "FIC1")


def test_where_op_travels_and_pv_stands_is_marked_in_both_charts(backend: Backend, warm_kernels: None) -> None:
    pv, op = swinging(800)
    told = audited_charts(backend, pv, op)
    for chart in (told["trend"], told["pv_op"]):
        marked = np.array(chart["standing"], bool)
        assert 0.4 < marked.mean() < 0.9
        jumps = np.flatnonzero(np.abs(np.diff(chart["pv"])) > 10)
        assert not marked[jumps].any()
    assert told["judged"] is None


def test_nothing_is_marked_where_pv_follows(backend: Backend, warm_kernels: None) -> None:
    op = 50 + 5 * np.sin(np.arange(800) / 6)
    told = audited_charts(backend, 0.5 * op, op)
    assert np.mean(told["trend"]["standing"]) < 0.05


def test_of_a_long_record_the_stretch_that_speaks_for_it_is_told_and_drawn(
    backend: Backend, warm_kernels: None
) -> None:
    told = audited_charts(backend, *swinging(6000))
    first, last = (datetime.fromisoformat(at).timestamp() for at in told["judged"])
    assert told["pv_op"]["samples"] == pytest.approx((last - first) / 60 + 1, abs=1)
    assert told["pv_op"]["samples"] < told["trend"]["samples"] == 6000
    assert told["pv_op"]["shown"] == len(told["pv_op"]["pv"])


def test_a_damaged_stretch_is_told_and_the_rest_is_drawn(backend: Backend, charts_of: Callable[..., dict]) -> None:
    whole = charts_of(20 + np.sin(STEPS / 6 - 0.8), np.full(300, 20.0))
    assert whole["damage"] is None
    loop_id = loop_id_of(backend, "FIC1")
    later = START_NS + (300 + STEPS[:10].astype(np.int64)) * MINUTE
    with backend.database.write() as connection:
        series.add(connection, [Stretch(loop_id, Samples(later, {"pv": np.ones(10), "op": np.ones(10)}))], None)
    spoil(backend, loop_id, int(later[0]))
    told = charts(backend, "FIC1")
    assert told["trend"]["samples"] == 300
    assert told["damage"].startswith("What was stored from 2025-06-15 20:06 to 2025-06-15 20:15 cannot be read")
    assert "send its export again" in told["damage"]
    spoil(backend, loop_id, START_NS)
    told = charts(backend, "FIC1")
    assert (told["trend"], told["pv_op"], "cannot be read" in told["damage"]) == (None, None, True)
    assert "cannot be read" in loop_report(backend, "FIC1")
