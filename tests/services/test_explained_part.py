"""Which part of a loop's record is explained where nobody says which, and what is said beside the answer."""

from collections.abc import Callable
from datetime import datetime, timedelta

import pytest
from sqlalchemy import select, update

from app.services.auditing import audits, chunks
from app.services.backend import Backend
from app.services.explaining import explanations
from app.services.explaining import traces as explanation_traces
from app.services.explaining import working as explaining
from app.services.explaining.explanations import Wanted
from app.services.stating import notes
from app.storage.tables import explanations as explanations_table
from app.storage.tables import verdicts as verdicts_table
from tests.engine.wandering import STICKY, recorded
from tests.services.explained_loops import GAIN, INTERVAL_S, START, TAU_S, keep, model, record

AddLoops = Callable[..., dict[str, int]]


def audited(backend: Backend) -> None:
    run = audits.start_audit(backend)
    chunks.audit_chunk(backend, int(run.id), "w")


def test_of_a_long_record_what_its_audit_judges_is_explained(backend: Backend) -> None:
    loop = recorded(STICKY, 6500, seed=2)
    signals = {"pv": loop.pv, "op": loop.op}
    keep(backend, "FIC1", signals)
    asked = explanations.ask(backend, "FIC1")
    assert (asked["as_judged"], asked["window_start"]) == (True, "2026-03-01T00:00:00Z")
    assert explaining.explain_next(backend, "w")
    found = explanations.get_explanation(backend, "FIC1", asked["id"])
    assert (found["state"], found["effect_codes"], found["as_judged"]) == ("done", ["valve.stiction"], True)
    start, end = (datetime.fromisoformat(found[name]) for name in ("window_start", "window_end"))
    first, last = (round((at - START).total_seconds() / INTERVAL_S) for at in (start, end))
    assert last - first < 2000
    table = explanation_traces.trace_csv(backend, "FIC1", asked["id"]).splitlines()
    assert len(table) == 1 + last - first + 1
    assert float(table[1].split(",")[1]) == pytest.approx(signals["pv"][first], rel=1e-5)


def test_a_verdict_of_too_few_samples_leaves_the_newest_window(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1", n=50)
    audited(backend)
    add_loops("FIC1", n=300)
    asked = explanations.ask(backend, "FIC1")
    start, end = (datetime.fromisoformat(asked[name]) for name in ("window_start", "window_end"))
    assert (end - start).total_seconds() == 299 * 60.0


def test_a_standstill_at_the_end_of_a_long_record_keeps_nothing_from_being_explained(backend: Backend) -> None:
    signals = record(n=6000)
    signals["op"][3000:], signals["pv"][3000:] = 0.0, 0.0
    small = Backend(backend.settings.model_copy(update={"explanation_samples": 2000}), backend.database, backend.queue)
    keep(small, "FIC1", signals)
    assert explanations.ask(small, "FIC1")["as_judged"]
    assert explaining.explain_next(small, "w")
    found = explanations.newest(small, "FIC1")
    assert (found["state"], found["window_end"] < "2026-03-01T08:20:01Z") == ("done", True)


def test_a_stated_window_and_a_given_simulation_are_explained_whole(backend: Backend) -> None:
    keep(backend, "FIC1", record(n=5200))
    for wanted in (Wanted(window_h=20.0), Wanted(start=START), model(gain=GAIN, time_constants_s=[TAU_S])):
        asked = explanations.ask(backend, "FIC1", wanted)
        assert (asked["as_judged"], asked["window_start"]) == (False, "2026-03-01T00:00:00Z")
    assert explanations.ask(backend, "FIC1")["as_judged"]


def test_an_explanation_says_what_to_keep_in_mind(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1")
    explanations.ask(backend, "FIC1")
    found = explanations.newest(backend, "FIC1")
    assert found["remarks"] == []
    audited(backend)
    assert explanations.newest(backend, "FIC1")["remarks"] == []  # of the same samples
    add_loops("FIC1", n=400)
    audited(backend)
    repaired_at = datetime.fromisoformat(found["window_end"]) + timedelta(minutes=101)
    notes.add_note(backend, "FIC1", "packing renewed", repaired_at=repaired_at)
    repair, audit = explanations.newest(backend, "FIC1")["remarks"]
    assert repair.startswith(f"This is from before the repair of {repaired_at:%Y-%m-%d %H:%M} UTC")
    assert audit.startswith("It was asked for before the audit of ")
    explanations.ask(backend, "FIC1")
    assert len(explanations.newest(backend, "FIC1")["remarks"]) == 1


def test_an_audit_of_the_same_samples_makes_no_explanation_an_old_one(backend: Backend) -> None:
    """Of a long record too, of which the window of the explanation is the judged part."""
    keep(backend, "FIC1", record(n=5200))
    audited(backend)
    explanations.ask(backend, "FIC1")
    audited(backend)
    assert explanations.newest(backend, "FIC1")["remarks"] == []
    keep(backend, "FIC1", record(step=3.0, n=5200))  # sent again, mended
    audited(backend)
    assert len(explanations.newest(backend, "FIC1")["remarks"]) == 1


@pytest.mark.parametrize(("verdict", "said"), [("stiction", 1), ("no_stiction", 0)])
def test_nothing_missing_beside_a_valve_that_sticks_is_put_right(
    backend: Backend, add_loops: AddLoops, verdict: str, said: int
) -> None:
    loop_id = add_loops("FIC1")["FIC1"]
    audited(backend)
    asked = explanations.ask(backend, "FIC1")
    with backend.database.write() as connection:
        connection.execute(update(verdicts_table).where(verdicts_table.c.loop_id == loop_id).values(verdict=verdict))
        mine = explanations_table.c.id == int(asked["id"])
        connection.execute(update(explanations_table).where(mine).values(state="done", verdict="consistent"))
    remarks = explanations.newest(backend, "FIC1")["remarks"]
    assert len([text for text in remarks if "does not clear it" in text]) == said


def test_what_the_newest_verdict_rests_on_is_explained(backend: Backend, add_loops: AddLoops) -> None:
    """And not what came since, or before a repair that was stated."""
    loop_id = add_loops("FIC1")["FIC1"]
    audited(backend)
    whole = explanations.ask(backend, "FIC1")
    with backend.database.write() as connection:
        mine = verdicts_table.c.loop_id == loop_id
        start_ns, end_ns = connection.execute(
            select(verdicts_table.c.input_start_ns, verdicts_table.c.input_end_ns).where(mine)
        ).one()
        third = (end_ns - start_ns) // 3
        judged = {"input_start_ns": start_ns + third, "input_end_ns": end_ns - third}
        connection.execute(update(verdicts_table).where(mine).values(**judged))
    part = explanations.ask(backend, "FIC1")
    assert whole["window_start"] < part["window_start"] < part["window_end"] < whole["window_end"]
    stated = explanations.ask(backend, "FIC1", Wanted(window_h=1000.0))
    assert (stated["window_start"], stated["window_end"]) == (whole["window_start"], whole["window_end"])
