"""A repair parts what a loop is judged on, as soon as there are samples enough since then."""

import json
from collections.abc import Callable
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from sqlalchemy import true, update

from app.engine.judgement import PV_STANDS
from app.engine.simulate import LinearValve, LoopSpec, Pid, Signal, TwoParameterValve, first_order, simulate_loop
from app.services.auditing import audits, chunks
from app.services.backend import Backend
from app.services.digests import making, telling
from app.services.moments import ns_of
from app.services.plant import before_after, loop_verdicts, reliability, repaired
from app.services.plant.before_after import compared
from app.services.plant.listing import listing
from app.services.plant.work_list import work_list
from app.services.reports.documents import loop_report, plant_report
from app.services.stating import notes
from app.services.telling.next_steps import Ask, Step, after_repair, step_for
from app.services.telling.wording import RELIABILITY_WORDS, UNANSWERED, headline, rely
from app.storage import loops as stored_loops
from app.storage import series
from app.storage.samples import Samples
from app.storage.series import Stretch
from app.storage.tables import newest_rows, verdicts
from tests.services.audited_plant import rewrite

START = datetime(2026, 3, 1, 6, tzinfo=UTC)
REPAIRED = START + timedelta(hours=2)
HALF_S = 7200.0
INTERVAL_S = 5.0

Night = Callable[[], dict]


def half(valve: object, seed: int) -> tuple[np.ndarray, np.ndarray]:
    spec = LoopSpec(
        plant=first_order(1.0, 100.0, 10.0),
        controller=Pid(1.0, 100.0, 0.0),
        valve=valve,
        load=Signal(1.0),
        noise=Signal(noise_sd=0.05),
        pv_start=50.0,
        op_start=50.0,
        op_limits=(0.0, 100.0),
    )
    loop = simulate_loop(spec, HALF_S, INTERVAL_S, seed)
    return loop.pv, loop.op


@pytest.fixture(scope="module")
def recorded() -> tuple[np.ndarray, np.ndarray]:
    """Two hours with a valve that sticks, two with one that does not."""
    halves = half(TwoParameterValve(5.0, 2.0, "he"), 1), half(LinearValve(), 2)
    return tuple(np.concatenate(parts) for parts in zip(*halves, strict=True))


@pytest.fixture
def arrives(backend: Backend, recorded, warm_kernels: None) -> Callable[[int], None]:
    """Stores the first samples; the set point is stated once, at the very first of them."""
    pv, op = recorded

    def arrive(samples: int) -> None:
        times = ns_of(START) + (np.arange(samples) * INTERVAL_S * 1e9).astype(np.int64)
        sp = np.where(np.arange(samples) == 0, 50.0, np.nan)
        with backend.database.write() as connection:
            loop_id = stored_loops.ensure(connection, ["FIC1"])["FIC1"]
            given = Samples(times, {"pv": pv[:samples], "op": op[:samples], "sp": sp})
            series.add(connection, [Stretch(loop_id, given)], None)

    return arrive


@pytest.fixture
def night(backend: Backend) -> Night:
    def audited() -> dict:
        run = audits.start_audit(backend)
        while chunks.audit_chunk(backend, int(run.id), "w"):
            pass
        return loop_verdicts.loop_health(backend, "FIC1")

    return audited


def test_from_a_repair_on_the_samples_after_it_are_judged(backend: Backend, arrives, night: Night) -> None:
    arrives(1440)
    assert night()["verdict"] == "stiction"
    arrives(2880)
    assert night()["verdict"] == "stiction"
    notes.add_note(backend, "FIC1", "packing renewed", repaired_at=REPAIRED)
    found = night()
    assert found["verdict"] == "no_stiction"
    assert found["window_start"] >= "2026-03-01T08:00:00Z"
    assert "since_repair" in found["reasons"].split(";")
    reasons = {reason["code"]: reason["text"] for reason in loop_verdicts.verdict_detail(backend, "FIC1")["reasons"]}
    assert reasons["since_repair"].startswith("judged from the repair of 2026-03-01 08:00 UTC on")
    repair = before_after.newest_repair(backend, "FIC1")
    assert (repair.before["verdict"], repair.after["verdict"]) == ("stiction", "no_stiction")


def test_until_there_are_enough_the_verdict_says_that_it_is_of_before(backend: Backend, arrives, night: Night) -> None:
    arrives(1440 + 60)
    before = night()
    notes.add_note(backend, "FIC1", "packing renewed", repaired_at=REPAIRED)
    found = night()
    assert (found["verdict"], found["window_start"]) == (before["verdict"], before["window_start"])
    assert found["reasons"].split(";")[0] == "before_repair"
    assert (before["reliability"], found["reliability"]) == ("reliable", "not_reliable")
    assert found["health"] == before["health"]
    reasons = loop_verdicts.verdict_detail(backend, "FIC1")["reasons"]
    assert reasons[0]["text"].startswith(
        "from before the repair of 2026-03-01 08:00 UTC: 60 samples since then are too few"
    )


