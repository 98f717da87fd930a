"""Long records: a spell of stiction is found and dated, a record of one piece has none."""

from itertools import pairwise

import numpy as np
import pytest

from app.engine.audit import AuditConfig, audit
from app.engine.evidence import Reason
from app.engine.fitness import assess
from app.engine.judged import _with_episodes
from app.engine.judgement import Judgement
from app.engine.long_records.episodes import (
    Episode,
    EpisodeConfig,
    Episodes,
    episode_reasons,
    find,
    is_long,
    window_spans,
)
from app.engine.oscillation import detect
from app.engine.recording import Recording, UniformRecord
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, simulate_loop

SAMPLES = 9000
FREE = LoopSpec(
    plant=first_order(1.0, 10.0, 3.0),
    controller=Pid(0.8, 10.0),
    noise=Signal(noise_sd=0.1),
    load=Signal(noise_sd=0.3, noise_tau_s=60.0),
    settle_s=300.0,
)
STICKY = LoopSpec(
    plant=FREE.plant,
    controller=FREE.controller,
    valve=TwoParameterValve(5.0, 2.0),
    noise=FREE.noise,
    load=Signal(value=3.0, noise_sd=0.3, noise_tau_s=60.0),
    settle_s=300.0,
)


def record(*parts: tuple[LoopSpec, int]) -> UniformRecord:
    loops = [simulate_loop(spec, float(n), 1.0, seed) for seed, (spec, n) in enumerate(parts)]
    pv, op = np.concatenate([x.pv for x in loops]), np.concatenate([x.op for x in loops])
    return UniformRecord(1.0, pv, op, np.zeros(len(pv)), np.zeros(len(pv), bool))


def episodes(*parts: tuple[LoopSpec, int]):
    made = record(*parts)
    return find(made, detect(made))


def overlap(found, start: float, end: float) -> float:
    both = min(found.end_s, end) - max(found.start_s, start)
    return both / (max(found.end_s, end) - min(found.start_s, start))


def test_a_spell_of_a_fifth_of_the_record_is_found_and_dated():
    found = episodes((FREE, 4000), (STICKY, 1800), (FREE, 3200)).found
    assert len(found) == 1
    assert overlap(found[0], 4000, 5800) >= 0.9
    assert (found[0].at_start, found[0].at_end) == (False, False)
    assert found[0].probability > 0.8


def test_a_valve_repaired_in_mid_record_stuck_until_then():
    found = episodes((STICKY, 4500), (FREE, 4500))
    assert len(found.found) == 1
    assert (found.found[0].start_s, found.found[0].at_start) == (0.0, True)
    assert found.found[0].end_s == pytest.approx(4500, abs=200)
    assert [reason.code for reason in episode_reasons(found)] == ["short_lived_stiction", "stiction_ended"]


def test_a_valve_that_starts_to_stick_says_since_when():
    found = episodes((FREE, 5500), (STICKY, 3500))
    assert found.found[0].start_s == pytest.approx(5500, abs=200)
    assert [reason.code for reason in episode_reasons(found)] == ["short_lived_stiction", "stiction_began"]


@pytest.mark.parametrize("spec", [FREE, STICKY])
def test_a_record_of_one_piece_has_no_episode(spec):
    found = episodes((spec, SAMPLES))
    assert found.found == ()
    assert len(found.windows) > 3


def test_a_short_record_is_not_looked_at_window_by_window():
    made = record((STICKY, 1500))
    assert not is_long(made, detect(made), EpisodeConfig())
    assert find(made, detect(made)).windows == ()


@pytest.mark.parametrize("samples", [2600, 5001, 30_000])
def test_windows_cover_the_whole_record_and_are_bounded(samples):
    made = UniformRecord(1.0, np.zeros(samples), np.zeros(samples), None, np.zeros(samples, bool))
    oscillation = detect(record((STICKY, 1500)))
    spans = window_spans(made, oscillation, EpisodeConfig())
    assert 1 <= len(spans) <= 24
    assert (spans[0].start, spans[-1].stop) == (0, samples)
    assert all(after.start <= before.stop for before, after in pairwise(spans))


