"""Since when the same was said of a loop, and how large its stiction is, in a line of the list of work."""

import pytest
from sqlalchemy import update

from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.moments import UTC_CLOCK
from app.services.plant import work_list
from app.services.plant.listing import listing
from app.services.plant.nights import NIGHTS, Night, Onset, onsets
from app.services.plant.repaired import Repairs, RepairView
from app.services.plant.work_list import _since, _size
from app.services.telling.wording import UNANSWERED
from app.storage.tables import verdicts
from tests.services.audited_plant import audited, rewrite, rewrite_newest


def row(verdict="stiction", **told):
    row = {"verdict": verdict, "likely_cause": verdict, "reasons": "", "episode_start": None}
    row |= {"repaired_at": None, "of_before_repair": False}
    return row | {"stiction_S": None, "stiction_S_pct_of_span": None} | told


def said(*verdicts, first=1):
    """From the loop's first night on; first: its date in March, if that is another."""
    return [
        Night(f"2026-03-{day:02d}", verdict, "reliable", is_first=day == first)
        for day, verdict in enumerate(verdicts, 1)
    ]


@pytest.mark.parametrize(
    ("loop", "last", "since"),
    [
        (row(), said("no_stiction", "stiction", "stiction"), "first said on 2026-03-02"),
        (row(), said(*["stiction"] * NIGHTS, first=0), "first said on 2026-03-01 or before"),
        (row(), said(*["stiction"] * NIGHTS), "said since its first night, 2026-03-01"),
        (row(), said("stiction", "stiction", first=0), "first said on 2026-03-01 or before"),
        (row(), said("stiction"), "said since its first night, 2026-03-01"),
        (row(), said("stiction", "stiction"), "said since its first night, 2026-03-01"),
        (row(), (), ""),
        (
            row(reasons="stiction_began", episode_start="2026-03-05T04:30:00Z"),
            said("stiction"),
            "since 2026-03-05 04:30",
        ),
        (
            row("not_auditable", likely_cause="stuck_valve_or_dead_transmitter"),
            said("no_stiction", "inconclusive", "not_auditable"),
            "first said on 2026-03-02",
        ),
        (
            row(
                "inconclusive",
                likely_cause="stuck_valve_or_dead_transmitter",
                unanswered_since="2026-03-02T14:10:00Z",
            ),
            said("no_stiction", "inconclusive"),
            "since 2026-03-02 14:10",
        ),
        (
            row(
                "inconclusive",
                likely_cause="stuck_valve_or_dead_transmitter",
                unanswered_since="1970-01-01T02:00:00Z",
            ),
            said("no_stiction", "inconclusive"),
            "first said on 2026-03-02",
        ),
        (
            row(repaired_at="2026-03-03T08:00:00Z"),
            said("no_stiction", *["stiction"] * 3),
            "first said on 2026-03-02, still after the repair of 2026-03-03",
        ),
        (row(repaired_at="2026-03-01T08:00:00Z"), said("no_stiction", "stiction"), "first said on 2026-03-02"),
        (
            row(repaired_at="2026-03-03T08:00:00Z", of_before_repair=True),
            said("stiction"),
            "said since its first night, 2026-03-01",
        ),
    ],
)
def test_since_when(loop, last, since):
    assert _since(loop, last, UTC_CLOCK) == since


def test_a_size_is_told_of_a_valve_that_sticks_where_it_is_known():
    assert _size(row()) == ""
    assert _size(row(stiction_S=2.468)) == "S 2.47 units of OP"
    assert _size(row(stiction_S=2.468, stiction_S_pct_of_span=4.94)) == "S 4.9 % of OP's span"
    assert _size(row("inconclusive", stiction_S=2.468)) == ""


