"""The controller of a given model: what it is called decides which law is compared, and is not passed over."""

import json
import re

import numpy as np
import pytest

from app.engine.mismatch import Controller
from app.errors import DataError
from app.services.explaining.given_model import simulation_from_json


def controller(**told: object) -> Controller | None:
    return simulation_from_json(json.dumps({"gain": 1.5, "controller": {"gain": 2.0, **told}})).controller


@pytest.mark.parametrize("said", [{"type": "PID"}, {"form": "ideal"}, {"type": "pid", "form": "ISA"}, {"type": None}])
def test_an_ideal_controller_stays_as_it_is(said: dict[str, object]) -> None:
    assert controller(Ti=10.0, Td=3.0, name="series 7", **said) == Controller(2.0, 10.0, 3.0)


@pytest.mark.parametrize("said", [{"type": "series"}, {"form": "Interacting"}, {"type": "series PID"}])
def test_a_series_controller_is_told_as_the_ideal_one_that_is_the_same(said: dict[str, object]) -> None:
    found = controller(Ti=10.0, Td=3.0, **said)
    s = 1j * np.geomspace(0.01, 10.0, 7)
    ideal = found.gain * (1.0 + 1.0 / (found.integral_time_s * s) + found.derivative_time_s * s)
    assert ideal == pytest.approx(2.0 * (1.0 + 1.0 / (10.0 * s)) * (1.0 + 3.0 * s))


def test_a_series_controller_without_both_times_is_an_ideal_one() -> None:
    assert controller(type="series", Td=3.0) == Controller(2.0, None, 3.0)
    assert controller(type="series", Ti=10.0) == Controller(2.0, 10.0, 0.0)


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ({"type": "parallel"}, "its controller is 'parallel'; P, PI, PD or PID, ideal or series are understood"),
        ({"form": "I-PD"}, "'I-PD'"),
        ({"type": 3}, "its controller is 3;"),
        ({"type": "ideal", "form": "series"}, "'ideal' and 'series'"),
        ({"type": "PI", "Ti": 10.0, "Td": 3.0}, "its controller is a PI and has derivative_time_s"),
        ({"type": "P", "Ti": 10.0}, "its controller is a P and has integral_time_s"),
    ],
)
def test_a_controller_of_another_law_is_refused(told: dict[str, object], words: str) -> None:
    with pytest.raises(DataError, match=re.escape(words)) as refused:
        controller(**told)
    assert refused.value.code == "model_invalid"