def test_a_repair_after_the_newest_sample_is_told_too(backend: Backend, arrives, night: Night) -> None:
    arrives(1000)
    notes.add_note(backend, "FIC1", "packing renewed", repaired_at=REPAIRED)
    night()
    assert ": 0 samples since then" in loop_verdicts.verdict_detail(backend, "FIC1")["reasons"][0]["text"]


def test_a_withdrawn_repair_cuts_nothing(backend: Backend, arrives, night: Night) -> None:
    arrives(2880)
    note = notes.add_note(backend, "FIC1", "another loop was meant", repaired_at=REPAIRED)
    notes.withdraw_repair(backend, "FIC1", note.id, "me")
    found = night()
    assert found["verdict"] == "stiction"
    assert not {"since_repair", "before_repair"} & set(found["reasons"].split(";"))


def test_a_repair_before_the_window_changes_nothing(backend: Backend, arrives, night: Night) -> None:
    arrives(1440)
    notes.add_note(backend, "FIC1", "packing renewed", repaired_at=START - timedelta(days=1))
    assert not {"since_repair", "before_repair"} & set(night()["reasons"].split(";"))


def test_a_set_point_stated_before_the_repair_holds_after_it(backend: Backend, arrives, night: Night) -> None:
    arrives(2880)
    notes.add_note(backend, "FIC1", "packing renewed", repaired_at=REPAIRED)
    night()
    assert loop_verdicts.verdict_detail(backend, "FIC1")["held_since"] == {"sp": "2026-03-01T06:00:00Z"}


