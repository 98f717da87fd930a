"""The data-driven valve models: what must hold for every OP, and where the literature says that they agree."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.engine.valve import one_parameter, two_parameter_choudhury, two_parameter_he, two_parameter_kano
from app.errors import DataError

TWO_PARAMETER = [two_parameter_he, two_parameter_choudhury, two_parameter_kano]

# Multiples of 1/64: sums and halves are exact, so two models can be compared sample by sample, ties included.
dyadic = st.integers(-640, 640).map(lambda k: k / 64)
signals = st.lists(dyadic, min_size=2, max_size=60).map(np.array)
bands = st.integers(0, 320).map(lambda k: k / 32)


@st.composite
def undershooting(draw):
    """(S, J) with 0 <= J <= S, as two rows of one point."""
    S = draw(bands)
    J = draw(st.integers(0, int(S * 32))) / 32
    return np.array([S]), np.array([J])


def play(op, width):
    """Backlash as the play operator of hysteresis theory, written independently of the models."""
    x = np.empty_like(op)
    previous = op[0]
    for t, u in enumerate(op):
        previous = min(max(previous, u - width / 2), u + width / 2)
        x[t] = previous
    return x


def test_one_parameter_on_a_literal_signal():
    op = np.array([0.0, 1.0, 2.0, 2.5, 1.0, 0.0, -3.0])
    v = one_parameter(op, np.array([0.0, 1.0, 2.0]))
    assert v.tolist() == [
        [0.0, 1.0, 2.0, 2.5, 1.0, 0.0, -3.0],
        [0.0, 0.0, 2.0, 2.0, 2.0, 0.0, -3.0],
        [0.0, 0.0, 0.0, 2.5, 2.5, 0.0, -3.0],
    ]


@pytest.mark.parametrize("model", TWO_PARAMETER)
def test_two_parameter_on_a_literal_ramp(model):
    """S = 4, J = 2: held until OP has gone (S + J)/2 = 3, then 1 behind; held for S = 4 after the turn."""
    op = np.array([0.0, 3.0, 6.0, 9.0, 6.0, 5.0, 4.5, 1.0])
    v = model(op, np.array([4.0]), np.array([2.0]))[0]
    assert v.tolist() == [0.0, 0.0, 5.0, 8.0, 8.0, 8.0, 5.5, 2.0]


@given(signals)
def test_no_band_passes_op_through(op):
    zero = np.zeros(1)
    assert np.array_equal(one_parameter(op, zero)[0], op)
    for model in TWO_PARAMETER:
        assert np.array_equal(model(op, zero, zero)[0], op)


@given(signals, bands)
def test_no_slip_jump_is_backlash(op, S):
    for model in TWO_PARAMETER:
        assert np.array_equal(model(op, np.array([S]), np.zeros(1))[0], play(op, S))


@given(signals, undershooting())
def test_kano_is_choudhury(op, bands):
    """Kano's states that his model is Choudhury's with the turns kept right, so that it may be driven by any OP."""
    assert np.array_equal(two_parameter_kano(op, *bands), two_parameter_choudhury(op, *bands))


@given(signals, bands)
def test_he_with_s_equal_to_j_is_the_one_parameter_model(op, d):
    d = np.array([d])
    assert np.array_equal(two_parameter_he(op, d, d), one_parameter(op, d))


@given(undershooting(), st.integers(2, 40), st.integers(1, 4))
def test_he_agrees_with_kano_where_op_moves_more_than_the_slip_jump_a_sample(bands, half_period, repeats):
    """He's stem sticks after each slip and Kano's does not: no difference where each step of OP frees it anew."""
    S, J = bands
    step = J[0] + 1 / 32
    rise = np.arange(half_period) * step
    op = np.concatenate([np.concatenate([rise, rise[::-1][1:-1]]) for _ in range(repeats)])
    assert np.array_equal(two_parameter_he(op, S, J), two_parameter_kano(op, S, J))


def test_he_makes_a_staircase_where_kano_keeps_moving():
    """Steps of OP below J are where the literature's models part."""
    op = np.arange(0.0, 20.0, 0.5)
    S, J = np.array([4.0]), np.array([2.0])
    he, kano = two_parameter_he(op, S, J)[0], two_parameter_kano(op, S, J)[0]
    assert set(np.diff(he)[8:]) == {0.0, 2.5}
    assert set(np.diff(kano)[8:]) == {0.5}
    assert np.max(np.abs(he - kano)) <= J[0]


@pytest.mark.parametrize("model", TWO_PARAMETER)
@given(op=signals, bands=undershooting(), factor=st.sampled_from([-8.0, -1.0, 0.25, 4.0]), offset=dyadic)
def test_scale_sign_and_offset_pass_through(model, op, bands, factor, offset):
    S, J = bands
    expected = factor * model(op, S, J) + offset
    assert np.array_equal(model(factor * op + offset, abs(factor) * S, abs(factor) * J), expected)


@given(op=signals, d=bands, factor=st.sampled_from([-8.0, -1.0, 0.25, 4.0]), offset=dyadic)
def test_one_parameter_scale_sign_and_offset_pass_through(op, d, factor, offset):
    expected = factor * one_parameter(op, np.array([d])) + offset
    assert np.array_equal(one_parameter(factor * op + offset, abs(factor) * np.array([d])), expected)


@pytest.mark.parametrize("model", TWO_PARAMETER)
@given(op=signals, bands=undershooting())
def test_the_stem_is_never_further_from_op_than_the_static_band(model, op, bands):
    S, J = bands
    assert np.max(np.abs(op - model(op, S, J)[0])) <= (S[0] + J[0]) / 2


@pytest.mark.parametrize("model", TWO_PARAMETER)
def test_a_grid_is_its_points(model):
    op = np.random.default_rng(1).normal(size=200).cumsum()
    S, J = np.array([0.0, 1.0, 3.0, 2.0]), np.array([0.0, 0.5, 0.0, 3.0])
    grid = model(op, S, J)
    for m in range(4):
        assert np.array_equal(grid[m], model(op, S[m : m + 1], J[m : m + 1])[0])


def test_inputs_are_left_alone():
    op, S, J = np.array([0.0, 2.0, -2.0]), np.array([1.0]), np.array([0.5])
    two_parameter_he(op, S, J)
    assert op.tolist() == [0.0, 2.0, -2.0]
    assert (S[0], J[0]) == (1.0, 0.5)


@pytest.mark.parametrize("op", [np.array([]), np.array([1.0, np.nan]), np.ones((2, 2))])
def test_op_must_be_a_finite_row(op):
    with pytest.raises(DataError) as error:
        one_parameter(op, np.zeros(1))
    assert error.value.code == "op_not_a_signal"


@pytest.mark.parametrize(("S", "J"), [([-1.0], [0.0]), ([1.0], [np.nan]), ([1.0, 2.0], [0.0])])
def test_bands_must_not_be_negative_or_missing(S, J):
    with pytest.raises(DataError) as error:
        two_parameter_he(np.zeros(3), np.array(S), np.array(J))
    assert error.value.code == "stiction_band"
