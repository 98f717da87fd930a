"""What a run says at its end of loops that a neighbour's valve shakes: sticky as far as their own record tells, and not
to be relied on.
"""

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from sqlalchemy import update

from app.engine.plant_wide import Suspect
from app.engine.recording import FloatArray
from app.engine.simulate import LoopSpec, Pid, Signal, SimulatedLoop, TwoParameterValve, first_order, simulate_loop
from app.services.auditing import ending
from app.services.auditing.audits import cancel_audit, get_audit, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.ending import SHAKEN, end_if_complete, neighbour_text
from app.services.backend import Backend
from app.services.plant.loops import loop_health, verdict_detail
from app.services.plant.reliability import RowFilter, reliability_json, reliability_page
from app.services.upkeep.operations import sweep
from app.storage import items, loops, series
from app.storage.audits import LoopFilter
from app.storage.samples import Samples
from app.storage.series import Stretch
from app.storage.tables import newest_rows

START_NS = 1_750_000_000_000_000_000
INTERVAL_S = 5.0
SAMPLES = 2880
SOURCE, ALONE = "FIC100", "FIC900"
SHAKEN_LOOPS = ("TIC201", "TIC202", "TIC203")


def sticky(seed: int, tau: float) -> SimulatedLoop:
    spec = LoopSpec(
        plant=first_order(1.2, tau, 0.4 * tau),
        controller=Pid(0.5, tau),
        valve=TwoParameterValve(6.0, 3.0),
        load=Signal(value=2.5, noise_sd=0.15, noise_tau_s=300.0),
        noise=Signal(noise_sd=0.05),
        pv_start=60.0,
        op_start=47.0,
        pv_limits=(0.0, 120.0),
        op_limits=(0.0, 100.0),
        settle_s=3600.0,
    )
    return simulate_loop(spec, SAMPLES * INTERVAL_S, INTERVAL_S, seed)


def shaken(shaking: FloatArray, tau: float, seed: int) -> tuple[FloatArray, FloatArray]:
    """PV and OP of a healthy loop with a linear valve; what the source's PV does is its load."""
    n = len(shaking)
    pv, op, noise = np.zeros(n), np.zeros(n), 0.05 * np.random.default_rng(seed).standard_normal(n)
    level = integral = 0.0
    for k in range(n):
        level += (1.0 - np.exp(-INTERVAL_S / tau)) * (shaking[k] + (op[k - 1] if k else 0.0) - level)
        pv[k] = level + noise[k]
        integral -= INTERVAL_S / (2.0 * tau) * pv[k]
        op[k] = 0.4 * (-pv[k] + integral)
    return 180.0 + pv, 50.0 + op


@dataclass(frozen=True)
class Plant:
    backend: Backend
    run: str

    def row(self, tag: str) -> dict[str, Any]:
        [row] = reliability_page(self.backend, filters=RowFilter(search=tag)).rows
        return row


@cache
def recordings() -> dict[str, tuple[FloatArray, FloatArray]]:
    source, alone = sticky(3, 40.0), sticky(4, 130.0)
    made = {SOURCE: (source.pv, source.op), ALONE: (alone.pv, alone.op)}
    for number, tag in enumerate(SHAKEN_LOOPS):
        made[tag] = shaken(source.true_pv - source.sp, 20.0 + 15.0 * number, number)
    return made


def stored(backend: Backend, *tags: str) -> None:
    times = START_NS + (np.arange(SAMPLES) * INTERVAL_S * 1e9).astype(np.int64)
    with backend.database.write() as connection:
        ids = loops.ensure(connection, tags)
        signals = {tag: recordings()[tag] for tag in tags}
        series.add(
            connection,
            [Stretch(ids[tag], Samples(times, {"pv": pv, "op": op})) for tag, (pv, op) in signals.items()],
            None,
        )


def audited(backend: Backend, wanted: LoopFilter | None = None) -> str:
    run = start_audit(backend, wanted)
    audit_chunk(backend, int(run.id), "test")
    return run.id


@pytest.fixture
def plant(backend: Backend, warm_kernels: None) -> Plant:
    stored(backend, SOURCE, ALONE, *SHAKEN_LOOPS)
    return Plant(backend, audited(backend))


def test_the_loops_by_themselves_are_relied_on(backend: Backend, warm_kernels: None) -> None:
    """What there is to mend: a healthy valve is accused, reliably, because of its neighbour's."""
    stored(backend, *SHAKEN_LOOPS[:1])
    audited(backend)
    row = Plant(backend, "").row(SHAKEN_LOOPS[0])
    assert (row["verdict"], row["reliability"]) == ("stiction", "reliable")


def test_shaken_loops_are_not_relied_on_and_say_whose_valve_to_look_at(plant: Plant) -> None:
    assert get_audit(plant.backend, plant.run).state == "done"
    for tag in SHAKEN_LOOPS:
        row = plant.row(tag)
        assert (row["verdict"] == "stiction") <= (row["reliability"] == "not_reliable")
    told = plant.row(SHAKEN_LOOPS[0])
    assert told["verdict"] == "stiction"
    assert told["reasons"].split(";")[0] == SHAKEN
    assert SOURCE in told["reasons_text"]


