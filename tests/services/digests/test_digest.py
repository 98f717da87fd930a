"""The nightly digest: what it says of a run, in words, as a page and as JSON."""

import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import update

from app.errors import RequestError
from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.backend import Backend
from app.services.digests import deliveries, mailing
from app.services.digests.digest import Digest
from app.services.digests.doings import Doing, doings
from app.services.digests.making import digest_of, run_to_tell
from app.services.digests.telling import as_html, as_json, as_text, subject
from app.services.plant.work_list import Work
from app.services.reports.documents import plant_report
from app.services.stating.notes import add_note, withdraw_repair
from app.services.stating.shelving import shelf
from app.services.telling.next_steps import Step
from app.storage.tables import audits, newest_rows, notes, verdicts
from tests.services.digests.conftest import HOSTILE, AddLoops

# Of words: every question that a digest asks is asked on both by the other tests.
on_one_database = pytest.mark.parametrize("settings", ["sqlite"], indirect=True)


def test_it_tells_the_worst_of_each_unit_and_what_changed(backend: Backend, night: str) -> None:
    found = digest_of(backend, night)
    assert [(area.unit, area.loops[0].loop) for area in found.areas] == [("U1", "A1"), ("U2", HOSTILE)]
    change = next(change for change in found.changes if change.loop == "A1")
    assert (change.kind, change.before) == ("new", "no_stiction")
    text = as_text(found)
    assert found.areas[0].loops[0].told == "probability 0.90, rely on it"
    assert text.index("WHAT CHANGED") < text.index("WHAT TO DO")
    assert "A1: newly said to stick (no stiction -> valve sticks)" in text
    assert "https://loops.example/loops/A1" in text
    assert subject(found).startswith("North: 2 valves stick (2 can be relied on), ")


@on_one_database
def test_a_night_that_was_caught_up_keeps_its_date(backend: Backend, night: str) -> None:
    found = digest_of(backend, night)
    caught_up = replace(found, run=replace(found.run, night="2026-01-30", created_at="2026-01-31T07:00:00Z"))
    assert subject(caught_up).endswith(" (2026-01-30)")
    assert subject(replace(caught_up, run=replace(caught_up.run, night=None))).endswith(" (2026-01-31)")


@on_one_database
def test_it_names_the_loops_that_were_not_auditable(backend: Backend, night: str, add_loops: AddLoops) -> None:
    refused = {
        "verdict": "not_auditable",
        "stiction_probability": None,
        "likely_cause": "stuck_valve_or_dead_transmitter",
    }
    named = ["A2", "B1"]
    ids = add_loops(*named)
    with backend.database.write() as connection:
        mine = (verdicts.c.audit_id == int(night), verdicts.c.loop_id.in_(ids.values()))
        connection.execute(update(verdicts).where(*mine).values(**refused))
    told = "2 not auditable: PV does not answer OP: stuck valve or dead transmitter (A2, B1)"
    found = digest_of(backend, night)
    worst = {one.loop: one for area in found.areas for one in area.loops}
    assert {worst[tag].told for tag in named} == {"look today"}
    assert found.refused_loops == {"stuck_valve_or_dead_transmitter": named}
    assert told in as_text(found)
    assert told in as_html(found)


