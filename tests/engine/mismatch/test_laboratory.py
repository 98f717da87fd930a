"""Laboratory records: what is known to be missing is named, and the half that no fit has seen is followed better."""

from pathlib import Path

import numpy as np
import pytest

from app.engine.mismatch import Comparison, explain
from app.engine.mismatch.loop.experiment import experiment


def exchanger(shared_dir: Path) -> tuple[Comparison, Comparison]:
    path = shared_dir / "nonlinear" / "steam_heat_exchanger.csv"
    if not path.is_file():
        pytest.skip("no laboratory records here")
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    halves = (rows[: len(rows) // 2], rows[len(rows) // 2 :])
    first, second = (Comparison("exchanger", 1.0, half[:, 1], half[:, 2]) for half in halves)
    return first, second


def test_the_exchanger_s_gain_depends_on_its_operating_point(shared_dir: Path) -> None:
    said = explain(*exchanger(shared_dir))
    named = {name for effect in said.effects for name in (effect.code, *effect.alternatives)}
    assert "process.nonlinear_gain" in named
    assert said.validation is not None
    assert said.validation.explained.rmse < 0.7 * said.validation.refitted.rmse < 0.7 * 0.6


def test_an_experiment_s_op_follows_no_pv_and_a_controller_s_does(shared_dir: Path) -> None:
    first, _ = exchanger(shared_dir)
    assert not experiment(1.0, first.op, first.pv).op_follows_pv
    rng = np.random.default_rng(3)
    pv = np.cumsum(rng.normal(size=500))
    error = 50.0 - pv
    op = 2.0 * error + 0.1 * np.cumsum(error)
    assert experiment(1.0, op, pv, np.full(500, 50.0)).op_follows_pv
    assert experiment(1.0, op, pv).op_follows_pv
    assert not experiment(1.0, rng.normal(size=500), pv).op_follows_pv
