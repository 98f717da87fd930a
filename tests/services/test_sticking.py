"""All valves that stick reliably, unit by unit."""

from app.services.backend import Backend
from app.services.plant.sticking import size_with_interval, sticking
from app.services.reports.documents import plant_report
from app.services.stating import notes
from app.services.stating.properties import patch_loop
from app.services.stating.shelving import shelf
from tests.services.audited_plant import AddLoops, audited, rewrite, rewrite_newest


def test_all_of_them_are_listed_with_what_a_work_order_needs(backend: Backend, add_loops: AddLoops) -> None:
    ids = add_loops("A", "B", "C", "D", n=600, unit="U1") | add_loops("E", n=600)
    run = audited(backend)
    said = {tag: ("stiction", "reliable", 60.0 - 10.0 * k) for k, tag in enumerate("ABE")}
    said |= {"C": ("stiction", "not_reliable", 10.0), "D": ("no_stiction", "reliable", 5.0)}
    for tag, (verdict, reliability, health) in said.items():
        values = {"verdict": verdict, "reliability": reliability, "health": health}
        rewrite(backend, run, ids[tag], **values)
        rewrite_newest(backend, ids[tag], **values)
    patch_loop(backend, "B", {"description": "Reflux"})
    notes.add_note(backend, "B", "ordered", "WO-7", None, "somebody")
    found = sticking(backend, shelf(backend), 5)
    assert [(unit, [one.loop for one in valves]) for unit, valves in found.units] == [("U1", ["B", "A"]), (None, ["E"])]
    assert (found.units[0][1][0].row["description"], found.units[0][1][0].row["work_order"]) == ("Reflux", "WO-7")
    assert found.more == 2
    assert sticking(backend, shelf(backend), 3, most=1).more == 2
    assert sticking(backend, shelf(backend), 2).more == 0, "one more came to stick since they were counted"
    html = plant_report(backend)
    assert "U1: 2</h3>" in html
    assert "WO-7" in html


def test_a_size_is_told_with_its_interval() -> None:
    row = {"stiction_S": 5.02, "stiction_S_low": 4.714, "stiction_S_high": 5.333, "stiction_S_pct_of_span": 5.02}
    assert size_with_interval(row) == "S 5.02 (4.71 to 5.33) units of OP, 5.0 % of OP's span"
    assert size_with_interval(row | {"stiction_S_pct_of_span": None}) == "S 5.02 (4.71 to 5.33) units of OP"
    assert size_with_interval(row | {"stiction_S": None}) == ""
