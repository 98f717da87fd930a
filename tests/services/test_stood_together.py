"""Loops whose PV came to stand at the same time are told of together: a unit that is down, or a card that failed, is
one thing to look at, and a transmitter that died by itself is another."""

import json
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest
from sqlalchemy import select, update

from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.unanswered import of_lines, of_plant
from app.services.backend import Backend
from app.services.digests.digest import Digest
from app.services.digests.making import digest_of
from app.services.digests.telling import as_html, as_json, as_text
from app.services.loops import find
from app.services.plant.changes import changes
from app.services.plant.listing import listing
from app.services.plant.loop_sheet import loop_sheet
from app.services.plant.loop_verdicts import loop_health, verdict_detail
from app.services.plant.reliability import in_parts
from app.services.plant.stood_together import _listed_alike, as_one
from app.services.plant.work_list import Work, work_list
from app.services.plant.worst import listed_first, look_today, worst_tags
from app.services.reports.documents import loop_report, plant_report
from app.services.stating import notes
from app.services.stating.properties import patch_loop
from app.services.telling.next_steps import Ask
from app.services.telling.wording import UNANSWERED
from app.storage.audits import LoopFilter
from app.storage.tables import newest_rows, verdicts
from app.storage.unanswered import StoodRow, unanswered
from tests.services.audited_plant import rewrite, rewrite_newest
from tests.services.kept_rows import made_once
from tests.services.standing_plant import SAMPLES, later, stored
from tests.services.upkeep_plant import with_settings
from tests.table_rows import table_page

DOWN = ("D0", "D1", "D2", "D3")
DAY = 1440
SINCE = "2025-06-16T06:06:40Z"
WORDS = "PV of 4 loops froze within 15 minutes, all of U1"


def audited(backend: Backend, wanted: LoopFilter | None = None) -> int:
    """To its end: one call leaves loops to the next where its time is over, as on a machine that has much to do."""
    run = int(start_audit(backend, wanted).id)
    while audit_chunk(backend, run, "test"):
        pass
    return run


def night_after(plant: Backend, nights: int, adds: bool = True) -> Backend:
    """With records of as long as the first, each from where that before it ended, and windows of one of them."""
    if adds:
        later(plant, {**dict.fromkeys(DOWN, 900), "X1": 400, "R1": None}, nights * SAMPLES)
    return with_settings(plant, window_samples=SAMPLES)


def rows_of(backend: Backend) -> dict[str, dict[str, Any]]:
    return {row["loop"]: row for row in table_page(backend).rows}


def today(backend: Backend) -> list[tuple[str, ...]]:
    """The entries of the list to look at today."""
    rows, _ = listed_first(backend, listing(backend))
    return [tuple(sorted(row["together"].loops)) if row["together"] else (row["loop"],) for row in rows]


def work(backend: Backend, run: int | None = None) -> list[Work]:
    return [one for one in work_list(backend, listing(backend, audit_id=run)) if "today" in one.told]


def shelve(backend: Backend, tags: Iterable[str]) -> None:
    until = datetime.now(UTC) + timedelta(days=3)
    for tag in tags:
        notes.add_note(backend, tag, "the unit is down", "WO-1", None, "anna", until)


@pytest.fixture
def plant(backend: Backend, warm_kernels: None) -> Backend:
    """Four loops of a unit that is shut down, in automatic, a transmitter that died hours before, and one at work."""

    def make() -> None:
        at = dict(zip(DOWN, (900, 905, 910, 915), strict=True)) | {"X1": 400, "R1": None}
        stored(backend, at, {tag: "U1" if tag in DOWN else "U2" for tag in at})
        audited(backend)

    made_once(backend, "stood together", make)
    return backend


def test_of_thirty_loops_a_unit_of_eight_is_one_entry_and_a_dead_transmitter_another(
    backend: Backend, warm_kernels: None
) -> None:
    down = [f"down {k}" for k in range(8)]
    at = dict(zip(down, np.linspace(900, 920, 8).round().astype(int).tolist(), strict=True))
    at |= {"died alone": 400} | {f"at work {k}": None for k in range(21)}
    stored(backend, at, {tag: "U1" if tag in down else "U2" for tag in at})
    audited(backend)
    rows = rows_of(backend)
    assert {tag for tag, row in rows.items() if row["unanswered_since"]} == {*down, "died alone"}
    assert {tag: row["stood_with"] for tag, row in rows.items() if row["stood_with"]} == dict.fromkeys(down, 7)
    assert sorted(today(backend)) == [("died alone",), tuple(down)]
    assert sorted(len(one.stood_with) for one in work(backend)) == [0, 7]


