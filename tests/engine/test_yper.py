"""Yper on literal signals, and what must not change it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.engine.reference import yper
from app.errors import DataError

N = 256


def tone(cycles: int, amplitude: float = 1.0, phase: float = 0.3) -> np.ndarray:
    return amplitude * np.sin(2 * np.pi * cycles * np.arange(N) / N + phase)


def test_same_signal_has_no_extra_information() -> None:
    op = tone(4)
    assert yper.compute(op.copy(), op, 1.0).yper_pct == 0.0


def test_third_harmonic_in_pv_alone_is_counted_with_its_share() -> None:
    op = tone(4)
    result = yper.compute(tone(4) + tone(12, 0.5), op, 1.0, "raw")
    # s(t) is a square wave of 0.2: its third harmonic, 0.2 * 4 / (3 pi) = 0.085, is below PV's 0.5 and above OP's 0.
    assert result.threshold_amplitude[11] == pytest.approx(N / 2 * 0.2 * 4 / (3 * np.pi), rel=0.02)
    assert np.flatnonzero(result.significant).tolist() == [11]
    assert result.yper_pct == pytest.approx(100 * 0.5 / 1.5)


def test_frequencies_are_absolute() -> None:
    result = yper.compute(tone(4), tone(4), 5.0)
    assert result.frequency_hz[int(np.argmax(result.pv_amplitude))] == pytest.approx(4 / (N * 5.0))
    assert len(result.frequency_hz) == len(result.significant) == N // 2


def test_raw_form_changes_with_the_unit_and_std_form_does_not() -> None:
    rng = np.random.default_rng(1)
    pv, op = rng.standard_normal(N), tone(4)
    assert yper.compute(0.01 * pv, op, 1.0, "raw").yper_pct == 0.0
    assert yper.compute(pv, op, 1.0, "raw").yper_pct > 10.0


finite = st.floats(-1e4, 1e4)
factor = st.floats(1e-3, 1e3)


@given(
    seed=st.integers(0, 1000),
    pv_scale=factor,
    op_scale=factor,
    pv_zero=finite,
    op_zero=finite,
    scaling=st.sampled_from(["std", "range"]),
)
def test_scale_and_offset_do_not_matter(
    seed: int, pv_scale: float, op_scale: float, pv_zero: float, op_zero: float, scaling: yper.Scaling
) -> None:
    rng = np.random.default_rng(seed)
    op = np.cumsum(rng.standard_normal(N))
    pv = op + 3 * rng.standard_normal(N)
    plain = yper.compute(pv, op, 1.0, scaling)
    moved = yper.compute(pv_zero + pv_scale * pv, op_zero - op_scale * op, 1.0, scaling)
    assert moved.yper_pct == pytest.approx(plain.yper_pct, abs=1e-6)


@given(seed=st.integers(0, 1000), shift=st.integers(0, N))
def test_circular_time_shift_does_not_matter(seed: int, shift: int) -> None:
    rng = np.random.default_rng(seed)
    pv, op = rng.standard_normal(N), rng.standard_normal(N)
    moved = yper.compute(np.roll(pv, shift), np.roll(op, shift), 1.0)
    assert moved.yper_pct == pytest.approx(yper.compute(pv, op, 1.0).yper_pct, abs=1e-6)


def test_inputs_are_left_alone() -> None:
    pv, op = tone(4) + 5.0, tone(3) + 7.0
    before = pv.copy(), op.copy()
    yper.compute(pv, op, 1.0)
    assert np.array_equal(pv, before[0])
    assert np.array_equal(op, before[1])


@pytest.mark.parametrize(
    ("pv", "op", "code"),
    [
        (np.ones(8), np.arange(8.0), "flat_signal"),
        (np.arange(8.0), np.zeros(8), "flat_signal"),
        (np.array([0.0, np.nan, 1.0, 2.0]), np.arange(4.0), "not_finite"),
        (np.arange(8.0), np.arange(7.0), "signal_length"),
        (np.arange(3.0), np.arange(3.0), "record_too_short"),
    ],
)
def test_unusable_records_are_refused_with_a_code(pv: np.ndarray, op: np.ndarray, code: str) -> None:
    with pytest.raises(DataError) as refused:
        yper.compute(pv, op, 1.0)
    assert refused.value.code == code


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("scaling", ["std", "range"])
@pytest.mark.parametrize("unit", [2.0**-600, 2.0**600])
def test_signals_whose_squares_are_no_numbers_are_brought_to_a_common_unit(scaling: yper.Scaling, unit: float) -> None:
    op, pv = tone(4), tone(4) + tone(12, 0.5)
    told = yper.compute(unit * pv, unit * op, 1.0, scaling)
    assert told.yper_pct == yper.compute(pv, op, 1.0, scaling).yper_pct > 0.0
