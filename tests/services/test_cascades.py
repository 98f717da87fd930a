"""An outer loop of a cascade moves no valve: what is said of it rests on the loops whose set points it moves."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from app.engine.plant_wide.cascades import Cascade, cascades
from app.engine.plant_wide.excerpts import excerpts_of
from app.engine.plant_wide.groups import Group, Suspect
from app.engine.recording import Recording
from app.ingest import read_recordings
from app.lab.testbench import structures
from app.services.auditing import hearing
from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.file_audit import audited_lines
from app.services.auditing.hearing import (
    MOVES_NO_VALVE,
    MOVES_SET_POINT,
    Doubt,
    Heard,
    Said,
    cascades_doubts,
    hear,
    neighbours_doubts,
    reworded,
)
from app.services.backend import Backend
from app.services.moments import UTC_CLOCK
from app.services.plant.loop_verdicts import loop_health, verdict_detail
from app.services.plant.reliability import RowFilter
from app.services.stating.properties import patch_loop
from app.services.telling.next_steps import Ask, next_step
from app.storage import loops, series
from app.storage.audits import LoopFilter
from app.storage.samples import Samples
from app.storage.series import Stretch
from tests.table_rows import table_page

START_NS = 1_750_000_000_000_000_000
STICKS, HEALTHY = (1000, True), (1010, False)
SURE = {verdict: Said(verdict, "reliable", p) for verdict, p in (("stiction", 0.95), ("no_stiction", 0.05))}
UNSURE = {verdict: Said(verdict, "not_reliable", p) for verdict, p in (("stiction", 0.7), ("no_stiction", 0.3))}
NOT_AUDITABLE = Said("not_auditable", "not_reliable", None)


@cache
def cascade(seed: int, sticks: bool) -> dict[str, Recording]:
    kinds = {"TIC1": structures.cascade_outer, "FIC2": structures.cascade_inner}
    return {tag: structures.record(kind, seed, sticks) for tag, kind in kinds.items()}


def stored(backend: Backend, recordings: dict[str, Recording]) -> None:
    with backend.database.write() as connection:
        ids = loops.ensure(connection, tuple(recordings))
        series.add(connection, [Stretch(ids[tag], samples(one)) for tag, one in recordings.items()], None)


def samples(one: Recording) -> Samples:
    signals = {"pv": one.pv, "op": one.op, "sp": one.sp}
    return Samples(START_NS + (one.time_s * 1e9).astype(np.int64), signals)


def audited(backend: Backend, wanted: LoopFilter | None = None) -> dict[str, dict[str, Any]]:
    run = start_audit(backend, wanted)
    audit_chunk(backend, int(run.id), "test")
    return {row["loop"]: row for row in table_page(backend, filters=RowFilter()).rows}


def test_a_retired_loop_is_not_heard(backend: Backend, warm_kernels: None) -> None:
    stored(backend, cascade(*STICKS))
    audited(backend)
    patch_loop(backend, "FIC2", {"retired": True})
    assert audited(backend)["TIC1"]["reliability"] == "reliable"
    patch_loop(backend, "FIC2", {"retired": False})
    assert audited(backend)["TIC1"]["reliability"] == "not_reliable"


def test_an_outer_loop_is_not_cleared_beside_an_inner_one_that_sticks(backend: Backend, warm_kernels: None) -> None:
    stored(backend, {"TIC1": cascade(*STICKS)["TIC1"]})
    alone = audited(backend)["TIC1"]
    assert (alone["verdict"], alone["reliability"]) == ("no_stiction", "reliable")
    stored(backend, {"FIC2": cascade(*STICKS)["FIC2"]})
    rows = audited(backend)
    assert (rows["FIC2"]["verdict"], rows["FIC2"]["reliability"]) == ("stiction", "reliable")
    outer = rows["TIC1"]
    assert (outer["verdict"], outer["reliability"]) == ("no_stiction", "not_reliable")
    assert outer["stiction_probability"] == alone["stiction_probability"]
    assert outer["reasons"].split(";")[0] == MOVES_SET_POINT
    assert "OP is the set point of FIC2" in outer["reasons_text"]
    assert "FIC2: valve sticks, rely on it" in outer["reasons_text"]
    detail = verdict_detail(backend, "TIC1")
    assert detail["reasons"][0]["code"] == MOVES_SET_POINT
    assert loop_health(backend, "TIC1")["reliability"] == "not_reliable"
    assert next_step(outer, UTC_CLOCK) == Ask.OUTER


def test_an_outer_loop_stays_cleared_with_its_inner_one(backend: Backend, warm_kernels: None) -> None:
    stored(backend, cascade(*HEALTHY))
    rows = audited(backend)
    assert [(row["verdict"], row["reliability"]) for row in rows.values()] == [("no_stiction", "reliable")] * 2
    assert not any(MOVES_SET_POINT in row["reasons"] for row in rows.values())
    assert [row["moves_set_point_of"] for row in rows.values()] == [None, "FIC2"]
    assert [row["set_point_moved_by"] for row in rows.values()] == ["TIC1", None]
    assert verdict_detail(backend, "TIC1")["moves_set_point_of"] == ["FIC2"]
    assert verdict_detail(backend, "FIC2")["set_point_moved_by"] == ["TIC1"]


def test_an_outer_loop_audited_alone_is_heard_beside_what_is_known(backend: Backend, warm_kernels: None) -> None:
    stored(backend, cascade(*STICKS))
    before = audited(backend)
    after = audited(backend, LoopFilter(tags=("TIC1",)))
    assert after["TIC1"]["audit_id"] != before["TIC1"]["audit_id"] == after["FIC2"]["audit_id"]
    assert after["TIC1"]["reasons"].split(";").count(MOVES_SET_POINT) == 1


def test_what_is_stated_of_an_op_overrules_what_was_found(backend: Backend, warm_kernels: None) -> None:
    stored(backend, cascade(*STICKS))
    assert audited(backend)["TIC1"]["moves_set_point_of"] == "FIC2"
    patch_loop(backend, "TIC1", {"moves_valve": True})
    rows = audited(backend, LoopFilter(tags=("TIC1",)))
    assert (rows["TIC1"]["verdict"], rows["TIC1"]["reliability"]) == ("no_stiction", "reliable")
    assert (rows["TIC1"]["moves_set_point_of"], MOVES_SET_POINT in rows["TIC1"]["reasons"]) == (None, False)
    patch_loop(backend, "TIC1", {"moves_valve": None})
    assert audited(backend)["TIC1"]["reliability"] == "not_reliable"


def test_an_op_that_is_stated_to_move_no_valve_is_doubted_without_its_inner_loop(
    backend: Backend, warm_kernels: None
) -> None:
    stored(backend, {"TIC1": cascade(*STICKS)["TIC1"]})
    patch_loop(backend, "TIC1", {"moves_valve": False})
    outer = audited(backend)["TIC1"]
    assert (outer["verdict"], outer["reliability"], outer["moves_set_point_of"]) == (
        "no_stiction",
        "not_reliable",
        None,
    )
    assert outer["reasons"].split(";")[0] == MOVES_NO_VALVE
    assert "which the records do not show" in outer["reasons_text"]


def test_a_file_says_the_same_as_a_service(tmp_path) -> None:
    recordings = cascade(*STICKS)
    columns = {f"{tag}.{name}": x for tag, one in recordings.items() for name, x in signals(one).items()}
    stamps = np.datetime64("2026-03-01T00:00:00") + (5 * np.arange(structures.SAMPLES)).astype("timedelta64[s]")
    rows = zip(stamps.astype(str), *(np.round(x, 2).astype(str) for x in columns.values()), strict=True)
    export = tmp_path / "plant.csv"
    export.write_text("\n".join(",".join(row) for row in [("time", *columns), *rows]))
    lines = {line["loop"]: line for line in audited_lines(read_recordings(export))}
    assert lines["TIC1"]["reasons"][0]["code"] == MOVES_SET_POINT
    assert lines["TIC1"]["reliability"] == "not_reliable"
    assert lines["FIC2"]["reliability"] == "reliable"
    assert (lines["TIC1"]["moves_set_point_of"], lines["TIC1"]["set_point_moved_by"]) == ("FIC2", None)
    assert (lines["FIC2"]["moves_set_point_of"], lines["FIC2"]["set_point_moved_by"]) == (None, "TIC1")


def signals(one: Recording) -> dict[str, np.ndarray]:
    assert one.sp is not None
    return {"PV": one.pv, "OP": one.op, "SP": one.sp}


@pytest.mark.parametrize(
    ("outer", "inner", "doubted"),
    [
        (SURE["no_stiction"], SURE["no_stiction"], False),
        (SURE["no_stiction"], SURE["stiction"], True),
        (SURE["no_stiction"], UNSURE["no_stiction"], True),
        (SURE["no_stiction"], NOT_AUDITABLE, True),
        (SURE["no_stiction"], None, True),
        (SURE["stiction"], SURE["stiction"], True),
        (SURE["stiction"], SURE["no_stiction"], False),
        (UNSURE["stiction"], SURE["no_stiction"], False),
        (UNSURE["no_stiction"], UNSURE["stiction"], True),
        (NOT_AUDITABLE, SURE["stiction"], False),
    ],
)
def test_which_outer_loops_are_doubted(outer: Said, inner: Said | None, doubted: bool) -> None:
    said = {"TIC1": outer} | ({} if inner is None else {"FIC2": inner})
    found = cascades_doubts([Cascade("TIC1", "FIC2", 1.0)], said)
    assert list(found) == ["TIC1"] * doubted


@pytest.mark.parametrize(
    ("outer", "inner", "doubted"),
    [
        (SURE["no_stiction"], SURE["no_stiction"], False),
        (SURE["no_stiction"], SURE["stiction"], True),
        (SURE["stiction"], SURE["no_stiction"], True),  # a valve that it does not have
        (SURE["no_stiction"], None, True),
        (SURE["stiction"], None, True),
        (NOT_AUDITABLE, None, False),
    ],
)
def test_an_outer_loop_that_is_stated_to_be_without_a_valve(outer: Said, inner: Said | None, doubted: bool) -> None:
    said = {"TIC1": outer} | ({} if inner is None else {"FIC2": inner})
    found = [] if inner is None else [Cascade("TIC1", "FIC2", 1.0)]
    told = cascades_doubts(found, said, {"TIC1"})
    assert list(told) == ["TIC1"] * doubted
    assert all(
        doubt.text.startswith("OP moves no valve of its own, according to the loop's settings")
        for doubt in told.values()
    )
    assert all(("FIC2: " in doubt.text) == (inner is not None) for doubt in told.values())


def test_a_doubt_is_passed_up_a_cascade_of_three_loops() -> None:
    said = {"AIC1": SURE["no_stiction"], "TIC2": SURE["no_stiction"], "FIC3": SURE["stiction"]}
    found = cascades_doubts([Cascade("AIC1", "TIC2", 1.0), Cascade("TIC2", "FIC3", 1.0)], said)
    assert set(found) == {"AIC1", "TIC2"}
    assert "(TIC2: no stiction, look first)" in found["AIC1"].text


def test_loops_that_move_each_other_end() -> None:
    round_about = [Cascade("AIC1", "TIC2", 1.0), Cascade("TIC2", "AIC1", 1.0)]
    said = {"AIC1": SURE["no_stiction"], "TIC2": SURE["no_stiction"]}
    assert cascades_doubts(round_about, said) == {}
    assert set(cascades_doubts(round_about, said | {"TIC2": UNSURE["stiction"]})) == {"AIC1", "TIC2"}


def test_an_op_that_moves_two_set_points_names_both() -> None:
    said = {"TIC1": SURE["no_stiction"], "FIC2": SURE["no_stiction"], "FIC3": NOT_AUDITABLE}
    doubt = cascades_doubts([Cascade("TIC1", "FIC2", 0.99), Cascade("TIC1", "FIC3", 0.95)], said)["TIC1"]
    assert doubt.text == (
        "OP is the set point of FIC2 and the set point of FIC3 (from sample to sample they move alike, 0.95 of 1): "
        "unless OP also moves a valve of its own, the valve is judged there (FIC2: no stiction, rely on it; FIC3: "
        "not auditable)"
    )


LINE = {"verdict": "stiction", "reliability": "not_reliable", "stiction_probability": 0.7, "health": 80.0}
LINE |= {"reasons": [{"code": "few_cycles", "text": "few"}], "health_parts": [{"code": "x"}]}
LINE |= {"moves_set_point_of": None, "set_point_moved_by": None}


def changed(heard: Heard) -> set[str]:
    told = reworded(heard, LINE)
    return {name for name in told if told[name] != LINE[name]}


def test_of_an_unreliable_verdict_only_reasons_and_wiring_change() -> None:
    doubt = Doubt(MOVES_SET_POINT, "its OP is a set point")
    assert changed(Heard(doubt, ("FIC2",))) == {"reasons", "moves_set_point_of"}
    assert [r["code"] for r in reworded(Heard(doubt), LINE)["reasons"]] == [MOVES_SET_POINT, "few_cycles"]


def test_without_a_doubt_only_the_wiring_is_told() -> None:
    assert changed(Heard(None, (), ("TIC1",))) == {"set_point_moved_by"}
    assert reworded(Heard(None, ("FIC2", "FIC3")), LINE)["moves_set_point_of"] == "FIC2;FIC3"


def test_an_outer_loop_takes_nothing_from_the_verdict_of_its_inner_one() -> None:
    """Both swing for one valve, and the outer one may look likelier to stick."""
    outer, inner = (Suspect(tag, p, p, None, 1.0, 0.0) for tag, p in (("TIC1", 0.99), ("FIC2", 0.9)))
    together = Group(100.0, True, 0.0, (outer, inner))
    assert list(neighbours_doubts([together], {"FIC2"})) == ["FIC2"]
    assert neighbours_doubts([together], {"FIC2"}, [Cascade("TIC1", "FIC2", 1.0)]) == {}


def test_the_shaker_is_named_of_every_loop_that_is_called_sticky(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reliably or not: who looks at the loop has to know where to look first."""
    source, other = (Suspect(tag, p, p, None, 1.0, 0.0) for tag, p in (("FIC1", 0.99), ("FIC2", 0.9)))
    monkeypatch.setattr(hearing, "groups", lambda _: (Group(100.0, True, 0.0, (source, other)),))
    for said, told in ((SURE["stiction"], True), (UNSURE["stiction"], True), (UNSURE["no_stiction"], False)):
        heard = hearing.hear({"FIC1": SURE["stiction"], "FIC2": said}, [], [])
        assert ("FIC2" in heard) is told
        assert not told or (heard["FIC2"].doubt or Doubt("", "")).code == hearing.SHAKEN_BY_NEIGHBOUR


def test_loops_without_a_verdict_are_not_told_of() -> None:
    excerpts = {tag: excerpts_of(one, 0.0) for tag, one in cascade(*STICKS).items()}
    kept = {tag: one for tag, one in excerpts.items() if one is not None}
    assert set(hear({"FIC2": SURE["stiction"]}, [], cascades(kept))) == {"FIC2"}
    assert hear({}, [], cascades(kept)) == {}
