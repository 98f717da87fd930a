"""The stages of an audit: named once, the dear ones marked as not run where the audit does not run them."""

import numpy as np
import pytest

from app.engine.audit import AuditConfig, audit
from app.engine.recording import Recording
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, simulate_loop
from tests.benchmarks.stage_times import WHOLE, stage_times


@pytest.fixture(scope="module")
def loop() -> Recording:
    spec = LoopSpec(
        plant=first_order(1.0, 10.0, 3.0),
        controller=Pid(0.8, 10.0),
        valve=TwoParameterValve(5.0, 2.0),
        noise=Signal(noise_sd=0.1),
        load=Signal(value=5.0),
        settle_s=300.0,
    )
    return simulate_loop(spec, 800.0, 1.0, seed=1).recording("loop")


def test_stages_fit_into_the_whole(loop):
    times = stage_times(loop, repeats=3)
    names = [time.stage for time in times]
    assert names[0] == WHOLE
    assert len(set(names)) == len(names)
    assert all(time.milliseconds > 0.0 for time in times)
    assert {time.inside for time in times} - {None} <= set(names)


def test_what_an_audit_leaves_out_is_marked(loop):
    assert audit(loop).reference.last.two is not None
    run = {time.stage: time.run for time in stage_times(loop, repeats=1)}
    cheap = {time.stage: time.run for time in stage_times(loop, AuditConfig(doubt_above=1.0), repeats=1)}
    assert run["two-parameter"]
    assert run["size"] == (audit(loop).stiction_size is not None)
    assert not cheap["two-parameter"]


def test_a_recording_that_cannot_be_audited_has_one_time_only():
    dead = Recording("dead", np.arange(300.0), np.ones(300), np.sin(np.arange(300.0)))
    assert [time.stage for time in stage_times(dead, repeats=1)] == [WHOLE]