def test_the_source_and_a_valve_with_a_swing_of_its_own_keep_their_verdicts(plant: Plant) -> None:
    for tag in (SOURCE, ALONE):
        row = plant.row(tag)
        assert (row["verdict"], row["reliability"]) == ("stiction", "reliable")
        assert SHAKEN not in row["reasons"]


def test_every_view_of_the_verdict_says_the_same(plant: Plant) -> None:
    tag = SHAKEN_LOOPS[0]
    row, health = plant.row(tag), loop_health(plant.backend, tag)
    detail = verdict_detail(plant.backend, tag)
    assert health["reliability"] == row["reliability"] == "not_reliable"
    assert (
        health["health"] == row["health"] == pytest.approx(100.0 - sum(p["lost"] for p in detail["health"]), abs=0.05)
    )
    assert [reason["code"] for reason in detail["reasons"]] == row["reasons"].split(";")
    [valve] = [part for part in detail["health"] if part["code"] == "stiction"]
    assert valve["lost"] == pytest.approx(24.0 * row["stiction_probability"], abs=0.05)
    assert f'"loop":"{tag}"'.encode() in reliability_json(plant.backend).write()
    filtered = reliability_page(plant.backend, filters=RowFilter(reliability="reliable", verdict=("stiction",)))
    assert [found["loop"] for found in filtered.rows] == [SOURCE, ALONE]


def test_the_table_that_was_read_before_the_end_is_read_again(backend: Backend, warm_kernels: None) -> None:
    stored(backend, SOURCE, *SHAKEN_LOOPS[:1])
    run = int(start_audit(backend).id)
    with backend.database.write() as connection:
        lost = items.claim(connection, run, "lost", 1, backend.settings.lease_s)
    audit_chunk(backend, run, "test")
    before = reliability_json(backend)
    assert b"reliable" in before.write()
    with backend.database.write() as connection:
        items.release(connection, lost)
    audit_chunk(backend, run, "test")
    after = reliability_json(backend)
    assert after.version != before.version
    assert SHAKEN.encode() in after.write()


def test_a_loop_audited_alone_is_heard_beside_what_is_known_of_its_neighbours(plant: Plant) -> None:
    run = audited(plant.backend, LoopFilter(tags=(SHAKEN_LOOPS[0],)))
    row = plant.row(SHAKEN_LOOPS[0])
    assert row["audit_id"] == run
    assert row["reliability"] == "not_reliable"
    assert row["reasons"].split(";").count(SHAKEN) == 1


def test_a_run_that_its_workers_left_complete_is_ended_by_the_sweep(backend: Backend, warm_kernels: None) -> None:
    stored(backend, SOURCE, *SHAKEN_LOOPS[:1])
    run = int(start_audit(backend).id)
    with backend.database.write() as connection:
        lost = items.claim(connection, run, "lost", 1, backend.settings.lease_s)
    audit_chunk(backend, run, "test")
    assert not end_if_complete(backend, run)
    with backend.database.write() as connection:
        items.fail(connection, [items.Failure(lost[0], "fault", "it broke")])
    assert sweep(backend).ended == 1
    assert get_audit(backend, str(run)).state == "partial"
    assert not end_if_complete(backend, run)


def test_who_comes_after_the_end_rewords_nothing(
    backend: Backend, warm_kernels: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker that was overtaken by a cancellation, or by another worker: readers keep what they read after the
    end."""
    stored(backend, SHAKEN_LOOPS[1])
    stored(backend, SOURCE, SHAKEN_LOOPS[0])
    run = int(start_audit(backend).id)
    with backend.database.write() as connection:
        lost = items.claim(connection, run, "lost", 1, backend.settings.lease_s)
    audit_chunk(backend, run, "test")
    with backend.database.write() as connection:
        items.fail(connection, [items.Failure(lost[0], "fault", "it broke")])
    with backend.database.read() as connection:
        doubts = ending._doubts(connection, run)
    assert [doubt.columns["reliability"] for doubt in doubts] == ["not_reliable"]
    cancel_audit(backend, str(run))
    monkeypatch.setattr(ending.audits, "complete", lambda _: [run])
    monkeypatch.setattr(ending, "_doubts", lambda *_: doubts)
    assert not end_if_complete(backend, run)
    assert Plant(backend, str(run)).row(SHAKEN_LOOPS[0])["reliability"] == "reliable"


def test_a_run_ends_whatever_is_kept_of_a_loop(plant: Plant) -> None:
    with plant.backend.database.write() as connection:
        connection.execute(update(newest_rows).values(swing_json="{}"))
    run = audited(plant.backend, LoopFilter(tags=(SOURCE,)))
    assert get_audit(plant.backend, run).state == "done"


def test_a_source_that_swung_sooner_is_not_called_likelier() -> None:
    shaken = Suspect("TIC201", 0.95, 1.4, 9000.0, 0.91, -3.0)
    source = Suspect(SOURCE, 0.85, 1.7, None, 1.0, 0.0)
    assert "is likelier to stick (0.98 against 0.95)" in neighbour_text(
        shaken, replace(source, stiction_probability=0.98), 0.95
    )
    assert "whose swing began sooner (0.85 against 0.95)" in neighbour_text(shaken, source, 0.95)
