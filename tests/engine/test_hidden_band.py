"""The band of a valve whose loop hardly cycles: thousands of samples show it, and none where there is none."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.engine.audit import audit
from app.engine.causality import stem_search
from app.engine.causality.hidden_band import HiddenBand, hidden_band
from app.engine.fitness.signals import STANDING
from app.engine.recording import Recording, UniformRecord
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, integrator, simulate_loop

N = 12_000
S = 3.0


@cache
def level(seed: int, size: float, noise_sd: float = 0.05) -> Recording:
    """A level under a wandering load, whose noise moves OP to and fro within the band; three times as much hides it."""
    spec = LoopSpec(
        plant=integrator(1.0 / 200.0, 12.0), controller=Pid(5.0, 160.0), valve=TwoParameterValve(size, 0.6 * size),
        load=Signal(noise_sd=2.0, noise_tau_s=3000.0), noise=Signal(noise_sd=noise_sd), pv_start=50.0, op_start=50.0,
        op_limits=(0.0, 100.0), step_s=2.0,
    )  # fmt: skip
    return simulate_loop(spec, 10.0 * N, 10.0, seed).recording("level")


def uniform(made: Recording) -> UniformRecord:
    return UniformRecord(10.0, made.pv, made.op, None, np.zeros(made.samples, bool))


@pytest.fixture(scope="module")
def sticking() -> list[UniformRecord]:
    return [uniform(level(seed, S)) for seed in range(5)]


@pytest.fixture(scope="module")
def told(sticking: list[UniformRecord]) -> list[HiddenBand | None]:
    return [hidden_band(record) for record in sticking]


@pytest.fixture(scope="module")
def free() -> list[UniformRecord]:
    return [uniform(level(seed, 0.0)) for seed in range(8)]


def test_a_band_is_seen_and_sized(told: list[HiddenBand | None]) -> None:
    assert all(told)
    sizes = [band.S for band in told if band]
    assert 0.7 * S <= float(np.median(sizes)) <= 1.3 * S
    assert all(band.nats > band.needed for band in told if band)


def test_a_free_valve_shows_none(free: list[UniformRecord]) -> None:
    assert [hidden_band(record) for record in free] == [None] * len(free)


def test_units_and_signs_are_free(sticking: list[UniformRecord], told: list[HiddenBand | None]) -> None:
    for record, band in zip(sticking, told, strict=True):
        other = hidden_band(replace(record, pv=-40.0 * record.pv + 1000.0, op=-0.01 * record.op - 3.0))
        assert band
        assert other
        assert pytest.approx(0.01 * band.S) == other.S
        assert other.nats == pytest.approx(band.nats, rel=1e-3)


def test_a_standstill_is_passed_over(sticking: list[UniformRecord], free: list[UniformRecord]) -> None:
    def shut(record: UniformRecord) -> UniformRecord:
        pv, op = record.pv.copy(), record.op.copy()
        pv[9000:9800], op[9000:9800] = 0.0, 0.0
        return replace(record, pv=pv, op=op)

    assert all(isinstance(hidden_band(shut(record)), HiddenBand) for record in sticking)
    assert not any(hidden_band(shut(record)) for record in free)


def test_of_a_long_record_the_newest_part_tells(monkeypatch: pytest.MonkeyPatch, sticking: list[UniformRecord]) -> None:
    monkeypatch.setattr(stem_search, "MOST_SAMPLES", 6000)
    assert hidden_band(sticking[0]) == hidden_band(sticking[0].part(slice(N - 6000, N)))


@pytest.mark.parametrize("samples", [1, 2, 100, 600])
def test_of_few_samples_nothing_is_said(sticking: list[UniformRecord], samples: int) -> None:
    assert hidden_band(sticking[0].part(slice(0, samples))) is None


def test_where_nothing_moves_nothing_is_said(sticking: list[UniformRecord]) -> None:
    flat = np.full(N, 50.0)
    assert hidden_band(replace(sticking[0], op=flat)) is None
    assert hidden_band(replace(sticking[0], pv=flat)) is None
    short = sticking[0].part(slice(0, STANDING + 40 * stem_search.ORDER))
    assert hidden_band(replace(short, op=np.where(np.arange(short.samples) < STANDING, 50.0, short.op))) is None
    ramp = np.linspace(0.0, 1.0, N)
    assert hidden_band(replace(sticking[0], pv=ramp, op=ramp)) is None


def test_two_values_of_op_and_a_line_of_pv_do_no_harm(sticking: list[UniformRecord]) -> None:
    switched = np.where(sticking[0].op > np.median(sticking[0].op), 100.0, 0.0)
    for pv in (sticking[0].pv, np.linspace(0.0, 1.0, N)):
        found = hidden_band(replace(sticking[0], pv=pv, op=switched))
        assert found is None or np.isfinite(found.nats)


def test_a_level_whose_valve_has_a_band_is_not_cleared_reliably() -> None:
    judged = [audit(level(seed, S)).judgement for seed in range(4)]
    assert {one.verdict for one in judged} <= {"no_stiction", "inconclusive"}
    assert {one.reliability for one in judged} == {"not_reliable"}
    assert sum("hidden_band" in [reason.code for reason in one.reasons] for one in judged) >= 3


def test_a_level_whose_valve_is_free_still_is() -> None:
    judged = [audit(level(seed, 0.0)).judgement for seed in range(4)]
    assert sum((one.verdict, one.reliability) == ("no_stiction", "reliable") for one in judged) >= 3
    assert not any(reason.code == "hidden_band" for one in judged for reason in one.reasons)
