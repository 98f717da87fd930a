"""Behind the longest stretch of a record a newer one may be left: what it tells by itself comes first, but no valve is
cleared by it that the longest accuses."""

from functools import lru_cache

import numpy as np
import pytest

from app.engine.audit import Audit, audit
from app.engine.judged import identified_part
from app.engine.recording import Recording
from app.engine.simulate import LoopSpec, Pid, Signal, SimulatedLoop, TwoParameterValve, first_order, simulate_loop

TS = 20.0
LONGEST, BETWEEN, NEWEST = 6000, 400, 1500
FREE = LoopSpec(
    plant=first_order(1.2, 50.0, 20.0), controller=Pid(0.55, 60.0), load=Signal(noise_sd=0.5, noise_tau_s=1200.0),
    noise=Signal(noise_sd=0.12), pv_start=62.0, op_start=47.0, op_limits=(0.0, 100.0), settle_s=7200.0,
)  # fmt: skip
STICKS = LoopSpec(
    plant=FREE.plant, controller=FREE.controller, load=Signal(value=2.0, noise_sd=0.15, noise_tau_s=1200.0),
    noise=FREE.noise, pv_start=62.0, op_start=47.0, op_limits=(0.0, 100.0), settle_s=7200.0,
    valve=TwoParameterValve(5.0, 2.0),
)  # fmt: skip
LOOPS = {"free": (FREE, 3), "sticks": (STICKS, 2)}


@lru_cache(maxsize=4)
def simulated(loop: str) -> SimulatedLoop:
    spec, seed = LOOPS[loop]
    return simulate_loop(spec, TS * (LONGEST + BETWEEN), TS, seed)


def record(before: str, since: str, *, newest: int = NEWEST, parted_by: str = "manual") -> Recording:
    """The longest stretch of one loop, some time out of automatic or without a sample, and a newer stretch."""
    first, then = simulated(before), simulated(since)
    pv, op, sp = (
        np.concatenate((getattr(first, signal)[: LONGEST + BETWEEN], getattr(then, signal)[:newest]))
        for signal in ("pv", "op", "sp")
    )
    automatic = np.ones(len(pv), dtype=np.bool_)
    automatic[LONGEST : LONGEST + BETWEEN] = False
    whole = Recording("loop", TS * np.arange(len(pv)), pv, op, sp, automatic=automatic)
    return whole if parted_by == "manual" else whole.part(automatic)


def codes_of(answer: Audit) -> set[str]:
    return {reason.code for reason in answer.judgement.reasons}


@pytest.mark.parametrize("parted_by", ["manual", "a hole"])
def test_what_began_to_stick_behind_a_longer_stretch_is_accused(parted_by: str) -> None:
    """It was cleared reliably on the week before, until the newer stretch had half of that."""
    recording = record("free", "sticks", parted_by=parted_by)
    found, part = audit(recording), identified_part(recording)
    assert (found.judgement.verdict, found.judgement.reliability) == ("stiction", "reliable")
    assert found.window.start_s == pytest.approx(TS * (LONGEST + BETWEEN))
    (text,) = (reason.text for reason in found.judgement.reasons if reason.code == "newer_judged")
    assert f"the longest, of {LONGEST:,}, is older" in text
    assert part.start_s == found.identified.start_s


def test_a_valve_that_sticks_is_not_cleared_by_a_shorter_stretch() -> None:
    found = audit(record("sticks", "free"))
    assert (found.judgement.verdict, found.judgement.reliability) == ("stiction", "not_reliable")
    assert found.window.start_s == 0.0
    assert "newer_disagrees" in codes_of(found)


def test_a_newer_stretch_that_says_the_same_is_the_one_that_is_judged() -> None:
    found = audit(record("sticks", "sticks"))
    assert (found.judgement.verdict, found.judgement.reliability) == ("stiction", "reliable")
    assert found.window.start_s == pytest.approx(TS * (LONGEST + BETWEEN))


@pytest.mark.parametrize("before", ["free", "sticks"])
def test_a_newer_stretch_of_too_few_samples_says_nothing(before: str) -> None:
    short, without = (audit(record(before, "sticks", newest=newest)) for newest in (499, 0))
    assert short.judgement.verdict == without.judgement.verdict
    assert short.judgement.stiction_probability == without.judgement.stiction_probability
    assert not codes_of(short) & {"newer_judged", "newer_disagrees"}
