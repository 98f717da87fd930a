"""What a whole audit of a 2,000-sample loop costs, stage by stage, beside its limit of 60 ms on one core.

Times are processor time of one thread after warm-up; they are printed and not asserted, because they belong to the
machine. A loop on which table 2 agrees at once is the common case; one where the ladder is climbed is the dear one.
"""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from app.engine import hammerstein, verdict
from app.engine.audit import AuditConfig, audit
from app.engine.corroborate import corroborate
from app.engine.features import extract
from app.engine.fitness import assess
from app.engine.oscillation import detect
from app.engine.reliability import climb
from app.engine.rivals import compete
from app.engine.simulate import LinearValve, LoopSpec, Pid, Signal, TwoParameterValve, Wave, first_order, simulate_loop

pytestmark = pytest.mark.benchmark

LIMIT_MS = 60.0
SAMPLES = 2000

_STICKY = LoopSpec(
    plant=first_order(1.0, 10.0, 3.0),
    controller=Pid(0.8, 10.0),
    valve=TwoParameterValve(5.0, 2.0),
    noise=Signal(noise_sd=0.2),
    load=Signal(value=5.0, noise_sd=0.3, noise_tau_s=60.0),
    settle_s=500.0,
)
_SHAKEN = replace(_STICKY, valve=LinearValve(), load=Signal(noise_sd=0.5, noise_tau_s=20.0, waves=(Wave(2.0, 60.0),)))
_WANDERING = replace(_STICKY, valve=LinearValve(), load=Signal(noise_sd=3.0, noise_tau_s=60.0))
_LOOPS = {"sticky": _STICKY, "shaken by a sine": _SHAKEN, "wandering load": _WANDERING}


def median_ms(work: Callable[[], object], repeats: int = 9) -> float:
    """The median processor time of `work` in ms after one call to warm up."""
    work()
    times = []
    for _ in range(repeats):
        start = time.thread_time()
        work()
        times.append(time.thread_time() - start)
    return 1000.0 * float(np.median(times))


def _stages(recording, config):
    """Name -> what it runs, in the order of the audit; what is inside another stage is marked by a leading blank."""
    record = assess(recording, config.fitness).audited
    oscillation = detect(record)
    fitness = assess(recording, config.fitness)
    reference = climb(record, config.ladder, config.hammerstein)
    features = extract(record, oscillation)
    space = reference.last.space
    return {
        "fitness": lambda: assess(recording, config.fitness),
        "oscillation": lambda: detect(record),
        "reference": lambda: climb(record, config.ladder, config.hammerstein),
        "  one-parameter, last rung": lambda: hammerstein.identify_one_parameter(record, space, config.hammerstein),
        "  two-parameter": lambda: hammerstein.identify_two_parameter(record, space, config.hammerstein),
        "verdict": lambda: verdict.judge(record, oscillation, fitness, reference, config.judgement),
        "  features": lambda: extract(record, oscillation),
        "  rivals": lambda: compete(record, oscillation, features),
        "  corroboration": lambda: corroborate(record, oscillation),
    }


@pytest.mark.parametrize("name", _LOOPS)
def test_whole_audit_by_stage(name, capsys):
    recording = simulate_loop(_LOOPS[name], float(SAMPLES), 1.0, seed=1).recording(name)
    config = AuditConfig()
    whole = median_ms(lambda: audit(recording, config))
    rungs = audit(recording, config).reference.rungs
    with capsys.disabled():
        print(f"\n{name}, {SAMPLES} samples, {len(rungs)} rung(s): whole audit {whole:.1f} ms, ", end="")
        print(f"{whole / LIMIT_MS:.2f} of the limit of {LIMIT_MS:.0f} ms")
        for stage, work in _stages(recording, config).items():
            spent = median_ms(work, 5)
            print(f"  {stage:28s} {spent:7.2f} ms  {100 * spent / whole:5.1f} %")
    assert recording.samples == SAMPLES
