"""The loops of known size that the proofs ask about are made, and their rows become the tables of PROOF.md."""

import json

import numpy as np
import pytest

from app.engine.mismatch.loop.plant import Plant, run_process
from tests.proof.plants import SUBSTEPS, ExactLags
from tests.proof.scans import made
from tests.proof.scans import told as told_of_scans
from tests.proof.sizes import blind, limit_cycles, told
from tests.proof.tables import of_pairs, of_single, rows_of

ROWS = (
    {"true": ["sensor.lag"], "said": [["process.extra_lag", "sensor.lag"]], "energy": 99.0, "first_right": True},
    {"true": ["sensor.lag"], "said": [], "energy": 99.0, "first_right": False},
    {"true": ["sensor.lag"], "said": [], "energy": 3.0, "first_right": False},
    {"true": [], "said": [], "energy": 0.0, "first_right": False},
    {"true": ["sensor.lag", "sensor.step"], "said": [["sensor.step"]], "energy": 99.0, "first_right": True},
)


def test_a_limit_cycle_of_known_size_swings_by_it():
    ((code, loop, sizes),) = limit_cycles(1, 3000)
    assert code == "valve.stiction"
    settled = loop.op[len(loop.op) // 2 :]
    assert 0.5 * sizes["S"] < np.ptp(settled) < 4.0 * sizes["S"]


def test_a_blind_loop_of_known_size_carries_its_simulation():
    ((_, loop, sizes),) = blind("valve.deadband", 1, 3000)
    assert sizes.keys() == {"band"}
    assert loop.trace is not None


def test_intervals_are_counted_by_parameter():
    (line,) = told("limit cycles", {"S": [(4.0, 4.0, 3.9, 4.1), (4.0, 4.4, 4.3, 4.5)]})
    assert line == "limit cycles, S: held by 1 of 2, 0 too low and 1 too high, median error 5.0%, median width 5.0%"


def test_rows_become_tables_of_what_can_be_seen(tmp_path):
    (tmp_path / "rows").write_text("".join(json.dumps(row) + "\n" for row in ROWS))
    rows = rows_of([tmp_path / "rows"])
    assert of_single(rows)[2:] == ["| sensor.lag | 1/2 | process.extra_lag, nothing |"]
    assert of_pairs(rows)[2:] == ["| sensor.lag, sensor.step | one | sensor.step |"]


def test_two_lags_and_a_zero_of_the_own_form_answer_as_the_engine_s():
    op = np.repeat(np.random.default_rng(0).normal(size=60), 10)
    process = ExactLags(1.0, (13.3, 4.0), 3.0 - 1.0 / SUBSTEPS, integrating=False, ts=1.0)  # its line is a step longer
    process.zero = 6.5
    pv = np.array([0.0, *(process.step(v) for v in op[:-1])])
    answer = run_process(op, Plant(K=1.0, tau=13.3, theta=3.0, tau2=4.0, zero=6.5), 1.0)
    settled = slice(250, None)
    np.testing.assert_allclose(pv[settled], answer[settled], atol=1e-6)


def test_what_is_said_of_loops_with_scans_between_is_counted():
    row = {"kind": "limit cycle", "given": False, "scans": 5, "right": True, "first": True,
           "said": [["valve.stiction"]], "false": 0, "sure": 0, "held": True}  # fmt: skip
    lost = {**row, "right": False, "first": False, "said": [["sensor.saturation"]], "false": 1, "held": None}
    (line,) = told_of_scans([row, lost])
    assert line == (
        "limit cycle, no simulation, 5 scans: named 1 of 2 (first of its alternatives 1), nothing 0, false names 1 "
        "(0 of p > 0.9); S held by 1 of 1"
    )


def test_a_loop_swings_alike_however_often_its_controller_scans():
    few, many = (made("limit cycle", 0, 7, scans).comparison for scans in (1, 5))
    assert len(few.pv) == len(many.pv)
    assert np.std(many.op) == pytest.approx(np.std(few.op), rel=0.2)
