"""A stem that stops within a record is told from loads, set points, limits and tuning by the loop's own past."""

from functools import lru_cache

import numpy as np
import pytest

from app.engine.audit import audit
from app.engine.causality.stuck_stem import stuck_stem
from app.engine.recording import Recording, UniformRecord
from app.lab.testbench.standstills import FAULTS, INNOCENT, INTERVAL_S, SAMPLES, recording_of


@lru_cache(maxsize=4)
def stuck(seed: int = 0) -> Recording:
    """A flow whose stem stands for 48 of 83 hours, its set point moved four times meanwhile."""
    return recording_of(FAULTS["stuck for 48 h, four moves of SP"][1], "flow", seed)


def uniform(recording: Recording) -> UniformRecord:
    filled = np.zeros(recording.samples, bool)
    return UniformRecord(INTERVAL_S, recording.pv, recording.op, recording.sp, filled)


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_it_is_looked_at_today_and_its_hour_is_named(seed):
    found = audit(stuck(seed))
    judgement = found.judgement
    assert (judgement.verdict, judgement.reliability) == ("inconclusive", "not_reliable")
    assert judgement.likely_cause == "stuck_valve_or_dead_transmitter"
    assert [reason.code for reason in judgement.reasons[:2]] == ["answers_no_more", "prior_only"]
    assert judgement.reasons[0].text.startswith("PV has answered neither OP nor SP for the last 4")
    assert judgement.unanswered_s / 3600.0 == pytest.approx(48.0, abs=2.5)
    assert judgement.unanswered_since_s + judgement.unanswered_s == pytest.approx(SAMPLES * INTERVAL_S, abs=INTERVAL_S)
    assert found.health.value <= 45.0


@pytest.mark.parametrize("op_scale", [-3.0, 1e8, 1e-8, -1e-12])
def test_units_and_signs_are_free(op_scale):
    given = stuck()
    other = Recording("x", given.time_s, 7.0 - 0.1 * given.pv, op_scale * given.op, 7.0 - 0.1 * given.sp)
    found, expected = stuck_stem(uniform(other)), stuck_stem(uniform(given))
    assert found is not None
    assert (found.since_s, found.for_s, found.sp_moved) == (expected.since_s, expected.for_s, expected.sp_moved)
    assert found.times == pytest.approx(expected.times)


def test_op_that_goes_over_to_another_value_once_runs_to_and_fro_nowhere():
    moves = np.random.default_rng(0).standard_normal(2000)
    op = np.where(np.arange(2000) < 1000, 40.0, 60.0)
    assert stuck_stem(UniformRecord(INTERVAL_S, moves, op, None, np.zeros(2000, bool))) is None


def test_what_is_in_manual_at_the_end_is_not_judged_by_it():
    given = stuck()
    automatic = np.arange(SAMPLES) < SAMPLES - 720
    left = Recording("x", given.time_s, given.pv, given.op, given.sp, automatic)
    assert audit(left).judgement.reasons[0].code != "answers_no_more"


@pytest.mark.parametrize(
    ("kind", "process"),
    [
        ("healthy", "flow"),
        ("set point moved by 25 %, 4 times", "flow"),
        ("set point moved by 20 %, 1 h before", "slow"),
        ("load of 70 % to the end, OP at its limit", "flow"),
        ("load of 70 % up to 20 min before", "flow"),
        ("load wanders 10 times as much", "flow"),
        ("load wanders 10 times as much", "level"),
        ("load wanders 10 times as much", "slow"),
        ("proportional control, load 10 times", "level"),
        ("controller 6 times too strong", "flow"),
        ("level that nothing fills", "level"),
        ("stuck, freed 12 h before", "flow"),
    ],
)
def test_a_loop_that_has_its_reasons_is_not_accused(kind, process):
    assert stuck_stem(uniform(recording_of(INNOCENT[kind], process, 1))) is None


def test_a_short_record_has_no_past():
    assert stuck_stem(uniform(stuck()).part(slice(SAMPLES - 700, None))) is None
