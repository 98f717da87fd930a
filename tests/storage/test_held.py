"""What held before a window: set points and modes that are stored when they change."""

import numpy as np
import pytest
from sqlalchemy import insert

from app.storage import Database, loops, retention, series
from app.storage.samples import Samples
from app.storage.series import Place
from app.storage.steps import last_known
from app.storage.tables import series as series_table
from tests.storage.stored import SECOND, START, add, add_as, first, ramp, steps, window


def test_the_set_point_that_was_received_later_held_before_the_window(database: Database) -> None:
    """Though its stretch was stored first. Of the other one a sample is stored that it does not have."""
    add_as(database, "FIC1", steps("sp", (-9000, 2.0)), Place(2, 1))
    late = steps("sp", (-9500, 3.0), (-9000, 1.0))
    with database.write() as connection:
        values = {"loop_id": 1, "receipt_number": 1, "fingerprint": "late", "packed": late.packed, "samples": 2}
        span = {"start_ns": int(late.time_ns[0]), "end_ns": int(late.time_ns[-1]), **last_known(late)}
        connection.execute(insert(series_table).values(**values, **span))
    add_as(database, "FIC1", ramp(0, 4000), Place(3))
    assert first(window(database, "FIC1", hours=0.5), "sp") == 2.0
    with database.write() as connection:
        retention.drop_series(connection, 1.0, 500, series.EVER_NS)
    assert first(window(database, "FIC1", hours=0.5), "sp") == 2.0


@pytest.mark.parametrize("name", ["sp", "automatic"])
def test_a_window_begins_with_what_held_then(database: Database, name: str) -> None:
    add(database, "FIC1", steps(name, (-9_000_000, 0.0), (-8_000_000, 1.0)))
    add(database, "FIC1", ramp(0, 4000))
    add(database, "FIC1", steps(name, (-8_500_000, 0.0)))  # sent later, but older
    found = window(database, "FIC1", hours=0.5)
    assert first(found, name) == 1.0
    assert np.isnan(found.signals[name][1:]).all()


@pytest.mark.parametrize(("hold_days", "held"), [(2.0, 40.0), (1.99, None)])
def test_what_was_stated_longer_before_than_it_holds_is_not_known(
    database: Database, hold_days: float, held: float | None
) -> None:
    add(database, "FIC1", steps("sp", (-2 * 86_400, 40.0)))
    add(database, "FIC1", ramp(0, 4000))
    with database.read() as connection:
        (found,) = series.windows(
            connection, loops.ids_of(connection, ["FIC1"]).values(), 24.0, 10**6, hold_days=hold_days
        ).values()
    assert found.signals.get("sp", [None])[0] == held


def test_what_held_is_found_in_a_stretch_that_reaches_into_the_window(database: Database) -> None:
    add(database, "FIC1", steps("sp", (-900, 40.0), (100, 41.0), (3900, 42.0)), ramp(0, 4000))
    add(database, "FIC1", steps("sp", (-500, 40.5)))
    assert first(window(database, "FIC1", hours=0.5), "sp") == 41.0
    assert first(window(database, "FIC1", most=3950), "sp") == 40.5
    assert first(window(database, "FIC1", most=50), "sp") == 42.0


def test_a_value_of_its_own_is_not_replaced_and_what_comes_later_holds_only_later(database: Database) -> None:
    known = ramp(0, 100)
    add(database, "FIC1", steps("sp", (-10, 1.0)))
    add(database, "FIC1", Samples(known.time_ns, {**known.signals, "sp": np.full(100, 7.0)}))
    add(database, "FIC2", ramp(0, 100), steps("sp", (50, 3.0)))
    assert (window(database, "FIC1", hours=99 / 3600).signals["sp"] == 7.0).all()
    assert np.isnan(first(window(database, "FIC2"), "sp"))
    assert "automatic" not in window(database, "FIC2").signals


def test_of_two_values_for_one_time_the_later_one_held(database: Database) -> None:
    add(database, "FIC1", steps("sp", (-9000, 1.0)))
    add(database, "FIC1", steps("sp", (-9000, 2.0)))
    add(database, "FIC1", ramp(0, 100))
    assert first(window(database, "FIC1", hours=0.02), "sp") == 2.0


@pytest.mark.parametrize("values", [(50.0, 40.0), (40.0, 50.0)])
def test_what_held_was_corrected_in_a_stretch_that_is_not_read(database: Database, values: tuple[float, float]) -> None:
    reaching = steps("sp", (100, values[0]), (3900, 60.0))
    add(database, "FIC1", reaching, steps("sp", (100, values[1])), ramp(0, 4000))
    assert first(window(database, "FIC1", hours=0.5), "sp") == values[1]
    add(database, "FIC2", steps("sp", (100, values[0])))
    add(database, "FIC2", steps("sp", (100, values[1]), (3900, 60.0)), ramp(0, 4000))
    assert first(window(database, "FIC2", hours=0.5), "sp") == values[1]


@pytest.mark.parametrize("name", ["sp", "automatic"])
def test_what_still_holds_outlives_retention(database: Database, name: str) -> None:
    add(database, "FIC1", steps(name, (-9000, 0.0)))
    add(database, "FIC1", steps(name, (-8000, 1.0)))
    add(database, "FIC1", steps(name, (-8000, 2.0)))
    add(database, "FIC1", ramp(-8500, -7900))
    add(database, "FIC1", ramp(0, 4000), steps(name, (3900, 3.0)))  # what was known before is needed for what is kept
    with database.write() as connection:
        assert retention.drop_series(connection, 1.0, 500, series.EVER_NS) == 3
        assert retention.drop_series(connection, 1.0, 500, series.EVER_NS) == 0
    assert first(window(database, "FIC1", hours=0.5), name) == 2.0


def test_a_stretch_that_is_asked_for_begins_with_what_held_then(database: Database) -> None:
    add(database, "FIC1", steps("sp", (-9000, 5.0)), ramp(0, 100))
    with database.read() as connection:
        loop_id = loops.ids_of(connection, ["FIC1"])["FIC1"]
        found = series.between(connection, loop_id, (START + 20) * SECOND, (START + 30) * SECOND)
        before = series.between(connection, loop_id, (START - 10_000) * SECOND, (START - 9500) * SECOND)
    assert found is not None
    assert first(found, "sp") == 5.0
    assert len(found) == 11
    assert before is None
