"""A scan exported more often than it was made is the record that it would have been once a scan."""

import numpy as np
import pytest

from app.engine.fitness import FitnessConfig, assess
from app.engine.fitness.repeated import once_a_scan
from app.engine.recording import FloatArray, Recording

CONFIG = FitnessConfig()


def loop(samples: int = 400, interval_s: float = 10.0) -> Recording:
    noise = np.random.default_rng(3)
    swing = np.sin(2.0 * np.pi * np.arange(samples) / 25.0)
    pv, op = swing + 0.1 * noise.standard_normal(samples), 50.0 + 5.0 * np.roll(swing, 6) + noise.normal(size=samples)
    return Recording("FIC1", interval_s * np.arange(samples), pv, op, np.round(swing), None)


def stored(once: Recording, times: int, first: int = 0) -> Recording:
    """Each sample so many times, without the first few."""
    assert once.sp is not None
    pv, op, sp = (np.repeat(signal, times)[first:] for signal in (once.pv, once.op, once.sp))
    time_s = float(once.time_s[1]) / times * np.arange(first, first + len(pv))
    return Recording("FIC1", time_s, pv, op, sp, None)


@pytest.mark.parametrize("times", [2, 5, 10])
def test_one_sample_of_each_scan_is_kept(times: int) -> None:
    once = loop()
    found = once_a_scan(stored(once, times), CONFIG)
    assert found.repeats == times
    assert np.array_equal(found.recording.pv, once.pv)
    assert np.array_equal(found.recording.op, once.op)
    assert np.allclose(found.recording.time_s, once.time_s)


def test_a_scan_that_the_record_begins_amid_is_left_out() -> None:
    once = loop()
    found = once_a_scan(stored(once, 5, first=2), CONFIG)
    assert np.array_equal(found.recording.pv, once.pv[1:])


def test_rows_that_are_missing_move_no_scan() -> None:
    once = loop()
    each = stored(once, 5)
    there = np.ones(each.samples, dtype=bool)
    there[101:104] = False
    there[333:339] = False
    found = once_a_scan(each.part(there), CONFIG)
    assert found.repeats == 5
    assert set(found.recording.time_s) <= set(once.time_s)
    assert found.recording.samples >= once.samples - 2


@pytest.mark.parametrize("moving", ["pv", "op"])
def test_what_moves_between_the_scans_is_kept(moving: str) -> None:
    each = stored(loop(), 5)
    signal: FloatArray = getattr(each, moving)
    signal[502::25] += 1.0
    found = once_a_scan(each, CONFIG)
    assert found.repeats == 1
    assert found.recording is each


def test_a_signal_that_seldom_moves_tells_no_scan() -> None:
    slow = loop()
    slow.op[:] = np.repeat([40.0, 50.0, 45.0, 55.0], 100)
    assert once_a_scan(slow, CONFIG).repeats == 1


def test_the_audited_stretch_is_that_of_the_scan_and_says_so() -> None:
    fitness = assess(stored(loop(), 5))
    assert fitness.repeats == 5
    assert fitness.audited.samples == 400
    assert fitness.audited.sampling_interval_s == pytest.approx(10.0)
    told = {finding.code: finding for finding in fitness.findings}["irregular_sampling"]
    assert told.outcome == "pass"
    assert told.text == "one sample every 10 s, used as recorded; each was stored 5 times"


def test_a_controller_that_answers_a_little_later_is_paired_with_what_it_answers() -> None:
    once = loop()
    each = stored(once, 5)
    each.op[2:] = each.op[:-2].copy()
    found = once_a_scan(each, CONFIG)
    assert found.repeats == 5
    assert np.array_equal(found.recording.pv, once.pv)
    assert np.array_equal(found.recording.op, once.op)


def test_a_scan_is_known_by_whichever_of_its_samples_are_left() -> None:
    once = loop()
    each = stored(once, 5)
    left = np.random.default_rng(4).random(each.samples) < 0.7
    left[:5] = left[-1] = True
    known = np.unique(np.flatnonzero(left) // 5)
    found = once_a_scan(each.part(left), CONFIG)
    assert found.repeats == 5
    assert np.array_equal(found.recording.pv, once.pv[known])
    assert np.allclose(found.recording.time_s, once.time_s[known])


def test_one_scan_that_came_late_ends_no_pattern() -> None:
    each = stored(loop(), 5)
    each.pv[500] = each.pv[499]
    found = once_a_scan(each, CONFIG)
    assert found.repeats == 5
    assert np.array_equal(found.recording.pv, loop().pv)
