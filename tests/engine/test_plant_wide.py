"""Loops that oscillate together are found, and the sticky one that shakes them comes first."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from app.engine.audit import audit
from app.engine.oscillation import detect
from app.engine.plant_wide.groups import Candidate, groups
from app.engine.plant_wide.swing import swing_of
from app.engine.recording import Recording, UniformRecord
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, Wave, first_order, simulate_loop
from app.ingest import read_recordings

INTERVAL_S = 5.0
SAMPLES = 2880
SOURCE = "FIC100"
SHAKEN = tuple(f"TIC{200 + k}" for k in range(10))
OTHERS = tuple(f"PIC{300 + k}" for k in range(4))


def shaken_plant(onset_s: float = 0.0) -> list[Recording]:
    """Four hours of 15 loops: a sticky one (at rest until `onset_s`), ten that it shakes, four with their own swing."""
    source = _source(onset_s)
    rng = np.random.default_rng(7)
    found = [source.recording(SOURCE)]
    for number, tag in enumerate(SHAKEN):
        found.append(_shaken(tag, source.true_pv - source.sp, 20.0 + 12.0 * number, 0.4 + 0.1 * number, rng))
    return [*found, *(_swinging(tag, number) for number, tag in enumerate(OTHERS))]


def _source(onset_s: float):
    load = Signal(value=2.5, noise_sd=0.15, noise_tau_s=300.0)
    if onset_s:
        load = Signal(steps=((onset_s, 4.0),))
    spec = LoopSpec(
        plant=first_order(1.2, 40.0, 15.0),
        controller=Pid(0.5, 40.0),
        valve=TwoParameterValve(6.0, 3.0),
        load=load,
        noise=Signal(noise_sd=0.05),
        pv_start=60.0,
        op_start=47.0,
        pv_limits=(0.0, 120.0),
        op_limits=(0.0, 100.0),
        settle_s=0.0 if onset_s else 3600.0,
    )
    return simulate_loop(spec, SAMPLES * INTERVAL_S, INTERVAL_S, 3)


def _shaken(tag: str, shaking: np.ndarray, lag_s: float, gain: float, rng: np.random.Generator) -> Recording:
    """A temperature under PI control with a linear valve: what the source's PV does comes in through a lag."""
    n = len(shaking)
    pv, op, noise = np.zeros(n), np.zeros(n), 0.03 * rng.standard_normal(n)
    felt = level = integral = 0.0
    for k in range(n):
        felt += INTERVAL_S / lag_s * (shaking[k] - felt)
        level += INTERVAL_S / 150.0 * (gain * felt + 0.8 * op[k - 1] - level) if k else 0.0
        pv[k] = level + noise[k]
        integral -= INTERVAL_S / 200.0 * pv[k]
        op[k] = 0.8 * (-pv[k] + integral)
    return Recording(tag, np.arange(n) * INTERVAL_S, 180.0 + pv, 50.0 + op, sp=np.full(n, 180.0))


def _swinging(tag: str, number: int) -> Recording:
    """A pressure with a swing of its own, of another period."""
    wave = Wave(amplitude=3.0, period_s=190.0 + 47.0 * number, phase_rad=float(number))
    spec = LoopSpec(
        plant=first_order(0.16, 40.0, 10.0),
        controller=Pid(9.0, 45.0),
        load=Signal(waves=(wave,), noise_sd=0.3, noise_tau_s=300.0),
        noise=Signal(noise_sd=0.01),
        pv_start=8.0,
        op_start=50.0,
        pv_limits=(0.0, 16.0),
        op_limits=(0.0, 100.0),
        settle_s=1800.0,
    )
    return replace(simulate_loop(spec, SAMPLES * INTERVAL_S, INTERVAL_S, 40 + number).recording(tag), name=tag)


@cache
def candidates(onset_s: float) -> tuple[Candidate, ...]:
    return tuple(found for found in map(candidate, shaken_plant(onset_s)) if found is not None)


def candidate(recording: Recording) -> Candidate | None:
    found = audit(recording)
    if found.swing is None:
        return None
    return Candidate(recording.name, found.swing, found.judgement.stiction_probability)


def wave(tag: str, period_s: float, phase: float = 0.0, start_s: float = 0.0, unit: str | None = None) -> Candidate:
    """A loop whose PV is a sine with a little noise, 600 samples at 10 s."""
    time_s = start_s + np.arange(600) * 10.0
    noise = np.random.default_rng(len(tag)).normal(size=600)
    pv = np.sin(2 * np.pi * time_s / period_s - phase) + 0.05 * noise
    record = UniformRecord(10.0, pv, -pv, None, np.zeros(600, dtype=np.bool_), start_s)
    swing = swing_of(record, detect(record))
    assert swing is not None
    return Candidate(tag, swing, 0.2, unit)


