"""Patterns that no noise makes are read off PV alone, and none is read off what a gap was bridged with."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch import Comparison, LinearSimulation, explain
from app.engine.mismatch.compare.comparison import record_of
from app.engine.mismatch.compare.patterns import Run, find_patterns, jumps_free
from app.engine.mismatch.compare.preparing import prepare
from app.engine.mismatch.fit.levels import decimals_of
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import run_process
from app.engine.recording import FloatArray
from app.engine.simulate.compression import keep, rebuild
from tests.engine.plain_loop import GIVEN as SIMULATION
from tests.engine.plain_loop import TRUE, TS, N, moves, recorded
from tests.proof.cases import make_case

DOOR = 1.47  # standard deviations of what PV moves from sample to sample


def pattern_codes(pv: FloatArray) -> set[str]:
    return pattern_codes_of(moves(), pv)


def pattern_codes_of(op: FloatArray, pv: FloatArray) -> set[str]:
    return {p.part.block.code for p in find_patterns(experiment(TS, op, pv))}


def test_patterns_of_pv_are_read_off_pv() -> None:
    pv = recorded(moves())
    stuck = pv.copy()
    stuck[500:560] = stuck[499]
    assert pattern_codes(pv) == set()
    assert pattern_codes(np.round(pv, 3)) == set()
    assert pattern_codes(stuck) == {"sensor.stuck"}
    assert pattern_codes(0.8 * np.round(pv / 0.8)) == {"sensor.quantization"}
    twice = 0.8 * np.round(pv / 0.8) * np.where(np.arange(N) % 2, 1.0, 1.0 + 4e-16)
    assert pattern_codes(twice) == {"sensor.quantization"}
    assert pattern_codes(np.minimum(pv, 53.0)) == {"sensor.saturation"}
    kept = np.arange(0, N, 9)
    assert pattern_codes(np.interp(np.arange(N), kept, pv[kept])) == {"sensor.compression"}


def test_what_a_gap_was_bridged_with_is_no_pattern() -> None:
    """A line over a long gap hardly rises from sample to sample: a pause of the historian was called a stuck sensor."""
    pv, known = recorded(moves()), np.ones(N, dtype=np.bool_)
    known[500:560] = known[700:] = False
    pv[500:560], pv[700:] = np.linspace(pv[499], pv[560], 60), np.max(pv)
    comparison = Comparison("loop", TS, moves(), pv, known=known)
    assert find_patterns(record_of(comparison)) == ()
    assert find_patterns(record_of(replace(comparison, known=None))) != ()


@pytest.mark.parametrize("worse", ["levels", "held"])
def test_what_a_gap_was_bridged_with_hides_no_pattern(worse: str) -> None:
    """Straight lines over gaps take values between the levels, and move where a historian that stores changes holds."""
    pv, known = recorded(moves()), np.ones(N, dtype=np.bool_)
    if worse == "levels":
        seen = 0.8 * np.round(pv / 0.8)
    else:
        seen = pv[np.maximum.accumulate(np.where(keep(np.arange(float(N)), pv, 0.3, "exception"), np.arange(N), 0))]
    bridged = seen.copy()
    for first in range(60, N - 60, 100):
        known[first : first + 12] = False
        bridged[first : first + 12] = np.linspace(seen[first - 1], seen[first + 12], 14)[1:-1]
    whole, holed = (find_patterns(record_of(Comparison("loop", TS, moves(), x, known=known))) for x in (seen, bridged))
    assert [p.part.block.code for p in whole] == [p.part.block.code for p in holed] != []
    assert [p.part.values[0] for p in holed] == pytest.approx([p.part.values[0] for p in whole], rel=0.05)


def test_one_stuck_stretch_is_seen_where_hardly_anything_else_repeats() -> None:
    pv = recorded(moves())
    stuck = pv.copy()
    stuck[500:560] = stuck[499]
    for k in (100, 200, 300, 400):
        stuck[k] = stuck[k - 1]
    assert pattern_codes(stuck) == {"sensor.stuck"}


def test_near_its_extreme_a_sensor_that_comes_free_jumps_and_a_limit_does_not() -> None:
    pv = recorded(moves())
    stuck, at = pv.copy(), int(np.argmax(pv))
    stuck[at - 80 : at] = np.min(pv) - 0.001
    stuck[-1] = np.min(pv) - 0.01
    assert pattern_codes(stuck) == {"sensor.dropout"}
    stuck[at - 80 : at] = np.min(pv) - 0.02
    assert pattern_codes(stuck) == {"sensor.dropout"}
    wave = 50.0 + 5.0 * np.sin(np.arange(N) / 60.0) + 0.02 * np.random.default_rng(1).normal(size=N)
    pressed = np.maximum(wave, 45.1)
    first = int(np.argmax(pressed == 45.1))
    left = first + int(np.argmax(pressed[first + 10 :] > 45.1)) + 9
    assert not jumps_free(pressed, Run(first, left))
    assert jumps_free(stuck, Run(at - 80, at - 1))
    assert not jumps_free(stuck, Run(N - 20, N - 1))


RIGHT = LinearSimulation(TRUE.K, (TRUE.tau,), TRUE.theta)
STEPS = 40.0 + np.repeat(np.random.default_rng(2).uniform(-8.0, 8.0, N // 200), 200)


def settled(sigma: float = 0.0) -> FloatArray:
    """A PV that comes to rest after each step of OP, beside a little noise."""
    return 50.0 + run_process(STEPS - 40.0, TRUE, TS) + sigma * np.random.default_rng(5).normal(size=N)


def believed(pv: FloatArray, op: FloatArray = STEPS) -> list[str]:
    prepared = prepare(Comparison("settled", TS, op, pv, simulation=RIGHT))
    return [pattern.part.block.code for pattern in prepared.patterns]


@pytest.mark.parametrize("sigma", [0.0, 0.002])
def test_a_pv_that_rests_where_the_refit_does_shows_no_pattern(sigma: float) -> None:
    pv = np.round(settled(sigma), 2)
    assert pattern_codes_of(STEPS, pv) != set()
    assert believed(pv) == []
    said = explain(Comparison("settled", TS, STEPS, pv, simulation=RIGHT))
    assert (said.verdict, said.effects) == ("consistent", ())


def test_a_sensor_that_stops_or_ends_is_seen_beside_a_right_simulation() -> None:
    op, pv = 40.0 + moves(), 50.0 + run_process(moves(), TRUE, TS)
    stuck = pv.copy()
    stuck[500:560] = stuck[499]
    assert believed(np.round(stuck, 2), op) == ["sensor.stuck"]
    assert believed(np.round(np.minimum(pv, 53.0), 2), op) == ["sensor.saturation"]
    kept = keep(np.arange(float(N)), settled(0.1), 0.5, "exception")
    held = settled(0.1)[np.maximum.accumulate(np.where(kept, np.arange(N), 0))]
    assert believed(np.round(held, 2)) == ["sensor.compression"]


def test_the_decimals_of_a_signal_are_told_by_few_of_their_levels() -> None:
    rng = np.random.default_rng(0)
    assert decimals_of(np.round(rng.normal(size=600), 2)) == pytest.approx(0.01)
    assert decimals_of(rng.normal(size=600)) == 0.0
    assert decimals_of(np.full(9, 3.0)) == 0.0


def test_a_pattern_is_told_as_closely_as_pv_was_kept() -> None:
    """A limit to half of PV's last decimal, a moment to the sample before; of a PV that was not rounded the limit is
    what it stands at.
    """
    rounded = np.round(np.minimum(recorded(moves()), 53.0042), 2)
    rounded[500:560] = rounded[499]
    said = explain(Comparison("loop", TS, moves(), rounded, simulation=SIMULATION)).effects
    told = {p.name: (p.low, p.value, p.high) for effect in said for p in effect.parameters}
    assert told["limit"] == pytest.approx((52.995, 53.0, 53.005))
    assert told["start"] == pytest.approx((499 * TS, 500 * TS, 500 * TS))
    assert told["end"] == pytest.approx((559 * TS, 560 * TS, 560 * TS))


def test_a_limit_of_a_pv_that_was_not_rounded_is_where_it_stands() -> None:
    limited = np.minimum(recorded(moves()), 53.0042)
    (said,) = explain(Comparison("loop", TS, moves(), limited, simulation=SIMULATION)).effects
    assert (said.parameters[0].low, said.parameters[0].high) == pytest.approx((53.0042, 53.0042))


def test_corners_of_a_historian_s_lines_are_no_drift() -> None:
    """A sound loop beside its simulation, as a swinging door left it: a drift gained 138 nat of its corners, where 16
    were asked.
    """
    case = make_case(820_100_001, (), foreign=True)
    at = np.arange(len(case.pv)) * case.ts
    kept = keep(at, case.pv, DOOR * float(np.std(np.diff(case.pv))), "swinging_door")
    left = rebuild(at, case.pv, kept, "swinging_door")
    found = explain(Comparison("doors", case.ts, case.op, left, case.sp, case.measured, trace=case.trace))
    assert [effect.code for effect in found.effects] == ["sensor.compression"]


def test_what_a_historian_stored_is_counted() -> None:
    pv, at = recorded(moves()), np.arange(N) * TS
    for kind in ("swinging_door", "exception"):
        kept = keep(at, pv, 0.4, kind)
        pattern = find_patterns(experiment(TS, moves(), rebuild(at, pv, kept, kind)))[0]
        assert pattern.told_share == pytest.approx(np.mean(kept), rel=0.1)
    lines = np.interp(np.arange(N), np.arange(0, N, 7), pv[::7])
    assert find_patterns(experiment(TS, moves(), lines))[0].told_share == pytest.approx(1.0 / 7.0, rel=0.05)
