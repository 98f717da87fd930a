"""What users read: loops, the reliability table by the page, history, trend, the plant in numbers."""

import base64
import json
import threading
from collections.abc import Callable
from datetime import UTC, datetime

import pytest
from sqlalchemy import Connection, select, update

from app.api.models import HealthOut
from app.errors import NotFoundError, RequestError
from app.services import loops
from app.services.audit_json.models import ReliabilityRow, TableRow
from app.services.audit_json.rows import COLUMNS
from app.services.auditing import audits, chunks
from app.services.backend import Backend
from app.services.cursors import encode
from app.services.plant import loop_verdicts, overview, reliability
from app.services.plant.reliability import RowFilter
from app.services.stating import properties
from app.services.telling.health_classes import BOUNDS
from app.services.upkeep.readiness import readiness
from app.storage import figures, row_texts
from app.storage import loops as stored_loops
from app.storage import verdicts as stored_verdicts
from app.storage.loops import ListFilter
from app.storage.tables import audits as stored_audits
from app.storage.tables import newest_rows, verdicts
from tests.services.kept_rows import made_once
from tests.table_rows import table_page

AddLoops = Callable[..., dict[str, int]]
TAGS = [f"FIC{i}" for i in range(7)]
PROBABILITIES = [0.9, 0.1, None, 0.9, 0.5, None, 0.3]


def _audit(backend: Backend) -> str:
    run = audits.start_audit(backend)
    while chunks.audit_chunk(backend, int(run.id), "w"):
        pass
    return run.id


@pytest.fixture
def untouched(backend: Backend, add_loops: AddLoops) -> Backend:
    """Five audited loops, and one that was not audited."""

    def make() -> None:
        add_loops(*TAGS[:5], n=150)
        _audit(backend)
        add_loops("NEW1", n=150)

    made_once(backend, "untouched", make)
    return backend


@pytest.fixture
def plant(backend: Backend, add_loops: AddLoops) -> Backend:
    """Seven audited loops with probabilities of our choice, some alike, some unknown."""

    def make() -> None:
        ids = add_loops(*TAGS, n=150)
        _audit(backend)
        with backend.database.write() as connection:
            for tag, probability in zip(TAGS, PROBABILITIES, strict=True):
                for rows in (verdicts, newest_rows):
                    mine = rows.c.loop_id == ids[tag]
                    connection.execute(update(rows).where(mine).values(stiction_probability=probability))

    made_once(backend, "of all probabilities", make)
    return backend


def pages(backend: Backend, sort: str, limit: int, filters: RowFilter | None = None) -> list[str]:
    tags, cursor = [], None
    while True:
        page = table_page(backend, limit, cursor, sort, filters)
        assert len(page.rows) <= limit
        tags += [row["loop"] for row in page.rows]
        assert len(tags) <= len(set(tags)), "the pages go round"
        cursor = page.next_cursor
        if cursor is None:
            return tags


@pytest.mark.parametrize(
    ("sort", "order"),
    [
        ("loop", [0, 1, 2, 3, 4, 5, 6]),
        ("-loop", [6, 5, 4, 3, 2, 1, 0]),
        ("stiction_probability", [1, 6, 4, 0, 3, 2, 5]),
        ("-stiction_probability", [0, 3, 4, 6, 1, 2, 5]),
        ("unit", [0, 1, 2, 3, 4, 5, 6]),
    ],
)
def test_pages_follow_each_other_without_gap(plant: Backend, sort: str, order: list[int]) -> None:
    """One row a page ends one at every row; three leave the last page short."""
    found = {limit: pages(plant, sort, limit) for limit in (1, 3, 100)}
    assert found == {limit: [TAGS[i] for i in order] for limit in found}


@pytest.mark.parametrize("sort", ["stiction_probability", "-stiction_probability", "-priority"])
def test_pages_end_where_a_kept_row_is_not_its_verdict(plant: Backend, sort: str) -> None:
    """As while a newer verdict is being written: the order is that of the kept rows, and so are the cursors."""
    with plant.database.write() as connection:
        connection.execute(update(verdicts).values(stiction_probability=0.5, health=50.0))
        for rank, tag in enumerate(TAGS):
            mine = newest_rows.c.loop_id == stored_loops.ids_of(connection, [tag])[tag]
            kept = {"stiction_probability": rank / 10, "health": 10.0 * rank}
            connection.execute(update(newest_rows).where(mine).values(**kept))
    order = TAGS[::-1] if sort == "-stiction_probability" else TAGS
    assert pages(plant, sort, 2) == order
    rows, cursor = [], None
    for _ in TAGS:
        page = reliability.table(plant, 2, cursor, sort)
        rows += [row["loop"] for row in page.rows]
        cursor = page.next_cursor
        if cursor is None:
            break
    assert rows == order


