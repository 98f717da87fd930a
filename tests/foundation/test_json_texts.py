"""Null is written on purpose alone: what is no number is a fault, and is refused where a verdict is made."""

import numpy as np
import pytest

from app.json_texts import read_json, short_json, stored_json


def test_numbers_of_numpy_are_numbers_and_what_is_not_known_is_null():
    told = {"a": np.float64(0.5), "b": None, "c": np.array([1.0, 2.0]), "d": [np.int64(3), "null"]}
    assert short_json(told) == b'{"a":0.5,"b":null,"c":[1.0,2.0],"d":[3,"null"]}'


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf, np.float32(np.nan), np.array([1.0, np.nan])])
def test_what_is_no_number_is_refused_with_its_place(odd):
    with pytest.raises(ValueError, match=r"^\.spectra\[\]\.pv is "):
        short_json({"known": None, "spectra": [{"op": 1.0}, {"pv": odd}]})


def test_what_an_older_release_stored_is_null():
    assert stored_json({"health": float("nan")}) == b'{"health":null}'


@pytest.mark.parametrize("odd", [[1.0, None, np.nan], [np.inf, -np.inf], ["", np.nan], [[1.0], [0.0, np.nan]]])
def test_what_is_no_number_is_refused_in_a_list_too(odd):
    with pytest.raises(ValueError, match=r"^\.rmse(\[\]){1,2} is "):
        short_json({"unknown": None, "rmse": odd})


@pytest.mark.parametrize("known", [[], [1.5e308, 1.5e308], [2**63, None, 0.5], ["a", True], [[1, 2], [3, None]]])
def test_a_list_whose_sum_is_no_number_may_hold_numbers(known):
    assert short_json({"unknown": None, "rmse": known})


def test_what_an_older_release_kept_that_is_no_number_is_read() -> None:
    assert read_json('{"health": 60.0}') == {"health": 60.0}
    assert str(read_json('{"health": NaN}')) == "{'health': nan}"
