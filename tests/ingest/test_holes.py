"""Signals that were sampled each at its own times: where one has a hole, nothing is drawn over it."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from app.engine.fitness import assess
from app.engine.simulate import keep
from app.ingest import LoopSamples, SignalBlock, align, to_recording

from .conftest import Read

FIRST = datetime(2026, 3, 4, 10)
SECOND = 10**9


def stamp(after_s: float) -> str:
    return (FIRST + timedelta(seconds=after_s)).isoformat(timespec="milliseconds")


def export(op_rows: list[str]) -> str:
    pv_rows = [f"A.PV,{stamp(k)},{np.sin(k / 20):.4f}" for k in range(1800)]
    return "\n".join(["tag,time,value", *pv_rows, *op_rows]) + "\n"


def op_rows(value_in_hole: str | None) -> list[str]:
    """Every two seconds, 0.4 s behind PV; for 15 minutes nothing is known."""
    rows = []
    for k in range(0, 1800, 2):
        known = not 600 <= k < 1500
        if known or value_in_hole is not None:
            rows.append(f"A.OP,{stamp(k + 0.4)},{f'{50 + np.cos(k / 20):.4f}' if known else value_in_hole}")
    return rows


@pytest.mark.parametrize("value_in_hole", [None, "Bad", ""])
def test_no_line_is_drawn_over_a_hole(read: Read, value_in_hole: str | None) -> None:
    loop = read(export(op_rows(value_in_hole))).loops["A"]
    assert loop.resampled == ("OP",)
    at = (loop.time_ns - loop.time_ns[0]) / SECOND
    assert np.array_equal(at[np.isnan(loop.op)], [0, *range(599, 1501), 1799])
    fitness = assess(to_recording(loop, "A"))
    assert fitness.gaps == 1
    assert fitness.missing_share == pytest.approx(0.5, abs=0.01)


def test_a_single_refused_value_leaves_its_neighbours(read: Read) -> None:
    rows = [row if k != 300 else f"A.OP,{stamp(600.4)},Bad" for k, row in enumerate(op_rows("51"))]
    loop = read(export(rows)).loops["A"]
    at = (loop.time_ns - loop.time_ns[0]) / SECOND
    assert at[np.isnan(loop.op)].tolist() == [0, 599, 600, 601, 602, 1799]


def stored(time_s: np.ndarray, op: np.ndarray) -> LoopSamples:
    """Aligned with a PV of every second; OP as it was stored, half a second late."""
    pv_ns = np.arange(7200) * SECOND
    op_ns = ((time_s + 0.5) * SECOND).astype(np.int64)
    blocks = [
        SignalBlock("A.PV", "A", "PV", pv_ns, np.sin(pv_ns / 3e10)),
        SignalBlock("A.OP", "A", "OP", op_ns, op),
    ]
    return align(blocks)


@pytest.mark.parametrize("deviation", [0.02, 0.05, 0.1])
def test_what_a_swinging_door_left_out_is_no_hole(deviation: float) -> None:
    rng = np.random.default_rng(7)
    time_s = np.arange(7200.0)
    op = np.sin(time_s / 60) + 0.3 * np.sin(time_s / 11) + 0.02 * rng.standard_normal(7200)
    op[2000:6000] = op[2000]  # in manual: two values are stored of it
    kept = keep(time_s, op, deviation, "swinging_door")
    assert kept.mean() < 0.5
    assert np.isnan(stored(time_s[kept], op[kept]).op).sum() <= 2
    assert np.max(np.diff(time_s[kept])) > 3000


def reported(op: np.ndarray, deviation: float) -> np.ndarray:
    """Where it is stored: when it has moved by more than the deviation since it was stored last."""
    kept = [0]
    for k in range(1, len(op)):
        if abs(op[k] - op[kept[-1]]) > deviation:
            kept.append(k)
    return np.array(kept)


def test_a_rest_of_an_op_that_is_reported_by_exception_is_no_hole() -> None:
    """Its next value is another one: that it has moved is why it was stored."""
    op = 50 + 5 * np.sin(np.arange(7200) / 40)
    op[1800:5400] = op[1800]
    op[5400:] = op[1800] + 5 * np.sin(np.arange(1800) / 40)
    kept = reported(op, 0.05)
    assert np.max(np.diff(kept)) > 3500
    loop = stored(kept.astype(np.float64), op[kept])
    assert np.isnan(loop.op).sum() <= 7200 - kept[-1]
    np.testing.assert_allclose(loop.op[1810:5390], op[1800], atol=0.15)


MOVING = np.cumsum(np.tile([1.0, 2.0, 4.0], 250))


@pytest.mark.parametrize(
    "seldom", [np.arange(2700.0, 7200.0, 900.0), np.array([7190.0])], ids=["steps by hand", "straight ramp"]
)
def test_intervals_of_a_signal_that_is_stored_when_it_changes_are_no_holes(seldom: np.ndarray) -> None:
    times = np.concatenate((MOVING, seldom))
    op = stored(times, times / 100).op
    assert np.isnan(op[2 : int(times[-1])]).sum() == 0


def test_a_refused_value_in_a_rest_makes_a_hole() -> None:
    times = np.concatenate((MOVING, [4000.0, 7198.0]))
    values = np.where(times == 4000.0, np.nan, times)
    assert np.isnan(stored(times, values).op).sum() > 5000


def test_a_signal_that_is_sampled_evenly_has_a_hole_though_it_stands_still() -> None:
    time_s = np.arange(0.0, 7200.0, 2.0)
    there = (time_s < 2000) | (time_s > 6000)
    op = np.where(time_s < 1000, np.sin(time_s), 100.0)
    assert np.isnan(stored(time_s[there], op[there]).op).sum() > 3900


@pytest.mark.parametrize("late_ns", [0, 10**6])
def test_an_op_that_is_stored_when_it_changes_is_no_op_with_holes(late_ns: int) -> None:
    """Whether it is stamped exactly on PV's scans or a millisecond later."""
    rng = np.random.default_rng(3)
    changes = np.flatnonzero(rng.random(7200) < 0.25)
    pv_ns = np.arange(7200) * SECOND
    op = np.sin(changes / 60)
    blocks = [
        SignalBlock("A.PV", "A", "PV", pv_ns, np.sin(pv_ns / 3e10)),
        SignalBlock("A.OP", "A", "OP", pv_ns[changes] + late_ns, op),
    ]
    loop = align(blocks)
    assert loop.resampled == ("OP",)
    assert loop.samples == 7200
    inside = slice(int(changes[0]) + 1, int(changes[-1]) + 1)
    np.testing.assert_allclose(loop.op[inside], np.sin(np.arange(7200) / 60)[inside], atol=0.02)


def test_an_op_of_a_slower_scan_is_known_at_that_alone() -> None:
    pv_ns = np.arange(7200) * SECOND
    blocks = [
        SignalBlock("A.PV", "A", "PV", pv_ns, np.sin(pv_ns / 3e10)),
        SignalBlock("A.OP", "A", "OP", pv_ns[::5], np.cos(pv_ns[::5] / 3e10)),
    ]
    loop = align(blocks)
    assert loop.resampled == ()
    assert np.isfinite(loop.op).sum() == 1440