@pytest.mark.parametrize("letter", ["塔", "\x1f"])
def test_pages_of_the_longest_names_follow_each_other(backend: Backend, add_loops: AddLoops, letter: str) -> None:
    tags = [f"{letter * 255}{number}" for number in range(3)]
    add_loops(*tags, n=150)
    _audit(backend)
    assert pages(backend, "loop", 1) == tags


def test_every_field_of_the_row_that_has_a_column_can_be_sorted_by(plant: Backend) -> None:
    names = set(ReliabilityRow.model_fields) & {*COLUMNS, "loop", "unit"} - {"reasons_text"}
    assert names <= set(reliability.sortable())
    for name in names:
        assert sorted(pages(plant, name, 4)) == TAGS, name
        assert sorted(pages(plant, f"-{name}", 4)) == TAGS, name


def test_rows_have_the_fields_of_the_contract(plant: Backend) -> None:
    rows = table_page(plant).rows
    assert len(rows) == len(TAGS)
    for row in rows:
        assert set(row) == set(TableRow.model_fields)


def test_a_class_of_health_reaches_up_to_its_limit(plant: Backend) -> None:
    values = dict(zip(TAGS, (None, 59.9, 60.0, 79.9, 80.0, 0.0, 100.0), strict=True))
    with plant.database.write() as connection:
        for tag, value in values.items():
            mine = newest_rows.c.loop_id == stored_loops.ids_of(connection, [tag])[tag]
            connection.execute(update(newest_rows).where(mine).values(health=value))
    found = {name: pages(plant, "loop", 2, RowFilter(health=bounds)) for name, bounds in BOUNDS.items()}
    none, below, limit, middle, high, least, most = TAGS
    assert found == {"low": [below, least], "middle": [limit, middle], "high": [high, most], "not_evaluated": [none]}


def test_rows_can_be_filtered(plant: Backend) -> None:
    assert pages(plant, "loop", 2, RowFilter(min_probability=0.5)) == ["FIC0", "FIC3", "FIC4"]
    assert pages(plant, "loop", 2, RowFilter(search="c3")) == ["FIC3"]
    assert pages(plant, "loop", 2, RowFilter(search="%")) == []
    assert pages(plant, "loop", 2, RowFilter(verdict=("not_auditable",))) == []
    assert pages(plant, "loop", 9, RowFilter(unit="nowhere")) == []
    assert pages(plant, "loop", 9, RowFilter(audit_id=1)) == TAGS


def test_what_cannot_be_asked_is_refused(plant: Backend) -> None:
    following = table_page(plant, 1).next_cursor
    for arguments in [
        {"sort": "nothing"},
        {"sort": "reasons_text"},
        {"limit": 0},
        {"limit": 20_001},
        {"cursor": "%%%"},
        {"cursor": "W10"},
        {"cursor": following, "sort": "verdict"},
    ]:
        with pytest.raises(RequestError):
            table_page(plant, **arguments)


@pytest.mark.parametrize(
    ("sort", "value"),
    [
        ("samples", "many"),
        ("samples", 2**31),
        ("stiction_probability", {"a": 1}),
        ("stiction_probability", float("inf")),
        ("stiction_probability", "x"),
        ("verdict", True),
        ("loop", 5),
        ("loop", "\0"),
        ("loop", "\ud800"),
        ("audited_at", 5),
        ("audited_at", {"t": "0001-01-01T00:00:00+14:00"}),
        ("nothing", 1.0),
    ],
)
def test_a_cursor_that_the_table_never_gave_is_refused(plant: Backend, sort: str, value: object) -> None:
    # As a stranger would write it: half a pair of UTF-16, which no name can hold, is an escape there.
    forged = base64.urlsafe_b64encode(json.dumps([sort, value, "FIC0"]).encode()).decode().rstrip("=")
    for ask in (table_page, reliability.in_parts, reliability.table):
        with pytest.raises(RequestError) as refused:
            ask(plant, 2, forged, "loop" if sort == "nothing" else sort)
        assert refused.value.code == "bad_cursor"