def test_units_and_time_do_not_move_an_episode():
    made = record((FREE, 4000), (STICKY, 1800), (FREE, 3200))
    changed = UniformRecord(60.0, 32.0 - 1.8 * made.pv, 0.01 * made.op + 7.0, None, made.filled)
    here, there = find(made, detect(made)).found[0], find(changed, detect(changed)).found[0]
    assert (there.start_s / 60.0, there.end_s / 60.0) == pytest.approx((here.start_s, here.end_s), abs=60)
    assert there.probability == pytest.approx(here.probability, abs=1e-6)


def test_an_audit_says_when_the_valve_stuck_and_clears_it_no_more():
    recording = simulate_loop(STICKY, 10.0, 1.0).recording("x")
    made = record((FREE, 3500), (STICKY, 2500), (FREE, 3000))
    recording = type(recording)("x", np.arange(made.samples, dtype=float), made.pv, made.op)
    answer = audit(recording)
    quiet = audit(recording, AuditConfig(episodes=EpisodeConfig(long_samples=10**9)))
    assert answer.judgement.verdict == quiet.judgement.verdict == "no_stiction"
    assert answer.judgement.reliability == "not_reliable"
    assert "short_lived_stiction" in {reason.code for reason in answer.judgement.reasons}
    assert "short_lived_stiction" not in {reason.code for reason in quiet.judgement.reasons}
    assert quiet.episodes.found == ()


def test_a_valve_that_began_to_stick_sticks_now():
    made = record((FREE, 7000), (STICKY, 2500))
    recording = Recording("x", np.arange(made.samples, dtype=float), made.pv, made.op)
    answer, quiet = audit(recording), audit(recording, AuditConfig(episodes=EpisodeConfig(long_samples=10**9)))
    assert (quiet.judgement.verdict, answer.judgement.verdict) == ("no_stiction", "stiction")
    assert (answer.judgement.reliability, answer.judgement.likely_cause) == ("not_reliable", "stiction")
    assert answer.judgement.stiction_probability == answer.episodes.found[-1].probability > 0.8
    assert [reason.code for reason in answer.judgement.reasons][:2] == ["stiction_began", "short_lived_stiction"]


@pytest.mark.shared
@pytest.mark.parametrize("name", ["BAS1", "PAP7", "POW3", "SACAC-other-F-chemicals-2003"])
def test_long_healthy_recordings_have_no_episode(shared_dir, name):
    table = np.genfromtxt(shared_dir / "recordings" / f"{name}.csv", delimiter=",", names=True)
    good = np.diff(table["time"], prepend=-np.inf) > 0
    recording = type(simulate_loop(FREE, 10.0, 1.0).recording("x"))
    fitness = assess(recording(name, table["time"][good], table["PV"][good], table["OP"][good]))
    assert find(fitness.audited, detect(fitness.audited)).found == ()


@pytest.mark.parametrize(
    ("reliability", "told"),
    [
        ("not_reliable", ["stiction_began", "stretches_disagree", "short_lived_stiction"]),
        ("reliable", ["stretches_disagree", "short_lived_stiction", "stiction_began"]),
    ],
)
def test_when_it_began_comes_first_where_stiction_is_not_relied_on(reliability, told):
    spell = Episode(7000.0, 9500.0, 0.99, "reliable", 60.0, 5, at_start=False, at_end=True)
    said = Judgement("stiction", 0.8, reliability, (Reason("stretches_disagree", "only 4 of 7"),), "stiction")
    found = _with_episodes(said, Episodes((), (spell,)))
    assert [reason.code for reason in found.reasons] == told
    assert (found.verdict, found.reliability) == ("stiction", reliability)