def test_ten_that_died_at_random_are_ten_entries(backend: Backend, warm_kernels: None) -> None:
    at = np.random.default_rng(5).integers(100, 1250, 10).tolist()
    stored(backend, {f"X{k}": minute for k, minute in enumerate(at)}, {})
    audited(backend)
    assert {row["stood_with"] for row in rows_of(backend).values()} == {None}
    assert len(today(backend)) == len(rows_of(backend)) == 10


def test_each_row_says_with_which_others_and_what_to_look_at_first(plant: Backend) -> None:
    rows = rows_of(plant)
    for tag in DOWN:
        row = rows[tag]
        assert row["reasons"].split(";")[:2] == ["stood_together", "pv_stands"]
        others = ", ".join(other for other in DOWN if other != tag)
        told = f"PV of 3 other loops froze within 15 minutes, all of U1 ({others}): look first at whether"
        assert row["reasons_text"].startswith(told)
        assert (row["stood_with"], row["stood_together_since"], row["next_step"]) == (3, SINCE, Ask.STOOD_TOGETHER)
    assert [rows[tag]["unanswered_since"] for tag in ("D0", "D3")] == [SINCE, "2025-06-16T06:21:40Z"]
    assert (rows["X1"]["stood_with"], rows["X1"]["next_step"]) == (None, Ask.LOOK_TODAY)
    assert rows["R1"]["unanswered_since"] is None


def test_every_view_of_a_row_says_the_same(plant: Backend) -> None:
    row = rows_of(plant)["D1"]
    sent = {one["loop"]: one for one in json.loads(in_parts(plant).as_json())["rows"]}["D1"]
    assert sent == row
    assert {name: value for name, value in loop_health(plant, "D1").items() if name in row} == row
    reason = verdict_detail(plant, "D1")["reasons"][0]
    assert (reason["code"], reason["operator"], reason["threshold"]) == ("stood_together", "<", 0.01)
    assert 0.0 < reason["statistic"] < 1e-3
    assert loop_sheet(plant, find(plant, "D1"), None)["stood_with"] == ["D0", "D2", "D3"]
    assert "It froze together with D0, D2, D3." in loop_report(plant, "D1")


def test_the_digest_and_the_report_of_the_plant_tell_of_them_once(plant: Backend) -> None:
    digest: Digest = digest_of(plant, "1")
    listed = [one.loop for one in digest.work] + [one.loop for area in digest.areas for one in area.loops]
    assert {tag for tag in listed if tag in DOWN} == {"D0"}
    line = f"  - D0 (U1): {WORDS}; with it D1, D2, D3; since 2025-06-16 06:06"
    assert line in as_text(digest).splitlines()
    assert WORDS in as_html(digest)
    told = {one["loop"]: one for one in as_json(digest)["work"]}
    assert (told["D0"]["together"], told["D0"]["stood_with"]) == (WORDS, ("D1", "D2", "D3"))
    assert plant_report(plant).count(WORDS) == 1