@pytest.mark.parametrize("number", [2**63, True, 1.5])
def test_a_cursor_that_no_list_gave_is_refused(plant: Backend, number: object) -> None:
    with pytest.raises(RequestError) as refused:
        loop_verdicts.verdict_history(plant, "FIC0", cursor=encode(number))
    assert refused.value.code == "bad_cursor"


@pytest.mark.parametrize(
    ("sort", "filters"),
    [
        *((sort, RowFilter()) for sort in ("loop", "-loop", "-stiction_probability", "unit", "audited_at")),
        ("-loop", RowFilter(search="FIC")),
        ("-stiction_probability", RowFilter(min_probability=0.0)),
    ],
)
def test_the_table_as_json_is_the_table(untouched: Backend, sort: str, filters: RowFilter) -> None:
    for limit in (3, 100):
        page = table_page(untouched, limit, None, sort, filters)
        sent = json.loads(reliability.in_parts(untouched, limit, None, sort, filters).as_json())
        assert sent == {"rows": page.rows, "next_cursor": page.next_cursor}


def test_rows_are_sent_as_the_loop_is_now_and_in_the_present_form(untouched: Backend) -> None:
    properties.patch_loop(untouched, "FIC1", {"unit": 'the "new" unit'})
    with untouched.database.write() as connection:
        connection.execute(update(newest_rows).where(newest_rows.c.loop_id == 3).values(form="older"))
    sent = json.loads(reliability.in_parts(untouched).as_json())["rows"]
    assert sent == table_page(untouched).rows
    assert [row["unit"] for row in sent if row["loop"] == "FIC1"] == ['the "new" unit']