def test_it_says_what_to_do_first_in_the_whole_plant(backend: Backend, night: str, add_loops: AddLoops) -> None:
    ids = add_loops("A1", "A2", "B1", n=0)
    dead = {
        "verdict": "not_auditable",
        "likely_cause": "stuck_valve_or_dead_transmitter",
        "reliability": "not_reliable",
    }
    unsure = {"verdict": "stiction", "reliability": "not_reliable", "likely_cause": "stiction", "health": 1.0}
    with backend.database.write() as connection:
        for tag, told in (("A1", {"health": 2.0}), ("A2", unsure), ("B1", dead)):
            mine = (verdicts.c.audit_id == int(night), verdicts.c.loop_id == ids[tag])
            connection.execute(update(verdicts).where(*mine).values(**told))
        mine = (verdicts.c.audit_id == int(night), verdicts.c.loop_id != ids["B1"])
        connection.execute(update(verdicts).where(*mine).values(likely_cause="stiction"))
        connection.execute(update(newest_rows).values(verdict="stiction", reliability="reliable"))
    add_note(backend, "A1", "ordered", "WO-17")
    found = digest_of(backend, night)
    assert [one.loop for one in found.work] == ["B1", "A1", HOSTILE, "A2"]
    text = as_text(found)
    assert "\nNot auditable, look today. Look today, at both" in text
    assert re.search(
        r"\nValve sticks, rely on it. Ask for a stroke test [^\n]+\n  - A1 \(U1\): NEW; first said on ", text
    )
    assert text.count("Ask for a stroke test in small steps") == 1
    assert "; work order WO-17; https://loops.example/loops/A1\n" in text
    assert "WO-17" in as_html(found)
    assert as_json(found)["work"][0]["step"].startswith("Look today")
    assert "<script>" not in as_html(found)
    assert subject(found).startswith("North: 3 valves stick (2 can be relied on), ")
    assert "What to do first" in plant_report(backend)


def test_a_repair_that_was_written_after_the_run_is_told_in_all_its_lists(backend: Backend, night: str) -> None:
    with backend.database.write() as connection:
        connection.execute(update(newest_rows).values(verdict="stiction", reliability="reliable"))
    add_note(backend, "A1", "packing", repaired_at=datetime.now(UTC) - timedelta(minutes=1))
    found = digest_of(backend, night)
    assert {one.loop: one.of_before_repair for area in found.areas for one in area.loops}["A1"]
    text = as_text(found)
    assert "\nValve sticks, from before the repair. Wait" in text
    assert found.areas[0].loops[0].told == "probability 0.90, from before the repair"
    assert "Valve sticks, from before the repair." in as_html(found)
    assert "evil@example.com (U2)" in text.partition("Valve sticks, rely on it.")[2]
    (row,) = re.findall(r"A1</a></td><td><span.*?</tr>", plant_report(backend))
    assert "from before the repair" in row


def test_the_digest_of_an_older_run_reads_as_of_that_run(backend: Backend, night: str) -> None:
    note = add_note(backend, "A1", "packing", "WO-17", repaired_at=datetime.now(UTC) - timedelta(minutes=1))
    older = datetime.now(UTC) - timedelta(days=3)
    with backend.database.write() as connection:
        connection.execute(update(audits).values(created_at=older, ended_at=older))
        connection.execute(update(notes).values(written_at=older - timedelta(hours=1)))
        connection.execute(update(newest_rows).values(verdict="stiction", reliability="reliable"))
    assert run_to_tell(backend) == night
    audit_chunk(backend, int(start_audit(backend).id), "test")
    assert run_to_tell(backend) != night
    known = digest_of(backend, night)
    assert {one.loop: one.of_before_repair for area in known.areas for one in area.loops}["A1"]
    withdraw_repair(backend, "A1", note.id, "me")
    for tag in ("A1", HOSTILE):
        add_note(backend, tag, "positioner", "WO-18", repaired_at=datetime.now(UTC) - timedelta(minutes=1))
    assert digest_of(backend, night) == known


def test_its_counts_add_up_once_a_loop_is_retired(backend: Backend, night: str, add_loops: AddLoops) -> None:
    assert "\n4 of 4 loops have a verdict.\n" in as_text(digest_of(backend, night))
    add_loops("A2", n=0, retired=True)
    found = digest_of(backend, night)
    assert sum(found.verdicts.values()) == 3
    assert "\n3 of 3 loops have a verdict; 1 more has been retired since.\n" in as_text(found)
    assert "3 of 3 loops have a verdict; 1 more has been retired since" in as_html(found)