def test_a_swing_is_the_same_in_any_unit():
    pv = np.sin(np.arange(600) / 9.0) + 0.05 * np.random.default_rng(0).normal(size=600)
    detected = detect(UniformRecord(10.0, pv, -pv, None, np.zeros(600, dtype=np.bool_), 0.0))
    swings = [
        swing_of(UniformRecord(10.0, pv * scale, -pv, None, np.zeros(600, dtype=np.bool_), 0.0), detected)
        for scale in (1.0, 2.0**-1000, 1e-200, 1e90)
    ]
    for swing in swings:
        assert swing is not None
        np.testing.assert_allclose(swing.lines, swings[0].lines, atol=1e-12)
        np.testing.assert_allclose(swing.bands, swings[0].bands, atol=1e-12)


@pytest.mark.parametrize("onset_s", [0.0, 5000.0])
def test_one_sticky_valve_that_shakes_ten_loops_is_the_likeliest_source(onset_s):
    found = [group for group in groups(candidates(onset_s)) if group.in_step]
    assert len(found) == 1
    assert {suspect.tag for suspect in found[0].suspects} == {SOURCE, *SHAKEN}
    assert found[0].source == SOURCE
    assert not found[0].by_chance
    assert found[0].suspects[0].tag == SOURCE
    lags = [suspect.lag_s for suspect in sorted(found[0].suspects, key=lambda s: s.tag)]
    assert lags[1:] == sorted(lags[1:])  # the loops were given ever longer lags behind the source


def test_what_the_source_shakes_is_all_that_it_may_explain():
    (found,) = (group for group in groups(candidates(0.0)) if group.in_step)
    assert {suspect.tag for suspect in found.shaken} == set(SHAKEN)


def test_nothing_is_shaken_where_no_source_is_named_or_only_shapes_are_alike():
    one, two = wave("A", 300.0), wave("BB", 300.0, phase=1.0)
    assert groups([one, two])[0].shaken == ()  # neither is likelier to stick than not
    sticks = replace(two, stiction_probability=0.9)
    assert [suspect.tag for suspect in groups([one, sticks])[0].shaken] == ["A"]
    later = wave("BB", 300.0, start_s=40_000.0, unit="U1")
    apart = groups([replace(one, unit="U1", stiction_probability=0.9), later])
    assert [(group.in_step, group.shaken) for group in apart] == [(False, ())]


def test_loops_with_a_swing_of_their_own_are_in_no_group():
    together = {suspect.tag for group in groups(candidates(0.0)) for suspect in group.suspects}
    assert together.isdisjoint(OTHERS)


def test_the_beginning_of_an_oscillation_is_found():
    found = groups(candidates(5000.0))[0]
    onsets = [suspect.onset_s for suspect in found.suspects]
    assert all(onset == pytest.approx(5000.0, abs=900.0) for onset in onsets)
    assert all(suspect.onset_s is None for suspect in groups(candidates(0.0))[0].suspects)


def test_the_order_of_the_loops_changes_nothing():
    assert groups(candidates(0.0)) == groups(candidates(0.0)[::-1])


def test_in_step_means_the_same_frequency_at_the_same_time():
    one, two, other = wave("A", 300.0), wave("BB", 300.0, phase=1.0), wave("CCC", 350.0)
    found = groups([one, two, other])
    assert [[s.tag for s in group.suspects] for group in found] == [["A", "BB"]]
    assert found[0].suspects[1].lag_s == pytest.approx(300.0 / (2 * np.pi), rel=0.02)
    assert found[0].source is None  # no member is likelier to stick than not


def test_a_pair_among_many_loops_may_be_chance():
    many = [wave("L" * (number + 3), 150.0 * 1.06**number) for number in range(30)]
    pair = [group for group in groups([wave("A", 300.0), wave("BB", 304.0, phase=1.0), *many]) if group.in_step]
    assert pair
    assert all(group.by_chance for group in pair)


def hunting(tag: str, seed: int, period_s: float) -> Candidate:
    """A valve that sticks in a limit cycle of its own, whose period wanders."""
    rng, time_s = np.random.default_rng(seed), np.arange(600) * 10.0
    phase = 2 * np.pi * time_s / period_s + 0.15 * np.cumsum(rng.normal(size=600))
    record = UniformRecord(10.0, np.sin(phase), -np.sin(phase), None, np.zeros(600, dtype=np.bool_), 0.0)
    swing = swing_of(record, replace(detect(record), period_s=period_s, regularity=5.0))
    assert swing is not None
    return Candidate(tag, swing, 0.99)


