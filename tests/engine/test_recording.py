"""What a recording refuses, and that its fingerprint tells records apart."""

import pickle

import numpy as np
import pytest

from app.engine.key_figures import compute
from app.engine.recording import Recording
from app.errors import DataError


def a_recording(**changed) -> Recording:
    signal = np.array([1.0, 2.0, 3.0])
    return Recording(**({"name": "a", "time_s": np.arange(3.0), "pv": signal, "op": signal} | changed))


@pytest.mark.parametrize("name", ["pv", "op", "sp", "automatic"])
def test_signals_must_be_as_long_as_time(name):
    with pytest.raises(DataError) as error:
        a_recording(**{name: np.ones(2)})
    assert error.value.code == "signal_length"
    assert name in error.value.message


def test_other_signals_must_be_as_long_as_time():
    with pytest.raises(DataError, match="flow2 has 2 samples"):
        a_recording(others={"flow2": np.ones(2)})


@pytest.mark.parametrize("time_s", [[0.0, 1.0, 1.0], [0.0, 2.0, 1.0], [0.0, np.nan, 2.0]])
def test_time_must_increase(time_s):
    with pytest.raises(DataError) as error:
        a_recording(time_s=np.array(time_s))
    assert error.value.code == "time_order"


@pytest.mark.parametrize("kind", [np.uint16, np.int32, np.float32])
def test_signals_of_any_type_are_numbers_with_a_sign(kind):
    pv, sp = np.array([40, 50, 60] * 40, dtype=kind), np.full(120, 50, dtype=kind)
    time_s = np.arange(120).astype(kind)
    made = a_recording(time_s=time_s, pv=pv, op=pv, sp=sp, others={"flow": pv}, automatic=np.ones(120, dtype=kind))
    assert {x.dtype for x in (made.time_s, made.pv, made.op, made.sp, made.others["flow"])} == {np.dtype(np.float64)}
    assert made.automatic.dtype == np.bool_
    assert compute(made).error_std == pytest.approx(np.sqrt(200.0 / 3.0))


@pytest.mark.parametrize("automatic", [[1.0, np.nan, 0.0], [1.0, -1.0, 0.0], [0, 1, 2], ["AUTO", "MAN", "MAN"]])
def test_a_mode_that_is_neither_is_not_automatic(automatic):
    with pytest.raises(DataError, match="automatic must be") as error:
        a_recording(automatic=np.array(automatic))
    assert error.value.code == "signal_type"


def test_a_mode_may_be_numbers():
    assert a_recording(automatic=np.array([1.0, 0.0, 1.0])).automatic.tolist() == [True, False, True]


@pytest.mark.parametrize("name", ["time_s", "pv", "op", "sp"])
@pytest.mark.parametrize("kind", ["datetime64[ns]", "timedelta64[s]", "U3", "S3", object, complex])
def test_signals_that_are_no_numbers_are_refused(name, kind):
    with pytest.raises(DataError, match=f"{name} must be numbers") as error:
        a_recording(**{name: np.arange(3).astype(kind)})
    assert error.value.code == "signal_type"


def test_other_signals_may_be_lists_and_must_be_numbers():
    assert a_recording(others={"flow": [1, 2, 3]}).others["flow"].dtype == np.float64
    with pytest.raises(DataError, match="flow must be numbers"):
        a_recording(others={"flow": ["1", "2", "3"]})


def test_signals_that_are_floats_are_not_copied():
    signal, others = np.array([1.0, 2.0, 3.0]), {"flow": np.ones(3)}
    made = a_recording(pv=signal, others=others)
    assert made.pv is signal
    assert made.others is others


def test_fingerprint_knows_the_samples_and_not_the_name():
    assert a_recording().fingerprint() == a_recording(name="b").fingerprint()
    different = (
        a_recording(pv=np.array([1.0, 2.0, 3.5])),
        a_recording(time_s=np.arange(3.0) + 1),
        a_recording(sp=np.ones(3)),
        a_recording(automatic=np.ones(3, dtype=bool), sp=None),
    )
    assert len({r.fingerprint() for r in (*different, a_recording())}) == 5


def test_fingerprint_knows_what_else_decides_the_verdict():
    given = ({}, {"op_range": (0.0, 100.0)}, {"op_range": (0.0, 50.0)}, {"pv_range": (0.0, 100.0)},
             {"integrating": True}, {"integrating": False})  # fmt: skip
    assert len({a_recording(**one).fingerprint() for one in given}) == len(given)
    assert a_recording(op_range=(0, 100)).fingerprint() == a_recording(op_range=(0.0, 100.0)).fingerprint()


def test_fingerprint_knows_which_signal_is_which():
    ones = np.ones(3)
    assert a_recording(sp=ones).fingerprint() != a_recording(automatic=ones == 1.0).fingerprint()


def test_errors_keep_their_code_between_processes():
    error = pickle.loads(pickle.dumps(DataError("signal_length", "too short")))  # noqa: S301
    assert (type(error), error.code, str(error)) == (DataError, "signal_length", "too short")
