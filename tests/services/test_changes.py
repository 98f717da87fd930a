"""What changed in the plant, and why."""

from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import update

from app.services.auditing.audits import LoopFilter, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.nightly import nightly
from app.services.backend import Backend
from app.services.digests.making import digest_of, run_to_tell
from app.services.digests.telling import as_text
from app.services.moments import UTC_CLOCK
from app.services.plant import changes, worst
from app.services.plant.listing import listing
from app.services.plant.loop_verdicts import loop_health
from app.services.telling.wording import headline, probability
from app.storage import changes as stored
from app.storage.changes import ChangedRow, SecondNight
from app.storage.tables import audits, newest_rows
from tests.services.audited_plant import AddLoops, audited, rewrite, rewrite_newest
from tests.services.conftest import START_NS


def test_a_first_run_is_no_news(backend: Backend, add_loops: AddLoops) -> None:
    assert changes.changes(backend).run_id is None
    add_loops("A")
    audited(backend)
    assert changes.changes(backend).rows == []


def test_nothing_changed(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    assert changes.changes(backend).rows == []


@pytest.mark.parametrize(
    ("before", "why", "because"),
    [
        ({"stiction_probability": None}, "loop", "what was seen differs a little from the previous record"),
        ({"engine_version": "0.0.1"}, "method", "the method changed (engine or settings)"),
        ({"config_fingerprint": "other"}, "method", "the method changed (engine or settings)"),
        ({"samples": 100}, "data", "more data than before"),
        ({"samples": 100_000}, "data", "the record changed (gaps, length or sampling)"),
        ({"sampling_interval_s": 1.0}, "data", "the record changed (gaps, length or sampling)"),
    ],
)
def test_a_changed_verdict_says_why(
    backend: Backend, two_runs: tuple[dict[str, int], int], before: dict[str, object], why: str, because: str
) -> None:
    ids, first = two_runs
    rewrite(backend, first + 1, ids["B"], reliability="reliable")
    now = loop_health(backend, "B")["verdict"]
    other = "no_stiction" if now == "stiction" else "stiction"
    rewrite(backend, first, ids["B"], verdict=other, **before)
    (change,) = changes.changes(backend).rows
    assert (change.loop, change.before, change.now, change.why, change.because) == ("B", other, now, why, because)
    assert change.kind == ("new" if now == "stiction" else "cured" if now == "no_stiction" else "flipped")
    assert not change.weakly


@pytest.mark.parametrize(
    ("reliability", "probability", "weakly"),
    [
        ("not_reliable", 0.55, True),
        ("not_reliable", 0.9, False),
        ("reliable", 0.55, False),
    ],
)
def test_what_could_as_well_be_the_other_verdict_says_so_where_it_changed(
    backend: Backend, two_runs: tuple[dict[str, int], int], reliability: str, probability: float, weakly: bool
) -> None:
    ids, first = two_runs
    rewrite(backend, first, ids["B"], verdict="no_stiction")
    said = {"verdict": "stiction", "reliability": reliability, "stiction_probability": probability}
    rewrite(backend, first + 1, ids["B"], **said)
    rewrite_newest(backend, ids["B"], **said)
    (change,) = changes.changes(backend).rows
    assert (change.now, change.weakly) == ("stiction", weakly)


@pytest.mark.parametrize(
    ("now", "before", "kind"),
    [
        ({"stiction_probability": 0.55}, {"stiction_probability": 0.27}, "wavers"),
        ({"stiction_probability": 0.55}, {"stiction_probability": 0.2}, "new"),
        ({"stiction_probability": 0.55, "reliability": "reliable"}, {"stiction_probability": 0.5}, "new"),
        ({"stiction_probability": 0.55, "reasons": "stiction_began"}, {"stiction_probability": 0.5}, "new"),
        ({"stiction_probability": 0.55}, {"stiction_probability": 0.5, "engine_version": "0.0.1"}, "new"),
    ],
)
def test_a_loop_on_the_edge_wavers_and_is_no_news(
    backend: Backend,
    two_runs: tuple[dict[str, int], int],
    now: dict[str, object],
    before: dict[str, object],
    kind: str,
) -> None:
    ids, first = two_runs
    for tag in ("B", "C"):
        sticks = {"verdict": "stiction", "reliability": "not_reliable", "reasons": "shape_x", **now}
        rewrite(backend, first + 1, ids[tag], **sticks)
        rewrite_newest(backend, ids[tag], verdict="stiction", health=10.0 if tag == "B" else 50.0)
        rewrite(backend, first, ids[tag], **{"verdict": "no_stiction", "reasons": "shape_x", **before})
    rewrite(backend, first + 1, ids["C"], reliability="reliable")
    told = [(change.loop, change.kind) for change in changes.changes(backend).rows]
    assert told == ([("C", "new"), ("B", "wavers")] if kind == "wavers" else [("B", "new"), ("C", "new")])


def test_valves_that_are_newly_said_to_stick_are_told_before_worse_loops(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    ids, first = two_runs
    second = int(loop_health(backend, "B")["audit_id"])
    worse = (("C", "inconclusive", "stiction", 5.0), ("D", "inconclusive", "stiction", 4.0))
    for tag, now, was, health in (("B", "stiction", "no_stiction", 60.0), *worse):
        rewrite(backend, second, ids[tag], verdict=now, reliability="reliable", health=health)
        rewrite_newest(backend, ids[tag], verdict=now, reliability="reliable", health=health)
        rewrite(backend, first, ids[tag], verdict=was)
    assert [change.loop for change in changes.changes(backend).rows] == ["B", "D", "C"]
    told = changes.changes(backend, 1)
    assert ([change.loop for change in told.rows], told.more) == (["B"], True)
    assert not changes.changes(backend, 3).more


def test_what_wavered_is_news_where_it_stands_for_a_second_night(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    ids, first = two_runs
    third = audited(backend)
    for tag, before in (("B", 0.4), ("C", 0.1)):
        rewrite(backend, third, ids[tag], input_end_ns=START_NS + 3)
        rewrite(backend, first + 1, ids[tag], input_end_ns=START_NS + 2)
        rewrite(backend, first, ids[tag], input_end_ns=START_NS + 1)
        told = {"reliability": "not_reliable", "reasons": "shape_x", "stiction_probability": 0.55}
        rewrite(backend, third, ids[tag], verdict="stiction", **told)
        rewrite_newest(backend, ids[tag], verdict="stiction")
        rewrite(backend, first + 1, ids[tag], verdict="stiction", **told)
        rewrite(backend, first, ids[tag], **told | {"verdict": "no_stiction", "stiction_probability": before})
    (change,) = changes.changes(backend).rows
    assert (change.loop, change.kind, change.before) == ("B", "new", "no_stiction"), "C was news the night before"
    assert change.because == "said for the second night; probability 0.40 -> 0.55"
    told = digest_of(backend, str(third))
    assert [(one.loop, one.kind) for one in told.changes] == [("B", "new")]
    fourth = audited(backend)
    assert [row.loop for row in changes.changes(backend).rows if row.kind == "new" and row.loop == "C"] == []
    sticks = {"verdict": "stiction", "reliability": "not_reliable", "reasons": "shape_x", "stiction_probability": 0.55}
    rewrite(backend, fourth, ids["B"], input_end_ns=START_NS + 4, **sticks)
    assert "B" not in [one.loop for one in digest_of(backend, str(fourth)).changes], "it is the third night"
    rewrite(backend, third, ids["B"], input_end_ns=START_NS + 2)
    assert "B" not in [one.loop for one in digest_of(backend, str(third)).changes], (
        "nothing was recorded for a second night"
    )
    rewrite_newest(backend, ids["B"], verdict="stiction", verdict_before="stiction")
    assert ("B", "new") in [(one.loop, one.kind) for one in digest_of(backend, str(fourth)).changes]


def test_a_second_night_is_told_across_a_stop_of_the_plant(
    backend: Backend, two_runs: tuple[dict[str, int], int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """After the first one nothing was recorded for four nights. Where nothing is recorded after the second one either,
    it is told as long as that one is looked back to."""
    ids, before = two_runs
    nights = [before + 1, *(audited(backend) for _ in range(5))]
    told = {"reliability": "not_reliable", "reasons": "shape_x", "stiction_probability": 0.55}
    ground = told | {"verdict": "no_stiction", "stiction_probability": 0.4}
    rewrite(backend, before, ids["B"], input_end_ns=START_NS, **ground)
    for night in nights[:-1]:
        rewrite(backend, night, ids["B"], input_end_ns=START_NS + 1, verdict="stiction", **told)

    def known(run: int, looked_back: int, further_back: int) -> list[str]:
        rewrite(backend, run, ids["B"], input_end_ns=START_NS + 2, verdict="stiction", **told)
        rewrite_newest(backend, ids["B"], verdict="stiction")
        monkeypatch.setattr(stored, "LOOKED_BACK", looked_back)
        monkeypatch.setattr(stored, "FURTHER_BACK", further_back)
        shown = [one.loop for one in changes.changes(backend).rows]
        assert [one.loop for one in digest_of(backend, str(run)).changes] == shown
        return shown

    assert known(nights[-1], stored.LOOKED_BACK, stored.FURTHER_BACK) == ["B"]
    assert known(nights[-1], 1, 5) == ["B"]
    assert known(nights[-1], 1, 4) == [], "the verdict of the ground is the fifth before the first night's last"
    without_samples = audited(backend)
    assert known(without_samples, 2, 5) == ["B"]
    assert known(without_samples, 1, 5) == []


def test_a_changed_verdict_names_the_evidence_that_moved_most(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    """As data where it was stored so; of an older release out of its sentences."""
    ids, first = two_runs
    second = int(loop_health(backend, "B")["audit_id"])
    rewrite_newest(backend, ids["B"], verdict="stiction")
    reasons = {"reasons": "shape_op_triangle;shape_flat_eighth;few_cycles"}
    now = "OP runs in triangles. 60 % of the travel of OP finds PV standing still. few"
    older = {"extra_json": "{}"}
    called = {"verdict": "stiction", "stiction_probability": 0.99, "reasons_text": now}
    rewrite(backend, second, ids["B"], **called, **reasons, **older)
    rewrite_newest(backend, ids["B"], verdict="stiction")
    then = "PV hardly ever stands still while OP travels (8 %)"
    before = {"verdict": "no_stiction", "stiction_probability": 0.1, "samples": 100}
    rewrite(backend, first, ids["B"], **before, reasons="shape_flat_eighth", reasons_text=then, **older)
    (change,) = changes.changes(backend).rows
    seen = "60 % of the travel of OP finds PV standing still (8 % before), probability 0.10 -> 0.99"
    assert change.because == f"{seen}; more data than before"
    measured = '{"measured":{"shape_op_triangle":[0.4,"<",0.6],"shape_flat_eighth":[0.55,">",0.2]}}'
    rewrite(backend, second, ids["B"], extra_json=measured)
    seen = "PV stands still during 55 % of OP's travel (8 % before), probability 0.10 -> 0.99"
    assert changes.changes(backend).rows[0].because == f"{seen}; more data than before"
    rewrite(backend, first, ids["B"], stiction_probability=0.0004)
    rewrite(backend, second, ids["B"], stiction_probability=0.9996)
    assert "probability under 0.01 -> over 0.99; " in changes.changes(backend).rows[0].because
    rewrite(backend, second, ids["B"], stiction_probability=0.99)
    rewrite(backend, first, ids["B"], stiction_probability=0.95)
    assert changes.changes(backend).rows[0].because == "more data than before"
    rewrite(backend, first, ids["B"], stiction_probability=0.1, reasons="few_cycles", reasons_text="few")
    assert (
        changes.changes(backend)
        .rows[0]
        .because.startswith("OP is close to a triangle wave, probability 0.10 -> 0.99; ")
    )


@pytest.mark.parametrize(
    ("code", "comes", "goes"),
    [
        ("wound_up", "OP stays at its limit, and PV does not come back", "OP is no longer at its limit"),
        ("uncoupled", "PV and OP are unrelated", "PV and OP are related again"),
    ],
)
def test_what_left_no_probability_to_decide_by_is_why_a_verdict_cannot_tell(
    backend: Backend, two_runs: tuple[dict[str, int], int], code: str, comes: str, goes: str
) -> None:
    """Of a probability that fell as well nobody would understand it."""
    ids, first = two_runs
    free = {"verdict": "no_stiction", "reasons": "shape_x", "stiction_probability": 0.13}
    undecided = {"verdict": "inconclusive", "reasons": f"{code};shape_x", "stiction_probability": 0.01}
    for tag, before, now in (("B", free, undecided), ("C", undecided, free)):
        rewrite(backend, first, ids[tag], **before)
        rewrite(backend, first + 1, ids[tag], **now, reliability="not_reliable")
        rewrite_newest(backend, ids[tag], verdict=now["verdict"])
    told = {row.loop: (row.kind, row.because) for row in changes.changes(backend).rows}
    assert told == {"B": ("flipped", comes), "C": ("flipped", goes)}


def test_a_pv_that_does_not_answer_is_looked_at_today_and_news_of_it_first(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    ids, first = two_runs
    second = int(loop_health(backend, "B")["audit_id"])
    dead = {"verdict": "not_auditable", "likely_cause": "stuck_valve_or_dead_transmitter"}
    for tag in ("B", "C"):
        rewrite(backend, second, ids[tag], **dead)
        rewrite_newest(backend, ids[tag], **dead)
    rewrite(backend, first, ids["B"], **dead)
    (change,) = [change for change in changes.changes(backend).rows if change.loop == "C"]
    assert change.because == "cannot be audited now: PV does not answer OP: stuck valve or dead transmitter"
    rewrite(backend, second, ids["C"], verdict="inconclusive")
    rewrite_newest(backend, ids["C"], verdict="inconclusive")
    rewrite(backend, first, ids["C"], **dead)
    assert [change for change in changes.changes(backend).rows if change.loop == "C"] == []
    assert [change for change in digest_of(backend, run_to_tell(backend)).changes if change.loop == "C"] == []
    rewrite(backend, first, ids["C"], verdict="no_stiction", likely_cause=None, samples=100)
    (change,) = [change for change in changes.changes(backend).rows if change.loop == "C"]
    assert change.because == "PV does not answer OP: stuck valve or dead transmitter"
    today = worst.look_today(backend, listing(backend), changes.changes(backend))
    assert [row["loop"] for row in today] == ["C", "B"]
    assert all(headline(row) == "a stuck valve or a dead transmitter; look today" for row in today)
    assert {row["loop"] for row in worst.worst(backend, listing(backend), beside={"B", "C"})} == {"A", "D"}


def test_a_valve_that_began_to_stick_is_why_though_more_was_recorded(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    ids, first = two_runs
    second = loop_health(backend, "B")["audit_id"]
    rewrite(backend, first, ids["B"], verdict="not said", samples=100)
    rewrite(backend, int(second), ids["B"], reasons="stiction_began;stretches")
    (change,) = changes.changes(backend).rows
    assert (change.why, change.because) == ("loop", "began to stick within the record")


def test_what_a_night_changed_is_news_though_somebody_audits_again(backend: Backend, add_loops: AddLoops) -> None:
    ids = add_loops("A", "B", n=600)
    first = audited(backend)
    run = nightly(backend)
    assert run is not None
    audit_chunk(backend, int(run.id), "test")
    now = loop_health(backend, "B")["verdict"]
    other = "no_stiction" if now == "stiction" else "stiction"
    rewrite(backend, first, ids["B"], verdict=other)
    again = start_audit(backend, trigger="nightly")  # `loopaudit nightly` once the night's run has ended
    audit_chunk(backend, int(again.id), "test")
    told = changes.changes(backend)
    assert told.run_id == run.id
    assert [(change.loop, change.before, change.now) for change in told.rows] == [("B", other, now)]


def test_what_came_since_the_first_run_is_news(backend: Backend, add_loops: AddLoops) -> None:
    ids = add_loops("A", "B", n=600)
    first = int(nightly(backend).id)
    audit_chunk(backend, first, "test")
    assert not changes.changes(backend).compared
    assert run_to_tell(backend) == str(first)
    now = loop_health(backend, "B")["verdict"]
    other = "no_stiction" if now == "stiction" else "stiction"
    rewrite(backend, first, ids["B"], verdict=other)
    rewrite_newest(backend, ids["B"], verdict=other)
    again = start_audit(backend, trigger="nightly")  # the second of this date
    audit_chunk(backend, int(again.id), "test")
    told = changes.changes(backend)
    assert (told.run_id, told.first, told.compared) == (str(first), True, True)
    assert [(change.loop, change.before, change.now) for change in told.rows] == [("B", other, now)]
    assert run_to_tell(backend) == again.id
    assert f"run {again.id}, " in as_text(digest_of(backend, again.id)).splitlines()[0]


def test_what_is_started_days_after_the_last_night_takes_its_place(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", "B", "C")
    run = nightly(backend)
    assert run is not None
    audit_chunk(backend, int(run.id), "test")
    asked_for = audited(backend)
    of_one = start_audit(backend, LoopFilter(tags=("A",)))
    audit_chunk(backend, int(of_one.id), "test")
    assert changes.changes(backend).run_id == run.id
    with backend.database.write() as connection:
        days_ago = datetime.now(UTC) - timedelta(days=3)
        connection.execute(update(audits).where(audits.c.id == int(run.id)).values(created_at=days_ago))
    assert changes.changes(backend).run_id == str(asked_for)


@pytest.mark.parametrize(
    ("now", "before", "why", "because"),
    [
        (
            {"verdict": "not_auditable", "likely_cause": "op_at_limits"},
            {},
            "auditable",
            "cannot be audited now: OP at its limit",
        ),
        ({}, {"verdict": "not_auditable", "likely_cause": None}, "auditable",
         "could not be audited before: too little usable data"),
        ({"reasons": "since_repair;shape_x"}, {"verdict": "stiction", "samples": 9000}, "repair",
         "a repair was stated"),
        ({"reasons": "since_repair"}, {"verdict": "stiction", "reasons": "since_repair"}, "loop",
         "probability {before} -> {now}"),
    ],
)  # fmt: skip
def test_a_change_of_what_can_be_audited_names_the_cause(
    backend: Backend,
    two_runs: tuple[dict[str, int], int],
    now: dict[str, object],
    before: dict[str, object],
    why: str,
    because: str,
) -> None:
    ids, first = two_runs
    newest = {"verdict": "no_stiction", **now}
    rewrite(backend, first + 1, ids["B"], **newest)
    rewrite(backend, first, ids["B"], **{"verdict": "no_stiction", **before})
    with backend.database.write() as connection:
        row = newest_rows.c.loop_id == ids["B"]
        connection.execute(update(newest_rows).where(row).values(verdict=newest["verdict"]))
    found = {change.loop: change for change in changes.changes(backend).rows}
    measured = probability(loop_health(backend, "B")["stiction_probability"])
    told = because.format(before=measured, now=measured)
    assert (found["B"].why, found["B"].because) == (why, told)


def turned(**told: object) -> ChangedRow:
    """A loop whose verdict has become another one, of a record like that of before."""
    edge: dict[str, object] = dict.fromkeys(ChangedRow._fields[:-4])
    edge |= {"tag": "A", "verdict_before": "no_stiction", "verdict": "stiction", "reliability": "not_reliable"}
    edge |= {"reasons": "shape_x", "reasons_before": "shape_x", "probability": 0.55, "probability_before": 0.5}
    edge |= {"engine_changed": False, "config_changed": False}
    return ChangedRow(**edge | {"filled_more": 0.0, "samples_ratio": 1.0, "interval_ratio": 1.0} | told)


RECORD_CHANGED = "the record changed (gaps, length or sampling)"


@pytest.mark.parametrize(
    ("told", "because"),
    [
        ({"filled_more": 0.06}, RECORD_CHANGED),
        ({"filled_more": 0.04}, ""),
        ({"samples_ratio": 0.79}, RECORD_CHANGED),
        ({"samples_ratio": 0.81}, ""),
        ({"samples_ratio": 1.26}, "more data than before"),
        ({"samples_ratio": 1.24}, ""),
        ({"interval_ratio": 1.02}, RECORD_CHANGED),
        ({"interval_ratio": 1.005}, ""),
    ],
)
def test_how_far_a_record_must_differ_to_be_why(told: dict[str, float], because: str) -> None:
    change = changes.change_of(turned(**told, probability=None), UTC_CLOCK)
    loop = "what was seen differs a little from the previous record"
    assert (change.why, change.because) == (("data", because) if because else ("loop", loop))


def test_a_pv_that_answers_no_more_is_news_though_its_probability_has_not_moved() -> None:
    told = {"verdict": "inconclusive", "likely_cause": "stuck_valve_or_dead_transmitter"}
    assert changes.kind_of(turned(**told)) == "flipped"
    assert changes.kind_of(turned(verdict="inconclusive")) == "wavers"


def test_of_a_loop_that_changed_since_the_second_night_the_change_alone_is_told() -> None:
    night = SecondNight(turned(), 0.55)
    assert [one.loop for one in changes.second_night([night], [], UTC_CLOCK)] == ["A"]
    assert changes.second_night([night], [turned(verdict="no_stiction")], UTC_CLOCK) == []


def test_another_verdict_without_a_known_cause_is_news_though_neither_judges(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    ids, first = two_runs
    rewrite(backend, first, ids["B"], verdict="inconclusive", likely_cause=None)
    now = {"verdict": "not_auditable", "likely_cause": None}
    rewrite(backend, first + 1, ids["B"], **now)
    rewrite_newest(backend, ids["B"], **now)
    assert [change.loop for change in changes.changes(backend).rows] == ["B"]
    assert [change.loop for change in digest_of(backend, str(first + 1)).changes] == ["B"]