def test_the_other_loops_of_the_plant_are_not_pushed_out(plant: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.services.plant.worst.MOST_TODAY", 2)
    assert sorted(today(plant)) == [DOWN, ("X1",)]
    _, worst = listed_first(plant, listing(plant))
    assert [row["loop"] for row in worst] == worst_tags(plant, listing(plant)) == ["R1"]


def test_shelved_loops_are_left_out_of_what_is_told_as_one(plant: Backend) -> None:
    shelve(plant, DOWN[:1])
    assert sorted(today(plant)) == [DOWN[1:], ("X1",)]
    shelve(plant, DOWN[1:3])
    assert sorted(today(plant)) == [("D3",), ("X1",)]
    shelve(plant, DOWN[3:])
    assert today(plant) == [("X1",)]
    assert rows_of(plant)["D3"]["stood_with"] == 3
    assert as_one(plant).of("D3").loops == DOWN


def test_loops_without_newer_samples_are_told_of_as_one_among_the_old(plant: Backend) -> None:
    told = as_one(plant, since_ns=find(plant, "D0").newest_ns + 1)
    assert list(told.by_tag) == ["D0"]
    with plant.database.write() as connection:
        connection.exec_driver_sql("UPDATE loops SET newest_ns = newest_ns - 1 WHERE tag IN ('D0', 'D1')")
    told = as_one(plant, since_ns=find(plant, "D3").newest_ns)
    assert sorted(one.loops for one in told.by_tag.values()) == [("D0", "D1"), ("D2", "D3")]


def test_a_unit_that_stays_down_is_told_of_as_one_when_no_record_reaches_back_to_its_end(plant: Backend) -> None:
    """The next windows begin when PV stood already: since when is what the night before knew."""
    for night in (1, 2):
        run = audited(night_after(plant, night))
        rows = rows_of(plant)
        assert "h or longer, up to the end" in rows["D3"]["reasons_text"]
        assert {rows[tag]["stood_together_since"] for tag in DOWN} == {SINCE}
        assert rows["D3"]["unanswered_since"] == "2025-06-16T06:21:40Z"
        assert sorted(today(plant)) == [DOWN, ("X1",)]
        assert sorted((one.loop, one.since) for one in work(plant, run)) == [
            ("D0", "since 2025-06-16 06:06"),
            ("X1", "since 2025-06-15 21:46"),
        ]


def test_a_unit_that_runs_between_two_records_is_not_down_since_the_first(plant: Backend) -> None:
    """Of the time between them nothing is told, or was not looked at: they stand as long as the second record or
    longer, each by itself."""
    later(plant, dict(zip(DOWN, (2300, 2305, 2310, 2315), strict=True)) | {"X1": None, "R1": None}, DAY)
    audited(with_settings(plant, window_samples=500))
    rows = rows_of(plant)
    for tag in DOWN:
        assert rows[tag]["likely_cause"] == UNANSWERED
        assert [rows[tag][name] for name in ("unanswered_since", "stood_with", "stood_together_since")] == [None] * 3


def test_since_when_is_known_after_a_night_that_was_not_heard(plant: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as failing:
        failing.setattr("app.services.auditing.ending.unanswered", None)
        audited(night_after(plant, 1))
    assert {rows_of(plant)[tag]["unanswered_since"] for tag in DOWN} == {None}
    audited(night_after(plant, 2))
    assert {rows_of(plant)[tag]["stood_together_since"] for tag in DOWN} == {SINCE}


def test_since_when_is_known_of_a_loop_that_another_run_judges_before_the_night_has_ended(plant: Backend) -> None:
    by_one = with_settings(night_after(plant, 1), chunk_loops=1, chunk_budget_s=1e-6)
    night = int(start_audit(by_one).id)
    for _ in range(4):
        audit_chunk(by_one, night, "test", calls_successor=False)
    audited(by_one, LoopFilter(tags=("D1",)))
    audit_chunk(night_after(plant, 1, adds=False), night, "test")
    assert rows_of(plant)["D1"]["audit_id"] != rows_of(plant)["D0"]["audit_id"]
    audited(night_after(plant, 2))
    rows = rows_of(plant)
    assert rows["D1"]["unanswered_since"] == "2025-06-16T06:11:40Z"
    assert {rows[tag]["stood_with"] for tag in DOWN} == {3}
    assert sorted(today(plant)) == [DOWN, ("X1",)]


def test_what_changed_is_told_of_the_one_that_speaks_for_all(backend: Backend, warm_kernels: None) -> None:
    ids = stored(backend, {**dict.fromkeys(DOWN), "R1": None}, dict.fromkeys(DOWN, "U1"))
    first = audited(backend)
    later(backend, dict(zip(DOWN, (2400, 2405, 2410, 2415), strict=True)) | {"R1": None}, 1400)
    run = audited(backend)
    for loop in ids.values():
        rewrite(backend, first, loop, verdict="no_stiction")
    together = as_one(backend)
    assert sorted(row.loop for row in changes(backend).rows if row.loop in DOWN) == list(DOWN)
    (told,) = (row for row in changes(backend, together=together).rows if row.loop in DOWN)
    assert told.because.endswith(f"; 3 more with it: {WORDS}")
    digest = digest_of(backend, str(run))
    assert [change.loop for change in digest.changes if change.loop in DOWN] == ["D0"]
    assert digest.other_changes == 3


@pytest.fixture
def all_but_the_weightiest_changed(backend: Backend, warm_kernels: None) -> Backend:
    """A unit that was shut down in the second night; of its first loop the same was said before, and X1 weighs more."""
    ids = stored(backend, {**dict.fromkeys(DOWN), "X1": 400, "R1": None}, dict.fromkeys(DOWN, "U1"))
    first = audited(backend)
    later(backend, dict(zip(DOWN, (2400, 2405, 2410, 2415), strict=True)) | {"X1": 400, "R1": None}, 1400)
    audited(backend)
    patch_loop(backend, "X1", {"importance": 3.0})
    for tag in ids:
        rewrite(
            backend, first, ids[tag], verdict="no_stiction" if tag in DOWN[1:] else rows_of(backend)[tag]["verdict"]
        )
    return backend


def test_what_changed_tells_of_those_that_are_news_where_the_weightiest_is_not(
    all_but_the_weightiest_changed: Backend,
) -> None:
    backend = all_but_the_weightiest_changed
    (told,) = changes(backend, together=as_one(backend)).rows
    assert told.loop == "D1"
    assert told.because.endswith(f"; 2 more with it: {WORDS}")
    digest = digest_of(backend, rows_of(backend)["D0"]["audit_id"])
    assert ([change.loop for change in digest.changes], digest.other_changes) == (["D1"], 2)


def test_a_group_in_which_any_is_news_comes_first_of_what_wants_a_look_today(
    all_but_the_weightiest_changed: Backend,
) -> None:
    backend = all_but_the_weightiest_changed
    assert today(backend) == [("X1",), DOWN]
    together = as_one(backend)
    rows = look_today(backend, listing(backend), changes(backend, together=together))
    assert [row["loop"] for row in rows] == ["D0", "X1"]


def test_what_changed_of_one_alone_counts_no_others(all_but_the_weightiest_changed: Backend) -> None:
    backend = all_but_the_weightiest_changed
    for tag in DOWN[1:3]:
        rewrite_newest(backend, find(backend, tag).id, verdict_before="inconclusive")
    (told,) = changes(backend, together=as_one(backend)).rows
    assert told.loop == "D3"
    assert told.because.endswith(f"; {WORDS}")
    assert "more with it" not in told.because


def test_one_that_runs_again_is_no_longer_among_them(plant: Backend) -> None:
    later(plant, {"D0": None}, 1400)
    audited(plant, LoopFilter(tags=("D0",)))
    assert rows_of(plant)["D0"]["stood_with"] is None
    assert sorted(today(plant)) == [DOWN[1:], ("X1",)]


def test_one_that_is_audited_later_is_told_of_with_them_though_it_came_to_stand_first(plant: Backend) -> None:
    stored(plant, {"Z": 895}, {"Z": "U1"})
    run = audited(plant, LoopFilter(tags=("Z",)))
    since = {tag: row["stood_together_since"] for tag, row in rows_of(plant).items()}
    assert (since["Z"], since["D0"]) == ("2025-06-16T06:01:40Z", SINCE)
    assert sorted(today(plant)) == [(*DOWN, "Z"), ("X1",)]
    together = as_one(plant).of("Z")
    assert (together.since, together.words) == (since["Z"], "PV of 5 loops froze within 20 minutes, all of U1")
    assert loop_sheet(plant, find(plant, "Z"), None)["stood_with"] == list(DOWN)
    assert as_one(plant, audit_id=run).by_tag == {}


def test_groups_that_one_run_tells_apart_stay_apart(plant: Backend) -> None:
    """As if a card had failed ten minutes after another."""
    with plant.database.write() as connection:
        for row in connection.execute(select(verdicts.c.loop_id, verdicts.c.extra_json)).all():
            extra = json.loads(row.extra_json)
            if extra["unanswered_since"] in ("2025-06-16T06:16:40Z", "2025-06-16T06:21:40Z"):
                extra["stood_together_since"] = "2025-06-16T06:16:40Z"
            changed = update(verdicts).where(verdicts.c.loop_id == row.loop_id)
            connection.execute(changed.values(extra_json=json.dumps(extra)))
    assert sorted(one.loops for one in as_one(plant).by_tag.values()) == [("D0", "D1"), ("D2", "D3")]


def test_what_another_run_tells_is_of_a_group_up_to_where_the_last_of_it_came_to_stand() -> None:
    """Loops may follow one another for longer than half an hour."""

    def stood(number: int, run: int, since: str, together: str) -> StoodRow:
        told = {"unanswered_since": f"2026-03-01T{since}:00Z", "stood_together_since": f"2026-03-01T{together}:00Z"}
        return StoodRow(number, f"D{number}", None, None, run, 60.0, json.dumps(told))

    rows = [stood(1, 1, "06:00", "06:00"), stood(2, 1, "07:00", "06:00")]
    rows += [stood(3, 2, "06:50", "06:50"), stood(4, 2, "07:05", "06:50")]
    rows += [stood(5, 3, "07:10", "07:10"), stood(6, 3, "07:12", "07:10")]
    assert [[row.id for row in group] for group in _listed_alike(rows, None)] == [[1, 2, 3, 4], [5, 6]]


def test_without_the_others_its_verdict_is_the_same_and_retired_loops_are_not_heard(plant: Backend) -> None:
    before = rows_of(plant)["D2"]
    for tag in DOWN[:2]:
        patch_loop(plant, tag, {"retired": True})
    audited(plant)
    row = rows_of(plant)["D2"]
    assert row["stood_with"] is None
    changed = {name for name in row if row[name] != before[name] and not name.startswith(("audit", "elapsed"))}
    assert changed == {"reasons", "reasons_text", "stood_with", "stood_together_since", "next_step"}


def test_rows_of_before_the_upgrade_are_read_without_it(plant: Backend) -> None:
    """As an older version wrote them: another form, and nothing of it among the fields without a column."""
    with plant.database.write() as connection:
        for key, extra in connection.execute(select(verdicts.c.loop_id, verdicts.c.extra_json)).all():
            of_old = {
                name: value
                for name, value in json.loads(extra).items()
                if name not in ("unanswered_since", "stood_with", "stood_together_since")
            }
            mine = verdicts.c.loop_id == key
            told = {"reasons": "pv_stands;prior_only", "extra_json": json.dumps(of_old)}
            connection.execute(update(verdicts).where(mine).values(**told))
        connection.execute(update(newest_rows).values(form="of an older version", row_json="{}"))
    (row,) = (one for one in json.loads(in_parts(plant).as_json())["rows"] if one["loop"] == "D0")
    assert (row["unanswered_since"], row["stood_with"], row["next_step"]) == (None, None, Ask.LOOK_TODAY)
    assert sorted(today(plant)) == [("D0",), ("D1",), ("D2",), ("D3",), ("X1",)]


def test_loops_without_a_date_are_not_compared(plant: Backend) -> None:
    with plant.database.read() as connection:
        rows = unanswered(connection)
    assert {tag for tag, one in of_plant(rows).items() if one.text} == set(DOWN)
    undated = [row._replace(extra_json=row.extra_json.replace("2025-06-1", "1970-01-1")) for row in rows]
    assert of_plant(undated) == {}


def test_the_lines_of_one_file_are_heard_together() -> None:
    line = {"samples": 1400, "sampling_interval_s": 60.0, "reasons": [{"code": "pv_stands"}]}
    lines = [line | {"loop": f"D{k}", "unanswered_since": f"2025-06-16T06:0{k}:00Z"} for k in range(3)]
    stem = lines[0] | {"loop": "S", "reasons": [{"code": "answers_no_more"}]}
    undated = lines[0] | {"loop": "U", "unanswered_since": None}
    found = of_lines([*lines, stem, undated])
    assert sorted(found) == ["D0", "D1", "D2"]
    assert found["D1"].fields == {"stood_with": 2, "stood_together_since": "2025-06-16T06:00:00Z"}