def fortnight(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> list[tuple]:
    """What became of the repairs, by the newest verdicts; the record of these tests is older than a fortnight."""
    monkeypatch.setattr(repaired, "LOOKED_BACK", timedelta(days=4000))
    return [
        (row.loop, row.outcome, row.before, row.now, row.reliability is not None)
        for row in repaired.repairs(backend).listed
    ]


def test_a_repair_that_helped_is_told_as_such(backend: Backend, arrives, night: Night, monkeypatch) -> None:
    arrives(1440)
    night()
    notes.add_note(backend, "FIC1", "packing renewed", repaired_at=REPAIRED)
    night()
    assert fortnight(backend, monkeypatch) == [("FIC1", "waiting", "stiction", None, False)]
    arrives(2880)
    run = night()["audit_id"]
    assert fortnight(backend, monkeypatch) == [("FIC1", "helped", "stiction", "no_stiction", True)]
    told = making.digest_of(backend, run)
    line = "FIC1, repaired 2026-03-01 08:00: helped; before: valve sticks, since: no stiction ("
    assert line in telling.as_text(told)
    assert "Repairs of the last fortnight" in telling.as_html(told)
    assert telling.as_json(told)["repairs"][0]["outcome"] == "helped"


def test_a_run_before_a_repair_was_written_down_tells_of_it_where_all_its_samples_are_later(
    backend: Backend, arrives, night: Night, monkeypatch
) -> None:
    arrives(1440)
    night()
    notes.add_note(backend, "FIC1", "packing renewed", repaired_at=START + timedelta(seconds=1))
    assert fortnight(backend, monkeypatch) == [("FIC1", "waiting", None, None, False)]
    notes.add_note(backend, "FIC1", "it was an hour before", repaired_at=START - timedelta(hours=1))
    assert fortnight(backend, monkeypatch) == [("FIC1", "sticks", None, "stiction", True)]


def test_plant_and_loop_page_part_a_record_by_what_was_judged_of_it(
    backend: Backend, arrives, night: Night, monkeypatch
) -> None:
    arrives(1440)
    night()
    begins = START + timedelta(minutes=30)
    with backend.database.write() as connection:
        connection.execute(update(verdicts).values(window_start=begins))  # what came before it was not judged
    notes.add_note(backend, "FIC1", "packing renewed", repaired_at=begins)
    assert fortnight(backend, monkeypatch) == [("FIC1", "sticks", None, "stiction", True)]
    assert before_after.newest_repair(backend, "FIC1").after["verdict"] == "stiction"
    (row,) = reliability.table(backend, 1).rows
    assert (row["of_before_repair"], headline(row)) == (False, RELIABILITY_WORDS["reliable"])
    later = datetime.now(UTC)
    notes.add_note(backend, "FIC1", "it was later", repaired_at=later)
    assert fortnight(backend, monkeypatch) == [("FIC1", "waiting", "stiction", None, False)]
    assert before_after.newest_repair(backend, "FIC1").after is None
    (row,) = reliability.table(backend, 1).rows
    assert row["next_step"] == Ask.WAIT
    assert headline(row) == "judged from before the repair; wait for newer records"
    assert rely(row) == "from before the repair"


def test_a_pv_that_died_after_its_repair_is_looked_at_today(
    backend: Backend, arrives, night: Night, monkeypatch
) -> None:
    arrives(1440)
    night()
    notes.add_note(backend, "FIC1", "packing renewed", repaired_at=START - timedelta(minutes=30))
    dead = {"verdict": "inconclusive", "reliability": "not_reliable", "likely_cause": UNANSWERED}
    with backend.database.write() as connection:
        connection.execute(update(verdicts).values(**dead))
        connection.execute(update(newest_rows).values(**dead))
    monkeypatch.setattr(repaired, "LOOKED_BACK", timedelta(days=4000))
    (row,) = repaired.repairs(backend).listed
    assert row.verdicts == "since: cannot tell (look today)"
    assert rely(row.said) == rely(loop_verdicts.loop_health(backend, "FIC1")) == "look today"
    told = compared(backend, "FIC1", before_after.newest_repair(backend, "FIC1"), None)
    assert ("Rely on it?", "–", "look today") in told


def test_a_repair_that_did_not_help_is_told_as_such(backend: Backend, arrives, night: Night, monkeypatch) -> None:
    arrives(1440)
    night()
    notes.add_note(backend, "FIC1", "packing renewed", repaired_at=START + timedelta(minutes=30))
    night()
    assert fortnight(backend, monkeypatch) == [("FIC1", "sticks", None, "stiction", True)]
    note = notes.list_notes(backend, "FIC1")[0]
    notes.withdraw_repair(backend, "FIC1", note.id, "me")
    assert fortnight(backend, monkeypatch) == []


def test_that_a_repair_did_not_help_is_said_where_one_looks(
    backend: Backend, arrives, night: Night, monkeypatch
) -> None:
    monkeypatch.setattr(repaired, "LOOKED_BACK", timedelta(days=4000))
    arrives(1440)
    night()
    sticks = {"verdict": "stiction", "reliability": "reliable", "likely_cause": "stiction"}
    notes.add_note(backend, "FIC1", "", work_order="WO-63")
    before = reliability.in_parts(backend).version
    notes.add_note(backend, "FIC1", "packing renewed", repaired_at=START + timedelta(minutes=30))
    night()
    with backend.database.write() as connection:
        connection.execute(update(verdicts).values(**sticks, reasons="", window_start=START + timedelta(minutes=30)))
        connection.execute(update(newest_rows).values(**sticks, form="of the columns"))
    again = "Repaired 2026-03-01 (WO-63), did not help: reopen the order."
    assert loop_verdicts.loop_health(backend, "FIC1")["next_step"] == again
    first = work_list(backend, listing(backend))[0]
    assert (first.loop, first.step.text) == ("FIC1", again)
    assert [one.loop for one in work_list(backend, listing(backend))] == ["FIC1"]
    sent = reliability.in_parts(backend)
    assert again.encode() in sent.as_json()
    assert sent.version != before
    report = plant_report(backend)
    assert again in report
    assert "Repairs of the last fortnight" in report
    assert again in loop_report(backend, "FIC1")
    notes.withdraw_repair(backend, "FIC1", notes.list_notes(backend, "FIC1")[0].id, "me")
    assert loop_verdicts.loop_health(backend, "FIC1")["next_step"] == Ask.STICKS


def test_what_may_not_have_helped_is_looked_at_first() -> None:
    look = Step("look", "Look.", "Look. At 00:22.")
    told = after_repair(look, "2026-11-30", "WO-63", sure=False)
    assert told.text == "Repaired 2026-11-30 (WO-63), may not have helped. Look. At 00:22."
    assert told.asks == "Repaired 2026-11-30 (WO-63), may not have helped. Look."
    assert told.code not in (look.code, after_repair(look, "2026-11-29", "WO-63", sure=False).code)
    sticks = after_repair(step_for(Ask.STICKS), "2026-11-30", None, sure=True)
    assert sticks.text == f"Repaired 2026-11-30, did not help. {Ask.STICKS}"


@pytest.mark.parametrize(
    ("before", "now", "reliable", "outcome"),
    [
        ("inconclusive", "inconclusive", False, "open"),
        ("stiction", "stiction", True, "sticks"),
        ("no_stiction", "stiction", False, "new"),
        ("stiction", "stiction", False, "doubtful"),
        ("stiction", "no_stiction", True, "helped"),
        ("stiction", "no_stiction", False, "unsure"),
        ("no_stiction", "no_stiction", True, "unmoved"),
        ("inconclusive", "no_stiction", True, "clean"),
        (None, "no_stiction", True, "clean"),
        ("stiction", "inconclusive", False, "open"),
        ("stiction", "not_auditable", False, "open"),
        ("stiction", None, False, "waiting"),
    ],
)
def test_what_a_repair_came_to(before: str | None, now: str | None, reliable: bool, outcome: str) -> None:
    assert repaired._outcome(repaired.Said(before), repaired.Said(now), reliable=reliable) == outcome


def test_a_pv_that_answers_no_more_since_its_repair_does_not_say_that_the_repair_was_in_vain() -> None:
    dead = repaired.Said("inconclusive", UNANSWERED)
    assert repaired._outcome(repaired.Said("stiction"), dead, reliable=False) == "open"
    assert repaired._outcome(dead, dead, reliable=False) == "unanswered"


def test_repairs_that_did_not_help_are_listed_first(backend: Backend, add_loops, monkeypatch) -> None:
    ids = add_loops("A", "B", "C", "D", n=150)
    run = int(audits.start_audit(backend).id)
    chunks.audit_chunk(backend, run, "w")
    said = {"A": ("no_stiction", "reliable"), "C": ("inconclusive", "not_reliable"), "D": ("stiction", "reliable")}
    for tag, (verdict, relied_on) in said.items():
        notes.add_note(backend, tag, "packing renewed", repaired_at=datetime(2025, 6, 1, tzinfo=UTC))
        told = {"verdict": verdict, "reliability": relied_on, "likely_cause": None}
        rewrite(backend, run, ids[tag], **told)
    notes.add_note(backend, "B", "packing renewed", repaired_at=datetime.now(UTC))
    listed = [(tag, outcome) for tag, outcome, *_ in fortnight(backend, monkeypatch)]
    assert listed == [("D", "sticks"), ("C", "open"), ("A", "clean"), ("B", "waiting")]


def unanswered(backend: Backend, run: str | None = None) -> None:
    """As PV does not answer OP, and nothing was judged of the record."""
    dead = {"verdict": "inconclusive", "reliability": "not_reliable", "likely_cause": UNANSWERED}
    of_run = true() if run is None else verdicts.c.audit_id == int(run)
    with backend.database.write() as connection:
        gone = {"window_start": None, "window_end": None}
        connection.execute(update(verdicts).where(of_run).values(**dead, **gone, reasons=PV_STANDS))
        connection.execute(update(newest_rows).values(**dead, form="of the columns"))


def test_a_pv_that_answers_as_little_since_its_repair_was_not_helped(
    backend: Backend, arrives, night: Night, monkeypatch
) -> None:
    arrives(1440)
    unanswered(backend, night()["audit_id"])
    assert fortnight(backend, monkeypatch) == []
    notes.add_note(backend, "FIC1", "transmitter changed", "WO-7", repaired_at=REPAIRED)
    assert fortnight(backend, monkeypatch) == [("FIC1", "waiting", "inconclusive", None, False)]
    for row in (loop_verdicts.loop_health(backend, "FIC1"), _sent(backend), reliability.table(backend, 1).rows[0]):
        assert (row["of_before_repair"], row["next_step"]) == (True, Ask.WAIT)
        assert headline(row) == "judged from before the repair; wait for newer records"
    arrives(2880)
    unanswered(backend, night()["audit_id"])
    assert fortnight(backend, monkeypatch) == [("FIC1", "unanswered", "inconclusive", "inconclusive", True)]
    (row,) = repaired.repairs(backend).listed
    assert row.words == "did not help: PV does not answer OP"
    sides = before_after.newest_repair(backend, "FIC1")
    assert (sides.before["audit_id"], sides.after["audit_id"]) == ("1", "2")
    for row in (loop_verdicts.loop_health(backend, "FIC1"), _sent(backend), reliability.table(backend, 1).rows[0]):
        assert not row["of_before_repair"]
        assert row["next_step"] == f"Repaired 2026-03-01 (WO-7), did not help. {Ask.LOOK_TODAY}"


def _sent(backend: Backend) -> dict:
    return json.loads(reliability.in_parts(backend).as_json())["rows"][0]


def test_a_repair_longer_ago_is_no_news(backend: Backend, arrives, night: Night) -> None:
    arrives(1440)
    night()
    notes.add_note(backend, "FIC1", "packing renewed", repaired_at=START)
    night()
    assert repaired.repairs(backend).listed == []
