"""Loops whose set points move at the same times are told so, and not sent to look for what shakes them."""

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from app.engine.plant_wide.set_points import BIN_NS, Moves, moves_in, together
from app.services.backend import Backend
from app.services.outward import GroupMemberOut
from app.services.plant import groups, set_points
from app.services.plant.groups import _asked_of_set_points
from app.services.plant.set_points import set_points_together
from app.storage import loops, series
from app.storage.samples import DamagedStretchError, Samples
from app.storage.series import Stretch
from tests.services.conftest import MINUTE, START_NS
from tests.told_groups import group_of

HOURS = 20
ASKED_OF_NOBODY: Any = SimpleNamespace(database=SimpleNamespace(read=nullcontext))
AT, ELSEWHERE = [1, 4, 7, 11, 15, 18], [2, 5, 9, 12, 16, 19]


def recorded(hours: list[int], size: float = 1.0, late: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Minute by minute, a set point that goes up and down by turns at these hours."""
    steps = np.zeros(60 * HOURS)
    steps[[60 * hour + 7 for hour in hours]] = size * (-1.0) ** np.arange(len(hours))
    times = START_NS // BIN_NS * BIN_NS + late * MINUTE + np.arange(60 * HOURS, dtype=np.int64) * MINUTE
    return times, 50.0 + np.cumsum(steps)


def moved_at(hours: list[int], size: float = 1.0, late: int = 0) -> Moves | None:
    return moves_in(*recorded(hours, size, late))


@pytest.mark.parametrize(
    ("others", "said"),
    [
        ([moved_at(AT, 5.0), moved_at(AT, -0.2)], True),
        ([moved_at(AT, late=1), moved_at(ELSEWHERE)], True),
        ([moved_at(ELSEWHERE), moved_at([3, 6, 10, 13])], False),
        ([moved_at(AT, late=60 * HOURS), moved_at([])], False),
        ([moved_at(AT[:2]), moved_at(AT[:2])], False),
    ],
    ids=["all", "most", "each by itself", "not of one time", "hardly any moves"],
)
def test_set_points_that_move_at_the_same_times(others: list[Moves | None], said: bool) -> None:
    assert together([moved_at(AT), *others]) is said
    assert together([*others, moved_at(AT)]) is said


def test_a_member_without_a_set_point_counts_as_one_that_does_not_move() -> None:
    assert together([moved_at(AT), moved_at(AT), None, None])
    assert not together([moved_at(AT), moved_at(AT), None, None, None])
    assert not together([])


def test_scale_offset_and_sign_of_a_set_point_change_nothing() -> None:
    times, sp = recorded(AT)
    assert together([moves_in(times, sp), moves_in(times, 1e6 - 300.0 * sp)])


def test_samples_are_read_for_groups_without_a_source(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    with backend.database.write() as connection:
        ids = loops.ensure(connection, ["A", "B", "C"])
        for tag, hours in (("A", AT), ("B", AT), ("C", ELSEWHERE)):
            times, sp = recorded(hours)
            series.add(connection, [Stretch(ids[tag], Samples(times, {"pv": sp, "op": sp, "sp": sp}))], None)
    assert set_points_together(backend, ["A", "B"])
    assert not set_points_together(backend, ["A", "C"])
    pair = [GroupMemberOut(tag, None, 0.1, 0.0, 1.0, None, None, True) for tag in "AB"]
    found = [
        group_of("1", 300.0, True, False, 0.001, None, pair),
        group_of("2", 300.0, True, False, 0.001, "A", pair),
        group_of("3", 300.0, True, True, 0.9, None, pair),
    ]
    assert [group.set_points_together for group in _asked_of_set_points(backend, found)] == [True, False, False]
    monkeypatch.setattr(groups, "LOOKED_INTO", 0)
    assert not any(group.set_points_together for group in _asked_of_set_points(backend, found))


def test_a_sample_ahead_of_the_clock_hides_no_set_point(backend: Backend) -> None:
    with backend.database.write() as connection:
        ids = loops.ensure(connection, ["A", "B"])
        for tag in ids:
            times, sp = recorded(AT)
            stray = np.append(times, 2_000_000_000 * 10**9), np.append(sp, sp[-1])
            given = stray if tag == "A" else (times, sp)
            signals = dict.fromkeys(("pv", "op", "sp"), given[1])
            series.add(connection, [Stretch(ids[tag], Samples(given[0], signals))], None)
    assert set_points_together(backend, ["A", "B"])


def test_of_a_large_group_some_are_asked_and_of_these_the_newest_day(monkeypatch: pytest.MonkeyPatch) -> None:
    end_ns, asked = START_NS + 10**15, []
    times, sp = recorded(AT)
    read = SimpleNamespace(time_ns=times, signals={"sp": sp})

    def between(_: Any, loop_id: int, first_ns: int, last_ns: int) -> Any:
        asked.append((loop_id, last_ns, last_ns - first_ns))
        return read

    row = SimpleNamespace(id=7, newest_ns=end_ns)
    monkeypatch.setattr(set_points, "loops", SimpleNamespace(by_tag=lambda _, tag: row))
    newest = {"newest_before": lambda *_: end_ns, "between": between}
    monkeypatch.setattr(set_points, "series", SimpleNamespace(**newest))
    assert set_points_together(ASKED_OF_NOBODY, [f"FIC{number}" for number in range(40)])
    assert asked == [(7, end_ns, 24 * 60 * MINUTE)] * 12


def test_set_points_that_cannot_be_read_are_not_said_to_move_together(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def damaged(*_: Any) -> Moves:
        raise DamagedStretchError("stretch 3 of the stored samples cannot be read")

    monkeypatch.setattr(set_points, "_moves_of", damaged)
    assert set_points_together(ASKED_OF_NOBODY, ["A", "B"]) is False
    assert "set points of ['A', 'B'] cannot be read" in caplog.text
