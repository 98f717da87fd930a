"""Which loops swing together."""

import threading
import time
from collections.abc import Callable

import pytest

from app.services.backend import Backend
from app.services.loops import find
from app.services.outward import GroupMemberOut
from app.services.plant import groups, loop_sheet, plant_sheet
from app.services.plant.arrivals import arrivals
from app.services.plant.groups import groups_of, plant_groups, shaken_by
from app.services.reports.documents import loop_report, plant_report
from app.services.stating.properties import patch_loop
from app.services.stating.shelving import shelf
from tests.told_groups import group_of


def test_loops_with_one_swing_are_a_group(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    group = plant_groups(backend)[0]
    assert {member.loop for member in group.members} == set("ABCD")
    assert group.in_step
    assert plant_groups(backend) is plant_groups(backend)  # found once
    assert groups_of(plant_groups(backend), "A") == [group]


@pytest.mark.parametrize(
    ("said", "coherence", "probability", "shaken"),
    [
        (("no_stiction", "reliable"), 0.8, 0.1, "S"),
        (("stiction", "not_reliable"), 0.97, 0.9, "S"),
        (("stiction", "not_reliable"), 0.8, 0.9, None),  # it swings by itself
        (("stiction", "reliable"), 0.97, 0.99, None),  # nobody is sent elsewhere from a valve that surely sticks
    ],
)
def test_a_loop_is_sent_to_the_source_where_that_may_be_what_shakes_it(said, coherence, probability, shaken):
    members = [GroupMemberOut("S", None, 0.99, 4.0, 1.0, 0.0, None, True)]
    members += [GroupMemberOut("A", None, probability, 0.0, coherence, 1.0, None, True)]
    row = {"loop": "A", "verdict": said[0], "reliability": said[1]}
    assert shaken_by([group_of("1", 300.0, True, False, 0.001, "S", members)], row) == shaken
    assert shaken_by([group_of("1", 300.0, False, True, 0.03, "S", members)], row) is None
    assert shaken_by([group_of("1", 300.0, True, False, 0.001, None, members)], row) is None
    assert shaken_by([group_of("1", 300.0, True, False, 0.001, "S", members)], row | {"loop": "S"}) is None


def test_groups_know_the_units_that_loops_have_now(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    assert {member.unit for member in plant_groups(backend)[0].members} == {"U1"}
    patch_loop(backend, "A", {"unit": "U2"})
    assert {member.loop: member.unit for member in plant_groups(backend)[0].members}["A"] == "U2"


def test_pages_that_cannot_wait_share_one_search_for_groups(
    backend: Backend, two_runs: tuple[dict[str, int], int], monkeypatch: pytest.MonkeyPatch
) -> None:
    going, asked = threading.Event(), []

    def slow(candidates: object) -> tuple[()]:
        asked.append(candidates)
        going.wait(60)
        return ()

    monkeypatch.setattr(groups, "groups", slow)
    assert [groups.soon(backend, 0.01) for _ in range(3)] == [None] * 3
    patch_loop(backend, "A", {"unit": "U2"})
    assert groups.soon(backend, 0.01) is None  # another state, while the last one is worked out
    assert sum(thread.name == "groups" for thread in threading.enumerate()) == 1
    going.set()
    assert groups.plant_groups(backend) == ()
    assert len(asked) == 2


@pytest.mark.parametrize(
    ("report", "said"),
    [
        (plant_report, "<li>4 loops with a period of "),
        (lambda backend: loop_report(backend, "A"), "<p>It oscillates together with 3 other loops"),
    ],
    ids=["plant", "loop"],
)
def test_reports_wait_for_the_groups(
    backend: Backend,
    two_runs: tuple[dict[str, int], int],
    monkeypatch: pytest.MonkeyPatch,
    report: Callable[[Backend], str],
    said: str,
) -> None:
    search = groups.groups

    def slow(candidates: object) -> object:
        time.sleep(5 * groups.PATIENCE_S)
        return search(candidates)

    monkeypatch.setattr(groups, "groups", slow)
    assert groups.soon(backend) is None
    text = report(backend)
    assert "being determined" not in text
    assert said in text


@pytest.mark.parametrize(
    "sheet",
    [
        lambda backend: plant_sheet.plant_sheet(backend, arrivals(backend)),
        lambda backend: loop_sheet.loop_sheet(backend, find(backend, "A"), None, shelf(backend)),
    ],
)
def test_while_the_newest_groups_are_worked_out_those_before_are_shown_with_their_time(
    backend: Backend, two_runs: tuple[dict[str, int], int], monkeypatch: pytest.MonkeyPatch, sheet: object
) -> None:
    monkeypatch.setattr(groups, "soon", lambda backend: None)
    told = sheet(backend)
    assert (told["groups_known"], told["groups"], told["groups_before"]) == (False, [], None)
    monkeypatch.undo()
    found = list(plant_groups(backend))
    told = sheet(backend)
    assert (told["groups_known"], told["groups"], told["groups_before"]) == (True, found, None)
    monkeypatch.setattr(groups, "soon", lambda backend: None)
    told = sheet(backend)
    assert (told["groups_known"], told["groups"]) == (True, found)
    assert told["groups_before"]


def test_a_search_for_groups_that_failed_is_made_again(
    backend: Backend, two_runs: tuple[dict[str, int], int], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(candidates: object) -> tuple[()]:
        raise MemoryError

    with monkeypatch.context() as spoiled:
        spoiled.setattr(groups, "groups", broken)
        with pytest.raises(MemoryError):
            plant_groups(backend)
    assert len(plant_groups(backend)) == 1