@on_one_database
def test_a_prior_is_no_probability(backend: Backend, night: str, add_loops: AddLoops) -> None:
    ids = add_loops("A2", n=0)
    frozen = {"verdict": "inconclusive", "stiction_probability": 0.6, "likely_cause": "stuck_valve_or_dead_transmitter"}
    with backend.database.write() as connection:
        mine = (verdicts.c.audit_id == int(night), verdicts.c.loop_id == ids["A2"])
        connection.execute(update(verdicts).where(*mine).values(**frozen, reasons="pv_does_not_answer;prior_only"))
    assert re.search(r"\nCannot tell, look today. [^\n]+\n  - A2 ", as_text(digest_of(backend, night)))
    assert "0.60" not in as_html(digest_of(backend, night))
    assert "0.60" not in plant_report(backend)


@on_one_database
def test_what_changed_to_a_pv_that_does_not_answer_is_looked_at_today(backend: Backend, night: str) -> None:
    frozen = {
        "verdict": "inconclusive",
        "reliability": "not_reliable",
        "likely_cause": "stuck_valve_or_dead_transmitter",
    }
    with backend.database.write() as connection:
        for table in (verdicts, newest_rows):
            mine = (table.c.audit_id == int(night), table.c.loop_id == 1)
            connection.execute(update(table).where(*mine).values(**frozen))
    found = digest_of(backend, night)
    change = next(change for change in found.changes if change.now == "inconclusive")
    line = next(line for line in as_text(found).splitlines() if f"{change.loop}: " in line and "->" in line)
    assert ", look today; " in line
    assert "(look today)" in as_html(found).partition("What changed")[2].partition("<h2")[0]


@on_one_database
def test_no_probability_is_told_as_certain(backend: Backend, night: str) -> None:
    with backend.database.write() as connection:
        connection.execute(
            update(verdicts).where(verdicts.c.audit_id == int(night)).values(stiction_probability=0.9996)
        )
    found = digest_of(backend, night)
    assert re.search(r"  A1: newly said to stick .*, probability 0\.\d\d -> over 0\.99\n", as_text(found))
    assert found.areas[0].loops[0].told == "probability over 0.99, rely on it"
    assert "1.00" not in as_text(found) + as_html(found)


