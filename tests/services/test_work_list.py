"""Since when the same was said of a loop, and how large its stiction is, in a line of the list of work."""

import pytest

from app.services.moments import UTC_CLOCK
from app.services.plant.nights import NIGHTS, Night
from app.services.plant.work_list import _since, _size


def row(verdict="stiction", **told):
    row = {"verdict": verdict, "likely_cause": verdict, "reasons": "", "episode_start": None}
    row |= {"repaired_at": None, "of_before_repair": False}
    return row | {"stiction_S": None, "stiction_S_pct_of_span": None} | told


def said(*verdicts):
    return [Night(f"2026-03-{day:02d}", verdict, "reliable") for day, verdict in enumerate(verdicts, 1)]


@pytest.mark.parametrize(
    ("loop", "last", "since"),
    [
        (row(), said("no_stiction", "stiction", "stiction"), "since 2026-03-02"),
        (row(), said(*["stiction"] * NIGHTS), "since 2026-03-01 or longer"),
        (row(), said("stiction"), "since 2026-03-01"),
        (row(), (), ""),
        (
            row(reasons="stiction_began", episode_start="2026-03-05T04:30:00Z"),
            said("stiction"),
            "since 2026-03-05 04:30",
        ),
        (
            row("not_auditable", likely_cause="stuck_valve_or_dead_transmitter"),
            said("no_stiction", "inconclusive", "not_auditable"),
            "since 2026-03-02",
        ),
        (
            row(repaired_at="2026-03-03T08:00:00Z"),
            said("no_stiction", *["stiction"] * 3),
            "since 2026-03-02, over the repair of 2026-03-03",
        ),
        (row(repaired_at="2026-03-01T08:00:00Z"), said("no_stiction", "stiction"), "since 2026-03-02"),
        (row(repaired_at="2026-03-03T08:00:00Z", of_before_repair=True), said("stiction"), "since 2026-03-01"),
    ],
)
def test_since_when(loop, last, since):
    assert _since(loop, last, UTC_CLOCK) == since


def test_a_size_is_told_of_a_valve_that_sticks_where_it_is_known():
    assert _size(row()) == ""
    assert _size(row(stiction_S=2.468)) == "S 2.47"
    assert _size(row(stiction_S=2.468, stiction_S_pct_of_span=4.94)) == "S 4.9 % of OP's span"
    assert _size(row("inconclusive", stiction_S=2.468)) == ""