def test_of_a_table_that_was_sent_before_only_new_rows_are_read(
    untouched: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[list[int]] = []

    def told(connection: Connection, loop_ids: list[int], form: str) -> dict[tuple[int, int], bytes]:
        read.append(loop_ids)
        return stored_verdicts.texts(connection, loop_ids, form)

    monkeypatch.setattr(row_texts, "texts", told)
    before = reliability.in_parts(untouched).as_json()
    assert reliability.in_parts(untouched).as_json() == before
    assert [len(ids) for ids in read] == [5]
    run = audits.start_audit(untouched, audits.LoopFilter(tags=("FIC1",)))
    while chunks.audit_chunk(untouched, int(run.id), "test"):
        pass
    after = json.loads(reliability.in_parts(untouched).as_json())["rows"]
    assert [len(ids) for ids in read] == [5, 1]
    assert after == table_page(untouched).rows != json.loads(before)["rows"]


def test_kept_rows_are_bounded_and_not_given_up_for_new_ones_of_the_same_loops(
    untouched: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(row_texts, "MOST_KEPT", 5)
    reliability.in_parts(untouched).as_json()
    run = audits.start_audit(untouched, audits.LoopFilter(tags=("FIC1",)))
    while chunks.audit_chunk(untouched, int(run.id), "test"):
        pass
    reliability.in_parts(untouched).as_json()
    assert len(untouched.row_texts) == 5
    monkeypatch.setattr(row_texts, "MOST_KEPT", 3)
    with untouched.database.write() as connection:
        connection.execute(update(stored_audits).values(created_at=datetime(2020, 1, 1, tzinfo=UTC)))
    for limit in (2, 5, 2):
        sent = json.loads(reliability.in_parts(untouched, limit).as_json())
        assert sent["rows"] == table_page(untouched, limit).rows
    assert len(untouched.row_texts) <= 3


def test_after_a_restore_the_same_number_of_a_run_is_another_run(untouched: Backend) -> None:
    """The database was put back and the loops audited again: the run has the number of one that is lost."""
    before = reliability.in_parts(untouched)
    lost = before.as_json()
    with untouched.database.write() as connection:
        connection.execute(update(stored_audits).values(created_at=datetime(2020, 1, 1, tzinfo=UTC)))
        text = connection.scalar(select(newest_rows.c.row_json).where(newest_rows.c.loop_id == 1))
        other = text.replace('"reliability":', '"reliability":"other","was":')
        connection.execute(update(newest_rows).where(newest_rows.c.loop_id == 1).values(row_json=other))
    after = reliability.in_parts(untouched)
    assert after.version != before.version
    assert after.as_json() != lost
    assert b'"reliability":"other"' in after.as_json()


def test_health_is_sent_as_the_model_says(untouched: Backend) -> None:
    properties.patch_loop(untouched, "FIC1", {"unit": "U7"})
    told = loop_verdicts.loop_health(untouched, "FIC1")
    assert json.loads(loop_verdicts.loop_health_json(untouched, "FIC1")) == told
    assert HealthOut.model_validate(told).model_dump(mode="json") == told
    with untouched.database.write() as connection:
        connection.execute(update(newest_rows).values(form="older"))
    assert json.loads(loop_verdicts.loop_health_json(untouched, "FIC1")) == told
    with pytest.raises(NotFoundError):
        loop_verdicts.loop_health_json(untouched, "NEW1")


def test_key_figures_of_verdicts_that_older_versions_wrote_come_from_their_detail(untouched: Backend) -> None:
    now = loop_verdicts.loop_health(untouched, "FIC1")
    with untouched.database.write() as connection:
        connection.execute(update(verdicts).values(extra_json="{}"))
    before = loop_verdicts.loop_health(untouched, "FIC1")
    assert before["good_share_pct"] == now["good_share_pct"] == 100.0
    assert before["op_travel_per_h"] == now["op_travel_per_h"] > 0


def test_the_table_has_each_loops_newest_verdict(plant: Backend) -> None:
    second = _audit(plant)
    assert {row["audit_id"] for row in table_page(plant).rows} == {second}
    history = loop_verdicts.verdict_history(plant, "FIC0", limit=1)
    older = loop_verdicts.verdict_history(plant, "FIC0", limit=1, cursor=history.next_cursor)
    assert [row["audit_id"] for row in history.rows + older.rows] == [second, "1"]
    assert older.next_cursor is None


def test_a_late_verdict_of_an_older_run_does_not_hide_a_newer_one(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1", n=150)
    older, newer = audits.start_audit(backend), audits.start_audit(backend)
    for run in (newer, older):
        chunks.audit_chunk(backend, int(run.id), "w")
    assert loop_verdicts.loop_health(backend, "FIC1")["audit_id"] == newer.id


def test_the_plant_in_numbers(plant: Backend) -> None:
    seen = overview.overview(plant)
    assert (seen.loops, seen.audited, sum(seen.verdicts.values())) == (7, 7, 7)
    with plant.database.read() as connection:
        found = figures.collect(connection)
    assert (found.loops, found.waiting.oldest_open_s, sum(found.verdicts.values())) == (7, 0.0, 7)
    assert readiness(plant).state == "ready"


def test_loops_are_listed_found_and_changed(plant: Backend) -> None:
    first = loops.list_loops(plant, limit=4)
    rest = loops.list_loops(plant, limit=4, cursor=first.next_cursor)
    assert [loop.tag for loop in first.rows + rest.rows] == TAGS
    assert [loop.tag for loop in loops.list_loops(plant, wanted=ListFilter(search="6")).rows] == ["FIC6"]
    changed = properties.patch_loop(plant, "FIC1", {"unit": "U1", "pv_low": 0.0, "pv_high": 10.0, "importance": None})
    assert (changed.unit, changed.pv_high, changed.importance) == ("U1", 10.0, 1.0)
    assert properties.patch_loop(plant, "FIC1", {"pv_low": None}).pv_high == 10.0
    for bad in ({"pv_low": 10.0}, {"pv_low": float("nan")}, {"colour": "red"}):
        with pytest.raises(RequestError):
            properties.patch_loop(plant, "FIC1", bad)
    with pytest.raises(NotFoundError):
        loops.get_loop(plant, "fic1")


def test_two_who_change_a_loop_at_once_lose_nothing(untouched: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second one comes while the first looks at what there is."""
    look, others = properties._check_spans, []

    def second(wanted: dict[str, object]) -> None:
        monkeypatch.setattr(properties, "_check_spans", look)
        thread = threading.Thread(target=properties.patch_loop, args=(untouched, "FIC1", {"unit": "U2"}))
        thread.start()
        others.append(thread)
        thread.join(0.5)

    monkeypatch.setattr(properties, "_check_spans", second)
    properties.patch_loop(untouched, "FIC1", {"description": "feed"})
    others[0].join()
    found = loops.get_loop(untouched, "FIC1")
    assert (found.unit, found.description) == ("U2", "feed")


def test_a_loop_without_verdict_says_so(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1")
    for ask in (loop_verdicts.loop_health, loop_verdicts.verdict_detail):
        with pytest.raises(NotFoundError) as refused:
            ask(backend, "FIC1")
        assert refused.value.code == "not_audited"