@pytest.mark.parametrize(
    ("onset", "last", "since"),
    [
        (Onset("2026-03-01T00:22:00Z", True, False), said(*["stiction"] * 3), "since 2026-03-01 00:22"),
        (Onset("2026-02-20T02:00:00Z", False, False), said(*["stiction"] * NIGHTS), "first said on 2026-02-20"),
        (
            Onset("2026-02-20T02:00:00Z", False, True),
            said(*["stiction"] * NIGHTS),
            "said since its first night, 2026-02-20",
        ),
        (
            Onset("2026-03-02T02:00:00Z", False, True),
            said("stiction", "stiction"),
            "said since its first night, 2026-03-01",
        ),
    ],
)
def test_of_a_valve_that_sticks_without_a_break_the_first_onset_holds(onset, last, since):
    later = row(reasons="stiction_began", episode_start="2026-03-05T04:30:00Z")
    assert _since(later, last, UTC_CLOCK, onset) == _since(row(), last, UTC_CLOCK, onset) == since


def test_the_onset_is_that_of_the_first_verdict_after_another_one(backend, add_loops):
    ids = add_loops("A", "B", n=150)
    for _ in range(4):
        run = start_audit(backend)
        audit_chunk(backend, int(run.id), "test")
    said_of_a = {1: ("stiction", "00:01"), 2: ("no_stiction", None), 3: ("stiction", "00:22"), 4: ("stiction", "00:20")}
    with backend.database.write() as connection:
        for number, (verdict, at) in said_of_a.items():
            told = {"verdict": verdict, "reasons": "stiction_began" if at else ""}
            told["extra_json"] = f'{{"episode_start":"2026-03-0{number}T{at}:00Z"}}'
            mine = (verdicts.c.loop_id == ids["A"], verdicts.c.audit_id == number)
            connection.execute(update(verdicts).where(*mine).values(**told))
        connection.execute(update(verdicts).where(verdicts.c.loop_id == ids["B"]).values(verdict="no_stiction"))
    assert onsets(backend, ["A", "B"]) == {"A": Onset("2026-03-03T00:22:00Z", True, False)}
    assert onsets(backend, ["A"], until=1) == {"A": Onset("2026-03-01T00:01:00Z", True, True)}


def listed(backend, most):
    return [one.loop for one in work_list.work_list(backend, listing(backend), most)]


def said_of(backend, ids, run, told):
    for tag, values in told.items():
        for write in (rewrite_newest, lambda backend, loop, **values: rewrite(backend, run, loop, **values)):
            write(backend, ids[tag], **values)


@pytest.fixture
def sticking(backend, add_loops):
    """A, B and C stick, to be relied on, and the first is the worst: their ids and run."""
    ids, run = add_loops("A", "B", "C", n=150), audited(backend)
    sticks = {"verdict": "stiction", "reliability": "reliable"}
    said_of(backend, ids, run, {tag: sticks | {"health": 10.0 * k} for k, tag in enumerate("ABC", 1)})
    return ids, run


def test_what_a_repair_did_not_help_stands_first_and_takes_no_place_from_the_others(backend, sticking, monkeypatch):
    failed = RepairView("A", None, "2026-03-01T00:00:00Z", "sticks", "stiction", "stiction", "reliable")
    monkeypatch.setattr(work_list, "repairs", lambda *_: Repairs([failed], more=False))
    assert listed(backend, 2) == ["A", "B"]
    assert listed(backend, 3) == ["A", "B", "C"]


def test_what_wants_a_look_today_begins_with_the_newest_and_leaves_room(backend, sticking, add_loops, monkeypatch):
    monkeypatch.setattr(work_list, "MOST_TODAY", 2)
    ids = add_loops("D", "E", "F", n=150)
    run = audited(backend)
    dead = {"verdict": "not_auditable", "likely_cause": UNANSWERED, "reliability": "not_reliable"}
    for tag, day in {"D": 1, "E": 3, "F": 2}.items():
        since = f'{{"unanswered_since":"2026-03-0{day}T00:00:00Z"}}'
        said_of(backend, ids, run, {tag: dead})
        rewrite(backend, run, ids[tag], extra_json=since)
    sticks = {"verdict": "stiction", "reliability": "reliable"}
    said_of(backend, sticking[0], run, {tag: sticks | {"health": 10.0 * k} for k, tag in enumerate("ABC", 1)})
    assert listed(backend, 4) == ["E", "F", "A", "B"]
