"""Null is written on purpose alone: what is no number is a fault, and is refused where a verdict is made."""

import numpy as np
import pytest

from app.storage.json_texts import short_json, stored_json


def test_numbers_of_numpy_are_numbers_and_what_is_not_known_is_null():
    told = {"a": np.float64(0.5), "b": None, "c": np.array([1.0, 2.0]), "d": [np.int64(3), "null"]}
    assert short_json(told) == b'{"a":0.5,"b":null,"c":[1.0,2.0],"d":[3,"null"]}'


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf, np.float32(np.nan), np.array([1.0, np.nan])])
def test_what_is_no_number_is_refused_with_its_place(odd):
    with pytest.raises(ValueError, match=r"^\.spectra\[\]\.pv is "):
        short_json({"known": None, "spectra": [{"op": 1.0}, {"pv": odd}]})


def test_what_an_older_release_stored_is_null():
    assert stored_json({"health": float("nan")}) == b'{"health":null}'
