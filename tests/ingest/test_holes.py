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


def saturating() -> np.ndarray:
    """Moves at every scan but where it stands at a limit."""
    rng = np.random.default_rng(5)
    return np.minimum(100, np.round(97 + 5 * np.sin(np.arange(7200) / 90) + 0.2 * rng.standard_normal(7200), 3))


SATURATING = saturating()


def changed(op: np.ndarray) -> np.ndarray:
    """Where it is stored: at its ends and when it is another one."""
    kept = np.append(True, np.diff(op) != 0)
    kept[-1] = True
    return np.flatnonzero(kept)


def scanned(op_ns: np.ndarray, op: np.ndarray, pv_s: np.ndarray | None = None) -> LoopSamples:
    """Aligned with a PV of every second."""
    pv_ns = (np.arange(7200) if pv_s is None else pv_s) * SECOND
    return align(
        [
            SignalBlock("A.PV", "A", "PV", pv_ns, np.sin(pv_ns / 3e10)),
            SignalBlock("A.OP", "A", "OP", op_ns, op),
        ]
    )


@pytest.mark.parametrize("late_ns", [0, 10**6])
def test_an_op_that_is_stored_when_it_changes_at_nearly_every_scan_keeps_the_value_it_rests_at(late_ns: int) -> None:
    kept = changed(SATURATING)
    assert np.mean(SATURATING == 100) > 0.2
    assert len(kept) > 0.7 * 7200
    assert np.quantile(np.diff(kept), 0.95) == 1
    loop = scanned(kept * SECOND + late_ns, SATURATING[kept])
    np.testing.assert_allclose(loop.op[1:], SATURATING[1:], atol=1.0)
    assert late_ns or np.array_equal(loop.op, SATURATING)


def resting(*, step: int = 1, leaves_by: float = 0.05) -> tuple[np.ndarray, np.ndarray]:
    """Times (s) and values of an OP that stands from second 3000 to 4000."""
    rng = np.random.default_rng(11)
    time_s = np.arange(0, 7200, step)
    op = np.round(50 + np.cumsum(0.1 * rng.standard_normal(len(time_s))), 4)
    stands = (time_s > 3000) & (time_s < 4000)
    op[time_s >= 4000] += op[time_s <= 3000][-1] + leaves_by - op[time_s >= 4000][0]
    return time_s[~stands], op[~stands]


def inside(loop: LoopSamples) -> np.ndarray:
    at = loop.time_ns // SECOND
    return loop.op[(at > 3000) & (at < 4000)]


def test_an_op_rests_where_pv_goes_on() -> None:
    time_s, op = resting()
    held = inside(scanned(time_s * SECOND, op))
    assert len(held) == 999
    assert np.all(held == op[time_s == 3000])


def test_no_op_rests_while_pv_stays_out_too() -> None:
    time_s, op = resting()
    pv_s = np.delete(np.arange(7200), np.s_[3400:3500])
    assert np.all(np.isnan(inside(scanned(time_s * SECOND, op, pv_s))))


def test_no_op_rests_that_left_by_more_than_a_usual_move() -> None:
    time_s, op = resting(leaves_by=0.9)
    assert np.all(np.isnan(inside(scanned(time_s * SECOND, op))))


def test_no_op_rests_over_a_refused_value() -> None:
    time_s, op = resting()
    time_s, op = np.insert(time_s, 3001, 3500), np.insert(op, 3001, np.nan)
    assert np.all(np.isnan(inside(scanned(time_s * SECOND, op))))


def test_an_op_that_is_stored_though_it_stands_has_holes_and_no_rests() -> None:
    time_s, op = resting()
    op[1000:1100] = op[1000]
    assert np.all(np.isnan(inside(scanned(time_s * SECOND, op))))


def test_an_op_of_a_slower_scan_does_not_step_between_its_samples() -> None:
    time_s, op = resting(step=5)
    loop = scanned(time_s * SECOND, op)
    assert np.array_equal(loop.time_ns[np.isfinite(loop.op)], time_s * SECOND)


@pytest.mark.parametrize(("ends", "rests"), [(4665, True), (4948, False)], ids=["at its limit", "while it moves"])
def test_behind_its_last_value_an_op_rests_at_what_it_rested_at_before(ends: int, rests: bool) -> None:
    """Elsewhere it may as well be stored no more."""
    kept = changed(SATURATING)
    kept = kept[kept < ends]
    op = scanned(kept * SECOND, SATURATING[kept]).op
    last = kept[-1]
    assert np.array_equal(op[: last + 1], SATURATING[: last + 1])
    assert np.all(op[last + 1 :] == 100) if rests else np.all(np.isnan(op[last + 1 :]))


@pytest.mark.parametrize(("last", "rests"), [(100.0, True), (0.0, True), (99.0, False), (40.0, False)])
def test_an_op_that_comes_to_a_limit_of_per_cent_for_the_first_time_stays_there(last: float, rests: bool) -> None:
    moving = 60 + 5 * np.sin(np.arange(3000) / 90) + 0.2 * np.random.default_rng(3).standard_normal(3000)
    op = np.append(moving, np.linspace(moving[-1], last, 200))
    found = scanned(np.arange(len(op)) * SECOND, op).op
    assert np.array_equal(found[: len(op)], op)
    assert np.all(found[len(op) :] == last) if rests else np.all(np.isnan(found[len(op) :]))


def test_no_op_rests_at_its_end_where_pv_stays_out_or_a_value_was_refused() -> None:
    kept = changed(SATURATING)
    kept = kept[kept < 4665]
    pv_s = np.delete(np.arange(7200), np.s_[5000:5100])
    assert np.isnan(scanned(kept * SECOND, SATURATING[kept], pv_s).op[kept[-1] + 1 :]).all()
    refused = np.append(SATURATING[kept], np.nan)
    assert np.isnan(scanned(np.append(kept, 6000) * SECOND, refused).op[kept[-1] + 1 :]).all()