@pytest.mark.parametrize("others", [0, 60])
def test_valves_that_stick_at_about_a_shared_period_are_no_source_of_it(others):
    """Among few loops a near period alone is rarely chance: there what they share has to be what the valve does."""
    many = [wave("L" * (number + 3), 60.0 * 1.05**number) for number in range(others)]
    outside = [wave(f"TIC{number}", 300.0, phase=0.2 * number) for number in range(5)]
    for seed in range(12):
        valves = [hunting(f"PIC{number}", 10 * seed + number, 300.0) for number in range(3)]
        found = groups([*outside, *valves, *many])
        together = [group for group in found if {"TIC0", "TIC1"} <= {suspect.tag for suspect in group.suspects}]
        assert [(group.source, group.by_chance, group.shaken) for group in together] == [(None, False, ())]
        assert {"TIC2", "TIC3", "TIC4"} <= {suspect.tag for suspect in together[0].suspects}


def test_a_valve_that_sticks_by_itself_is_not_said_to_be_shaken():
    """It swings without another's help: only as one with the source it may be doubted for it."""
    source = replace(wave("A", 300.0), stiction_probability=0.999)
    found = groups([source, *(wave(f"BB{number}", 300.0, phase=1.0) for number in range(2)), hunting("C", 5, 300.0)])
    in_step = {suspect.tag: suspect.coherence for suspect in found[0].suspects[1:]}
    assert found[0].source == "A"
    assert 0.7 < in_step["C"] < 0.95
    assert {suspect.tag for suspect in found[0].shaken} == {"BB0", "BB1"}


def test_no_source_is_named_where_the_period_may_be_shared_by_chance():
    many = [wave("L" * (number + 3), 150.0 * 1.06**number) for number in range(30)]
    sticky = [replace(wave("A", 300.0), stiction_probability=0.9), wave("BB", 309.0, phase=1.0)]
    assert [group.source for group in groups(sticky)] == ["A"]
    crowded = [group for group in groups([*sticky, *many]) if "A" in {suspect.tag for suspect in group.suspects}]
    assert [group.source for group in crowded] == [None]


def test_loops_that_wander_together_are_told_from_many_others_of_their_period():
    """In a plant of hundreds some share any period: who is shaken by whom must not be lost among them."""
    many = tuple(wave("L" * (number + 3), 60.0 * 1.01**number) for number in range(300))
    source = next(group for group in groups(candidates(0.0)) if group.source == SOURCE)
    crowded = [group for group in groups((*candidates(0.0), *many)) if group.source == SOURCE]
    assert [{suspect.tag for suspect in group.shaken} for group in crowded] == [{s.tag for s in source.shaken}]
    assert crowded[0].chance_probability < 0.01
    assert len(source.shaken) >= len(SHAKEN) - 2


def wandering(tag: str, seed: int, period_s: float, start_s: float) -> Candidate:
    """A loop of five hours whose swing wanders by itself in amplitude and phase."""
    rng, time_s = np.random.default_rng(seed), np.arange(1800) * 10.0
    slow = [np.interp(time_s, np.linspace(0.0, 18_000.0, 13), rng.normal(size=13)) for _ in range(2)]
    pv = slow[0] * np.cos(2 * np.pi * time_s / period_s) + slow[1] * np.sin(2 * np.pi * time_s / period_s)
    record = UniformRecord(10.0, pv, -pv, None, np.zeros(1800, dtype=np.bool_), start_s)
    swing = swing_of(record, replace(detect(record), period_s=period_s, regularity=2.0))
    assert swing is not None
    return Candidate(tag, swing, 0.9)


def test_what_was_recorded_together_for_a_moment_only_is_hardly_in_step():
    """Over a few of their swings any two loops are coherent: as many as that come by chance in a large plant."""
    periods = 200.0 * 6.0 ** (np.arange(60) / 60)
    early = [wandering(f"A{k}", k, period_s, 0.0) for k, period_s in enumerate(periods)]
    late = [wandering(f"B{k}", 60 + k, 1.01 * period_s, 16_200.0) for k, period_s in enumerate(periods)]
    doubted = [suspect.tag for group in groups([*early, *late]) for suspect in group.shaken]
    assert len(doubted) <= 8


