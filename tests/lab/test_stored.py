"""The ways in which other historians would have stored a recording do what their names say."""

import numpy as np
import pytest

from app.engine.recording import Recording
from app.lab.evaluation.stored import WAYS, compressed, every, half, lacking, late, noisy, rounded

N = 2000


@pytest.fixture
def recording() -> Recording:
    t = np.arange(float(N))
    pv, op = np.sin(2 * np.pi * t / 50), 40.0 + 5.0 * np.cos(2 * np.pi * t / 50)
    pv[7] = np.nan
    return Recording("loop", t, pv, op, sp=0.01 * t, automatic=t > 10)


@pytest.mark.parametrize("samples", [-4, 0, 3])
def test_pv_is_stamped_late(recording, samples):
    stored = late(samples)(recording)
    assert stored.samples == N - abs(samples)
    for k in (20, 1000):
        at = int(np.searchsorted(recording.time_s, stored.time_s[k]))
        assert stored.op[k] == recording.op[at]
        assert stored.sp[k] == recording.sp[at]
        assert stored.pv[k] == recording.pv[at - samples]


def test_samples_are_left_out(recording):
    np.testing.assert_array_equal(every(4)(recording).time_s, recording.time_s[::4])
    np.testing.assert_array_equal(half(1)(recording).time_s, recording.time_s[N // 2 :])
    fewer = lacking(0.1)(recording)
    assert 0.88 < fewer.samples / N < 0.92
    assert fewer.fingerprint() == lacking(0.1)(recording).fingerprint()


def test_values_are_coarser(recording):
    steps = rounded(0.05)(recording)
    assert 18 <= len(np.unique(steps.op)) <= 21
    assert np.isnan(steps.pv[7])
    noise = (noisy(0.02)(recording).pv - recording.pv)[8:]
    assert np.std(noise) == pytest.approx(0.04, rel=0.1)


@pytest.mark.parametrize("kind", ["exception", "swinging_door"])
def test_values_are_compressed_within_their_deviation(recording, kind):
    stored = compressed(kind, 0.03)(recording)
    off = np.abs(stored.op - recording.op)
    assert 0.1 < off.max() <= 0.03 * 10.0 * 1.001
    assert np.isnan(stored.pv[7])
    assert np.isfinite(stored.pv[8:]).all()
    np.testing.assert_array_equal(stored.time_s, recording.time_s)


def test_a_signal_that_stands_is_stored_as_it_is():
    stands = Recording("loop", np.arange(300.0), np.full(300, 2.0), np.full(300, 40.0))
    for way, stored in WAYS.items():
        kept = stored(stands)
        assert set(np.unique(kept.op)) == {40.0}, way
        assert way.startswith("noise") or set(np.unique(kept.pv)) == {2.0}, way
