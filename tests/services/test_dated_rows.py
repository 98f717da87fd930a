"""Spells of stiction in calendar time, in the row and in the detail of a stored verdict."""

import json
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from sqlalchemy import Float, Integer
from sqlalchemy.types import TypeEngine

from app.engine.audit import audit
from app.lab.testbench.spells import spell
from app.services.audit_json.models import ReliabilityRow
from app.services.audit_json.rows import FIELDS, new_verdict
from app.services.moments import UTC_CLOCK
from app.storage.tables import verdicts

ORIGIN = datetime(2026, 1, 1, tzinfo=UTC)


@pytest.fixture(scope="module")
def made():
    return spell(0, samples=8000, share=0.25, first=0.4)


@pytest.fixture(scope="module")
def row(made):
    stored = new_verdict(
        audit(made.recording),
        recording=made.recording,
        loop_id=1,
        audit_id=2,
        origin=ORIGIN,
        audited_at=ORIGIN,
        elapsed_s=0.1,
        input_ns=(0, 1),
        begun=ORIGIN,
        newest_ns=None,
        clock=UTC_CLOCK,
    )
    return json.loads("{" + stored.row_json + "}")


def test_row_tells_the_newest_spell_in_calendar_time(made, row):
    assert row["episodes"] == 1
    start = datetime.fromisoformat(row["episode_start"])
    end = datetime.fromisoformat(row["episode_end"])
    length = timedelta(seconds=made.end_s - made.start_s)
    assert abs(start - ORIGIN - timedelta(seconds=made.start_s)) < 0.15 * length
    assert abs(end - ORIGIN - timedelta(seconds=made.end_s)) < 0.15 * length
    assert 0.5 < row["episode_probability"] <= 1.0


def test_reason_carries_the_dates(row):
    assert "short_lived_stiction" in row["reasons"].split(";")
    start, end = (UTC_CLOCK.told(row[f"episode_{side}"]) for side in ("start", "end"))
    assert f"the valve sticks from {start} to {end} (probability " in row["reasons_text"]


def test_row_is_flat_and_names_the_rivals(row):
    assert all(value is None or isinstance(value, (str, int, float)) for value in row.values())
    assert {"rival_winner", "rival_runner_up", "hammerstein_two_rmse", "set_point_activity"} <= set(FIELDS)


@pytest.mark.parametrize(("column", "number"), [(Float, float), (Integer, int)])
def test_numbers_of_a_column_are_of_one_type(column: type[TypeEngine[Any]], number: type) -> None:
    """PostgreSQL's driver takes a chunk's as one array, and none of 1 beside 0.5."""
    fields = {name: field.annotation for name, field in ReliabilityRow.model_fields.items() if name != "audit_id"}
    found = {fields[one.name] for one in verdicts.columns if isinstance(one.type, column) and one.name in fields}
    assert number in found
    assert found <= {number, number | None}