@on_one_database
def test_what_is_newly_said_to_stick_never_falls_off_the_lists(
    backend: Backend, night: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.services.digests.making.CHANGES", 0)
    found = digest_of(backend, night)
    new = found.new_besides
    assert "A1" in new
    assert f"  newly said to stick as well: {', '.join(' '.join(tag.split()) for tag in new)}\n" in as_text(found)
    assert subject(found).startswith(f"North: 2 valves stick (2 can be relied on), {len(new)} new (")
    steps = [Step("do", "Do it.", f"Do it. Swing {k}.", f"swing {k}") for k in range(19)]
    work = [
        Work(f"W{k}", None, "stiction", "valve sticks, rely on it", step, "", "", "") for k, step in enumerate(steps)
    ]
    (doing,) = doings(work, {"W12", "W13"})
    assert [one.loop for one in doing.loops[:3]] == ["W12", "W13", "W0"]
    assert (doing.step, doing.loops[2].facts) == ("Do it.", "swing 0")
    assert (len(doing.loops), doing.more) == (15, 4)
    (all_new,) = doings(work, {one.loop for one in work})
    assert (len(all_new.loops), all_new.more) == (19, 0)


def test_a_large_plant_is_told_how_many_are_not_listed_and_of_all_that_is_new(
    backend: Backend, night: str, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch
) -> None:
    ids = add_loops("A1", "A2", "B1", HOSTILE, n=0)
    sticks = {"verdict": "stiction", "reliability": "reliable", "likely_cause": "stiction"}
    told = {"A1": sticks | {"health": 90.0}, "A2": sticks | {"health": 2.0}, HOSTILE: sticks | {"health": 1.0}}
    told["B1"] = sticks | {"reliability": "not_reliable"}
    with backend.database.write() as connection:
        connection.execute(update(verdicts).where(verdicts.c.audit_id != int(night)).values(verdict="stiction"))
        before = (verdicts.c.audit_id != int(night), verdicts.c.loop_id == ids["A1"])
        connection.execute(update(verdicts).where(*before).values(verdict="no_stiction"))
        for tag, values in told.items():
            mine = (verdicts.c.audit_id == int(night), verdicts.c.loop_id == ids[tag])
            connection.execute(update(verdicts).where(*mine).values(**values))
    assert digest_of(backend, night).unlisted.words == ""
    monkeypatch.setattr("app.services.digests.making.ALL_WORK", 1)
    found = digest_of(backend, night)
    assert [one.loop for one in found.work] == [HOSTILE, "A1"]  # the one that weighs least is new
    assert (found.unlisted.reliable, found.unlisted.unsure, found.unlisted.unanswered) == (1, 1, 0)
    left = "valves that stick, reliable verdict (1 more), valves that stick, look first (1 more)"
    assert left in as_text(found)
    assert left in as_html(found)
    assert "A1 (U1): NEW" in as_text(found)
    assert found.more_of(Doing("stiction", "", "", [], 3)) == "and at least 3 more"
    assert found.more_of(Doing("inconclusive", "", "", [], 3)) == "and 3 more"


@on_one_database
def test_of_one_it_speaks_of_one(backend: Backend, add_loops: AddLoops) -> None:
    ids = add_loops("A1", n=600)
    run = start_audit(backend)
    audit_chunk(backend, int(run.id), "test")
    with backend.database.write() as connection:
        mine = verdicts.c.loop_id == ids["A1"]
        connection.execute(update(verdicts).where(mine).values(verdict="stiction", reliability="reliable"))
    found = digest_of(backend, run.id)
    assert " 1 valve sticks (1 can be relied on)" in subject(found)
    assert "1 of 1 loop has a verdict." in as_text(found)


def shelved_before(backend: Backend, audit_id: str, tag: str, **then: object) -> None:
    """As if the loop had been shelved on the day before the run, when what was wrong with it was another thing."""
    note = add_note(backend, tag, "until the turnaround", "WO-9", None, "anna", datetime.now(UTC) + timedelta(days=90))
    created_at = datetime.fromisoformat(digest_of(backend, audit_id).run.created_at)
    earlier = {"written_at": created_at - timedelta(days=1), **then}
    with backend.database.write() as connection:
        connection.execute(update(notes).where(notes.c.id == int(note.id)).values(**earlier))


def test_the_newest_one_knows_of_a_shelving_what_it_knows_of_its_order(backend: Backend, night: str) -> None:
    """It named the work order of a note that was written since, and left the loop on its lists."""
    in_a_week = datetime.now(UTC) + timedelta(days=7)
    with backend.database.write() as connection:
        connection.execute(update(newest_rows).values(verdict="stiction", reliability="reliable"))
    add_note(backend, "A1", "waits for the shutdown", "WO-9", shelved_until=in_a_week)
    found = digest_of(backend, night)
    assert [one.loop for one in found.shelf.listed] == [one.loop for one in shelf(backend).listed] == ["A1"]
    assert "A1" not in {one.loop for one in found.work} | {one.loop for area in found.areas for one in area.loops}
    assert "1 SHELVED" in as_text(found)
    with backend.database.write() as connection:
        long_ago = datetime.now(UTC) - timedelta(days=3)
        connection.execute(update(audits).values(created_at=long_ago, ended_at=long_ago))
    audit_chunk(backend, int(start_audit(backend).id), "test")
    assert run_to_tell(backend) != night
    older = digest_of(backend, night)
    assert older.shelf.listed == []
    assert "WO-9" not in as_text(older)


def test_it_leaves_out_what_is_shelved_and_names_it(backend: Backend, night: str) -> None:
    before = digest_of(backend, night)
    shelved_before(backend, night, "A1", shelved_as="sticks")
    shelved_before(backend, night, HOSTILE, shelved_as="sticks")
    found = digest_of(backend, night)
    assert found.verdicts == before.verdicts
    assert {loop.loop for area in found.areas for loop in area.loops}.isdisjoint({"A1", HOSTILE})
    text, html = as_text(found), as_html(found)
    until = backend.clock.short(found.shelf.listed[0].until)
    assert "2 SHELVED" in text
    assert f"  A1, shelved until {until} (work order WO-9); by anna; now: valve sticks (rely on it)" in text
    assert not [line for line in text.splitlines() if line.startswith("Bcc")]
    assert "<summary" in html
    assert "2 shelved" in html
    assert "<script>" not in html
    told = as_json(found)
    assert [one["loop"] for one in told["shelved"]] == [one.loop for one in found.shelf.listed]
    assert "shelf" not in told


@on_one_database
def test_what_got_worse_since_it_was_shelved_is_listed_all_the_same(backend: Backend, night: str) -> None:
    shelved_before(backend, night, "A1", shelved_as="")
    found = digest_of(backend, night)
    first = found.areas[0].loops[0]
    words = "(work order WO-9), but by now the valve sticks, and that can be relied on"
    assert first.loop == "A1"
    assert first.shelved.endswith(words)
    assert first.shelved in as_text(found)
    assert first.shelved in as_html(found)
    assert "1 SHELVED, 1 OF THEM LISTED ALL THE SAME" in as_text(found)


@on_one_database
def test_without_any_other_loop_that_sticks_it_says_other(backend: Backend, night: str, add_loops: AddLoops) -> None:
    refused = {"verdict": "not_auditable", "likely_cause": "data"}
    others = list(add_loops("A2", "B1").values())
    with backend.database.write() as connection:
        connection.execute(
            update(verdicts).where(verdicts.c.audit_id == int(night), verdicts.c.loop_id.in_(others)).values(**refused)
        )
    for tag in ("A1", HOSTILE):
        shelved_before(backend, night, tag, shelved_as="sticks")
    shelved_before(backend, night, "A2")
    assert "No other valve sticks, as far as the records tell." in as_text(digest_of(backend, night))
    assert "2 not auditable: too little usable data (B1, ...)" in as_text(digest_of(backend, night))
    shelved_before(backend, night, "B1")
    assert "2 not auditable: too little usable data (shelved)" in as_text(digest_of(backend, night))


@on_one_database
def test_a_later_run_changes_nothing_of_it(backend: Backend, night: str) -> None:
    before = digest_of(backend, night)
    audit_chunk(backend, int(start_audit(backend).id), "test")
    assert digest_of(backend, night) == before
    assert run_to_tell(backend) == night


@on_one_database
def test_what_a_plant_is_called_stays_text(backend: Backend, night: str) -> None:
    found = digest_of(backend, night)
    assert "<script>" not in as_html(found)
    assert "&lt;script&gt;" in as_html(found)
    hostile = Digest(**(vars(found) | {"plant": HOSTILE}))
    mail = mailing.message(backend.settings, deliveries.mail_of(hostile, "mailto:you@example.com"), "you@example.com")
    head = mail.as_bytes().partition(b"\r\n\r\n")[0]
    assert b"\nBcc" not in head
    assert mail["To"] == "you@example.com"
    assert not [line for line in as_text(hostile).splitlines() if line.startswith("Bcc")]


@on_one_database
def test_numbers_are_written_as_the_pages_write_them(backend: Backend, night: str) -> None:
    found = digest_of(backend, night)
    run = replace(found.run, total=14_003, done=14_001, failed=1_002)
    verdicts = {"stiction": 3_000, "no_stiction": 10_001}
    refused = {"data": 1_200}
    many = replace(found, run=run, verdicts=verdicts, reliable=2_000, refused=refused, retired=1_001)
    text, html = as_text(many), as_html(many)
    assert "3,000 valves stick (2,000 can be relied on)" in subject(many)
    for told in (text, html):
        assert "13,000 of 13,002 loops have a verdict; 1,001 more have been retired since" in told
        assert "1,200 not auditable: too little usable data" in told
        assert "10,001" in told
    assert "   3,000 valve sticks" in text
    assert "   1,002 failed" in text
    assert not re.search(r"(?<![-\d])(3000|2000|10001|1200|1002|13000)(?![-\d])", f"{subject(many)}\n{text}\n{html}")


def test_a_run_that_goes_on_has_none(backend: Backend, add_loops: AddLoops) -> None:
    with pytest.raises(RequestError, match="no audit has ended"):
        run_to_tell(backend)
    add_loops("A")
    with pytest.raises(RequestError, match="has not ended"):
        digest_of(backend, start_audit(backend).id)