def test_what_one_step_of_their_set_points_leaves_behind_is_no_common_swing():
    """Loops that answer one step alike are coherent over the whole record, and by no chance; they do not oscillate."""

    def stepped(tag: str, seed: int, at: int) -> Candidate:
        rng, k = np.random.default_rng(seed), np.arange(2880)
        answer = np.where(k > at, np.exp(-(k - at) / 120.0) * np.sin(2 * np.pi * (k - at) / 170.0), 0.0)
        pv = answer + 0.03 * rng.normal(size=2880)
        record = UniformRecord(5.0, pv, -pv, None, np.zeros(2880, dtype=np.bool_), 0.0)
        swing = swing_of(record, replace(detect(record), period_s=850.0, regularity=1.5))
        assert swing is not None
        return Candidate(tag, swing, 0.1)

    assert groups([stepped(f"L{seed}", seed, 960) for seed in range(5)]) == ()
    found = groups([wave("A", 300.0), wave("BB", 300.0), *(stepped(f"L{k}", k, 960) for k in range(5))])
    assert [{suspect.tag for suspect in group.suspects} for group in found] == [{"A", "BB"}]


def test_too_few_cycles_make_no_group():
    assert groups([wave("A", 900.0), wave("BB", 900.0)]) == ()


def test_records_that_do_not_overlap_are_alike_at_most_and_only_within_a_unit():
    apart = [wave("A", 300.0, unit="U1"), wave("BB", 300.0, start_s=50_000.0, unit="U1")]
    assert [group.in_step for group in groups(apart)] == [False]
    assert len({suspect.score for suspect in groups(apart)[0].suspects}) == 1  # neither began late
    assert groups([apart[0], wave("CCC", 300.0, start_s=50_000.0, unit="U2")]) == ()


@pytest.mark.parametrize("age_d", [0.0, 10.0, 30.0, 100.0, 10_000.0])
def test_one_old_record_changes_nothing_among_the_others(age_d):
    """One grid over all times left the others a few points each, which chance brings in step, or none at all."""
    own = [wave("A", 300.0), wave("BB", 300.0, phase=1.0), wave("CCC", 340.0), wave("DDDD", 318.0)]
    old = wave("EEEEE", 300.0, start_s=-age_d * 86400.0 - 6000.0)
    found = groups([*own, old])
    assert [(g.in_step, {s.tag for s in g.suspects}) for g in found if g.in_step] == [(True, {"A", "BB"})]
    assert found[0].suspects[1].lag_s == pytest.approx(300.0 / (2 * np.pi), rel=0.02)


def test_fewer_than_two_loops_are_no_group():
    assert groups([]) == groups([wave("A", 300.0)]) == ()


def test_of_two_sure_valves_the_likelier_is_the_source_and_the_others_are_measured_against_it():
    """Beyond 0.99 the odds are cut off, so that both score the same: the tag decided, against another's coherence."""
    sure, surer = wave("A", 300.0), wave("BB", 300.0)
    sure, surer = replace(sure, stiction_probability=0.991), replace(surer, stiction_probability=0.999)
    found = groups([sure, surer])[0]
    assert found.source == "BB"
    assert [suspect.tag for suspect in found.shaken] == ["A"]


@pytest.mark.shared
def test_the_three_interacting_loops_of_a_real_plant(shared_dir: Path):
    """CHEM13 and CHEM14 share a period of 482 s; the faulty steam flow comes first. CHEM15 swings weakly, at 381 s."""
    names = ("CHEM13", "CHEM14", "CHEM15")
    read = [read_recordings(shared_dir / "recordings" / f"{name}.csv").recordings[0] for name in names]
    found = groups([c for c in map(candidate, read) if c is not None])
    assert [[s.tag for s in group.suspects] for group in found] == [["CHEM14", "CHEM13"]]
    assert found[0].source == "CHEM14"
    assert not found[0].in_step  # as recorded, the two do not wander together


def test_the_chance_of_a_like_period_is_that_of_how_near_it_was_taken_from():
    """Of ten loops one is within 3.5 % of another's period in a fifth of all plants: that names no source."""

    def steady(tag: str, period_s: float, stuck: float = 0.2) -> Candidate:
        made = wave(tag, 300.0, unit="U1")
        lines = np.zeros(9, dtype=np.complex128)
        lines[4] = 1.0
        swing = replace(made.swing, period_s=period_s, length_s=144.0 * period_s, lines=lines, first_line=140)
        return replace(made, swing=swing, stiction_probability=stuck)

    pair = [steady("A", 300.0, 0.9), steady("BB", 309.9)]
    others = [steady("C" * (number + 3), 400.0 * 1.3**number) for number in range(8)]
    (group,) = (one for one in groups([*pair, *others]) if {s.tag for s in one.suspects} == {"A", "BB"})
    assert not group.in_step
    others_so_near = 9 * 2 * (0.03 + 0.75 / 144.0) / np.log(20.0)
    assert group.chance_probability == pytest.approx(1.0 - np.exp(-others_so_near), rel=0.2)
    assert group.source is None
