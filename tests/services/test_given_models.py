"""Models that are given with a recording: as they are told, and run along it."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Controller, simulate_again
from app.engine.mismatch.compare.even_grid import comparison_of
from app.engine.mismatch.driven import simulate_model
from app.engine.mismatch.judge.result import ExplainedModel, PartModel
from app.engine.recording import Recording
from app.errors import DataError
from app.services.explaining.given_model import simulation_from_json


def test_a_stored_recording_with_a_model() -> None:
    n = 150
    recording = Recording("FIC1", np.arange(n) * 10.0, np.arange(n) % 9.0, np.arange(n) % 4.0)
    simulation = simulation_from_json('{"gain": 1.5, "time_constants_s": [20, 4], "dead_time_s": 3}')
    found = comparison_of(recording, simulation=simulation)
    assert found.sampling_interval_s == 10.0
    assert found.simulation is not None
    assert found.simulation.time_constants_s == (20.0, 4.0)
    with pytest.raises(DataError):
        comparison_of(recording, trace=np.zeros(n - 1))


def test_a_model_may_bring_its_controller() -> None:
    told = '{"gain": 1.5, "controller": {"gain": 0.4, "integral_time_s": 30, "derivative_time_s": 2}}'
    assert simulation_from_json(told).controller == Controller(0.4, 30.0, 2.0)
    assert simulation_from_json('{"gain": 1.5, "controller": {"Kc": 0.4}}').controller == Controller(0.4)
    assert simulation_from_json('{"gain": 1.5, "controller": null}').controller is None


@pytest.mark.parametrize("name", ["damping", "damping_ratio", "zeta"])
def test_a_model_may_swing(name: str) -> None:
    assert simulation_from_json(f'{{"gain": 1.5, "tau": 30, "{name}": 0.4}}').damping == 0.4
    assert simulation_from_json(f'{{"gain": 1.5, "tau": 30, "{name}": null}}').damping is None


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ('{"gain": 1.5, "time_constnat_s": 30}', "'time_constnat_s'"),
        ('{"gain": 1.5, "controller": {"gain": 1, "integral": 30}}', "'integral'"),
        ('{"gain": "1.5"}', "a number is needed"),
        ('{"gain": true}', "a number is needed"),
        ('{"gain": 1.5, "controller": "pid"}', "not an object"),
        ('{"gain": 1.5, "controller": {}}', "its controller has no gain"),
        ('{"gain": 1.5, "time_constants_s": [[3]]}', "a time constant is"),
        ('{"gain": 1.5, "tau": 30, "damping": "0.4"}', "the damping of the model is"),
        ('{"gain": 1.5, "tau": 30, "damping": 0.4, "zeta": 0.7}', "the model has 'damping' and 'zeta'"),
        ('{"gain": 1.5, "controller": {"gain": 1, "Ti": 30, "Kc": 2}}', "its controller has 'gain' and 'Kc'"),
        ("{}", "the model has no gain"),
        ('{"gain": 1.5, "gain": 2.5}', "'gain' is given 2 times"),
    ],
)
def test_a_slip_in_a_model_is_said(told: str, words: str) -> None:
    with pytest.raises(DataError, match=re.escape(words)) as refused:
        simulation_from_json(told)
    assert refused.value.code == "model_invalid"


def test_a_model_with_other_values_than_its_parts_take_is_refused() -> None:
    n = 150
    part = PartModel("sensor.sample_hold/pattern", "sensor.sample_hold", (float("nan"),))
    model = ExplainedModel(4.0, 40.0, 50.0, 5.0, 5.0, (("K", 1.0), ("tau", 20.0), ("theta", 0.0)), (part,), ())
    for values in ((float("nan"),), (), (4.0, 5.0)):
        wrong = replace(model, parts=(replace(part, values=values),))
        with pytest.raises(DataError) as refused:
            simulate_again(wrong, 40.0 + np.arange(n) % 7.0)
        assert refused.value.code == "model_invalid"


@pytest.mark.parametrize("gain", [0.0, 1e-320, -1e300])
def test_a_model_by_which_op_moves_nothing_is_refused(gain: float) -> None:
    """What enters a process beside OP is told as the OP that does the same."""
    n, steps = 150, PartModel("disturbance.step", "disturbance.step", (100.0, 1.0))
    feed = PartModel("disturbance.coupling/feed, entering", "disturbance.coupling", (0.1, 5.0, 0.0))
    measured = (("feed", np.arange(n) % 5.0),)
    for part in (steps, feed):
        plant = (("K", gain), ("tau", 1.0), ("theta", 0.0), ("leak", 0.0))
        model = ExplainedModel(4.0, 40.0, 50.0, 5.0, 5.0, plant, (part,), ("feed",))
        with pytest.raises(DataError, match="K must be other than 0") as refused:
            simulate_again(model, 40.0 + np.arange(n) % 7.0, measured)
        assert refused.value.code == "model_invalid"


def test_a_model_runs_along_a_faster_recording_only_where_it_fits(tmp_path: Path) -> None:
    model = ExplainedModel(4.0, 40.0, 50.0, 5.0, 5.0, (("K", 1.0), ("tau", 20.0), ("theta", 0.0)), (), ())
    op = np.repeat([40.0, 42.0], 200)
    slow = simulate_model(model, Comparison("F1", 4.0, op, op))
    fast = simulate_model(model, Comparison("F1", 2.0, np.repeat(op, 2), np.repeat(op, 2)))
    assert slow.pv[-1] == pytest.approx(52.0, abs=0.01)
    assert fast.pv == pytest.approx(slow.pv)
    with pytest.raises(DataError) as raised:
        simulate_model(model, Comparison("F1", 3.0, op, op))
    assert raised.value.code == "interval_differs"
