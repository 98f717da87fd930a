"""The band of a historian is told with an interval that holds it as often as it says."""

from functools import cache

import numpy as np
import pytest

from app.engine.mismatch import Comparison, explain
from app.engine.mismatch.compare.comparison import record_of
from app.engine.mismatch.compare.even_grid import comparison_of
from app.engine.mismatch.compare.patterns import compressed, find_patterns
from app.engine.mismatch.compare.widths import Width, band_of, below, door_of, scan_of
from app.engine.mismatch.loop.experiment import experiment
from app.engine.recording import FloatArray, Recording
from app.engine.simulate.compression import Compression, keep, rebuild
from tests.engine.plain_loop import GIVEN, TS, moves, recorded

N, DRAWS = 2400, range(60)


def loop(rng: np.random.Generator, sigma: float) -> FloatArray:
    """PV of a PI loop under a load that wanders, its set point moved or at rest."""
    sp = np.repeat(rng.uniform(-5.0, 5.0, 20) * rng.choice([0.0, 0.3, 1.0]), N // 20)
    tau, wander, pole = rng.uniform(5.0, 40.0), rng.uniform(0.15, 1.2), rng.uniform(0.9, 0.995)
    gain, ti, line = rng.uniform(0.4, 1.2), rng.uniform(15.0, 40.0), [0.0] * int(rng.integers(1, 6))
    pv, y, summed, load = np.zeros(N), 0.0, 0.0, 0.0
    for t in range(N):
        pv[t] = y + sigma * rng.standard_normal()
        summed += (sp[t] - pv[t]) / ti
        line.append(gain * (sp[t] - pv[t] + summed))
        load = pole * load + wander * np.sqrt(1.0 - pole**2) * rng.standard_normal()
        y += (1.0 - np.exp(-1.0 / tau)) * (1.3 * (line.pop(0) + load) - y)
    return pv


@cache
def drawn(seed: int) -> tuple[float, int, float, FloatArray]:
    """The noise, each how many samples PV is scanned, where in its range a band lies, and PV."""
    rng = np.random.default_rng(seed)
    sigma, scan = float(np.exp(rng.uniform(np.log(0.03), np.log(0.3)))), int(rng.choice([1, 1, 2, 4]))
    place = rng.uniform()
    return sigma, scan, place, loop(rng, sigma)[::scan]


def told(seed: int, kind: Compression, times: tuple[float, float]) -> tuple[float, Width | None]:
    """What is told of a band that is so many times the noise, of PV scanned each to each fourth sample; nothing where
    the band is a third of PV's range and leaves hardly any sample of it.
    """
    sigma, scan, place, pv = drawn(seed)
    low, high = np.log(times)
    band = sigma * float(np.exp(low + (high - low) * place))
    at = np.arange(0.0, N, scan)
    stored = rebuild(at, pv, keep(at, pv, band, kind), kind)
    every = np.arange(int(at[-1]) + 1.0)
    shown = np.interp(every, at, stored) if kind == "swinging_door" else np.repeat(stored, scan)[: len(every)]
    patterns = find_patterns(experiment(1.0, moves()[np.arange(len(every)) % 1200], shown))
    if np.ptp(pv) < 3.0 * band:
        return band, None
    return band, next((pattern.width for pattern in patterns if pattern.width is not None), None)


@pytest.mark.parametrize(("times", "sharp"), [((1.2, 2.5), 0.1), ((2.5, 20.0), 0.7)])
def test_the_width_of_a_swinging_door_lies_in_its_interval(times: tuple[float, float], sharp: float) -> None:
    """Sharply where the noise makes the door shut on scans in a row, roughly where it does not."""
    found = [(band, width) for band, width in (told(seed, "swinging_door", times) for seed in DRAWS) if width]
    assert len(found) >= 40
    held = [width.low <= band <= width.high for band, width in found]
    assert np.mean(held) >= 0.9
    off = [abs(np.log(width.value / band)) for band, width in found]
    assert np.median(off) < sharp
    assert abs(np.median([np.log(width.value / band) for band, width in found])) < 0.25
    assert all(width.low < width.value <= width.high for _, width in found)


def test_the_band_of_what_is_held_lies_in_its_interval() -> None:
    found = [(band, width) for band, width in (told(seed, "exception", (1.5, 10.0)) for seed in DRAWS) if width]
    assert len(found) >= 40
    assert np.mean([width.low <= band <= width.high for band, width in found]) >= 0.9
    assert all(width.value == pytest.approx(band, rel=0.1) for band, width in found)


def test_an_explanation_tells_the_width_with_its_interval() -> None:
    pv, width = recorded(moves()), 0.3
    at = TS * np.arange(len(pv))
    shown = rebuild(at, pv, keep(at, pv, width, "swinging_door"), "swinging_door")
    said = explain(Comparison("loop", TS, 40.0 + moves(), shown, simulation=GIVEN))
    assert said.effects[0].code == "sensor.compression"
    (deviation,) = said.effects[0].parameters
    assert deviation.low < deviation.value <= deviation.high
    assert deviation.low <= width <= deviation.high
    assert deviation.value == pytest.approx(width, rel=0.1)


def test_what_lies_above_a_width_tells_it() -> None:
    drawn = [below(2.0 + np.random.default_rng(seed).exponential(0.5, 30)) for seed in range(200)]
    assert 0.91 <= np.mean([width.low <= 2.0 <= width.high for width in drawn]) <= 0.985
    assert np.mean([width.value for width in drawn]) == pytest.approx(2.0, abs=0.01)


def test_a_value_that_was_kept_for_the_time_that_went_by_is_no_band() -> None:
    moved = 1.0 + np.random.default_rng(1).exponential(0.3, 300)
    moved[[50, 200]] = 0.1
    assert band_of(moved).value == pytest.approx(1.0, abs=0.02)
    few = band_of(np.array([1.0, 2.0]))
    assert few.low == 0.0
    assert few.value <= few.high


def test_the_scans_of_a_historian_are_read_off_what_it_kept() -> None:
    assert scan_of(np.array([4, 8, 4, 12, 4, 4, 20])) == 4
    assert scan_of(np.array([4, 8, 5, 12, 4, 7, 20])) == 1


def test_few_scans_in_a_row_bound_the_width() -> None:
    """One row alone: the width is less than what is off in it."""
    kept = np.concatenate(([0, 1, 2], np.cumsum([12, 13, 15, 21, 19] * 6) + 2))
    pv, sizes = np.zeros(kept[-1] + 1), np.tile([0.0, 1.6], 17)[: len(kept)]
    pv[kept] = sizes
    pv[kept[1]] = 1.0
    assert door_of(pv, kept).high == pytest.approx(1.0)
    assert door_of(pv, kept).low < door_of(pv, kept).value <= 1.0


def test_of_a_few_kept_samples_the_width_is_hardly_told() -> None:
    pv = np.interp(np.arange(100.0), [0.0, 30.0, 60.0, 99.0], [0.0, 4.0, 1.0, 2.0])
    width = door_of(pv, np.array([0, 30, 60, 99]))
    assert (width.low, width.high) == (0.0, 8.0)
    assert 0.0 < width.value <= 4.0


@pytest.mark.parametrize("kind", ["swinging_door", "exception"])
def test_where_samples_are_missing_or_uneven_a_width_has_no_bounds_but_the_range_of_pv(kind: Compression) -> None:
    """Some lie on lines between two then, and tell of moves that nothing kept."""
    pv, at = recorded(moves()), TS * np.arange(len(moves()))
    stored = rebuild(at, pv, keep(at, pv, 0.3, kind), kind)
    shaken = at + TS * np.concatenate(([0.0], np.random.default_rng(1).uniform(-0.3, 0.3, len(at) - 1)))
    with_a_hole = np.where((at >= TS * 500) & (at < TS * 508), np.nan, stored)

    def told(time_s: FloatArray, pv: FloatArray) -> Width:
        pattern = compressed(record_of(comparison_of(Recording("loop", time_s, pv, 40.0 + moves()))))
        assert pattern is not None
        assert pattern.width is not None
        return pattern.width

    assert told(at, stored).low > 0.0
    for width in [told(at, with_a_hole), *([told(shaken, stored)] if kind == "exception" else [])]:
        assert width.low == 0.0
        assert width.high == pytest.approx(np.ptp(stored), rel=0.1)
