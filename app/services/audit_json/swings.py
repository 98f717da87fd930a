"""What is kept of an oscillation, between the engine and a few hundred characters of JSON."""

import json
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from app.engine.plant_wide.groups import Candidate
from app.engine.plant_wide.swing import Swing
from app.json_texts import short_json
from app.services.moments import FIRST_DATED

if TYPE_CHECKING:  # an audit of files stores nothing
    from app.storage.verdicts import SwingRow

STEPS = 999


def as_json(swing: Swing, origin_s: float) -> str:
    """`origin_s`: the instant of the recording's second 0, in s since 1970. Three digits are enough to compare."""
    lines = swing.lines / max(float(np.max(np.abs(swing.lines))), 1e-300)
    told = {
        "start_s": round(origin_s + swing.start_s, 3),
        "length_s": swing.length_s,
        "period_s": swing.period_s,
        "strength": round(swing.strength, 4),
        "regularity": round(swing.regularity, 4),
        "first_line": swing.first_line,
        "re": _steps(lines.real),
        "im": _steps(lines.imag),
        "bands": _steps(swing.bands),
    }
    return short_json(told).decode()


def from_json(text: str) -> Swing:
    told = json.loads(text)
    lines = (np.array(told.pop("re"), float) + 1j * np.array(told.pop("im"), float)) / STEPS
    bands = np.array(told.pop("bands"), float) / STEPS
    return Swing(**told, lines=lines / np.linalg.norm(lines), bands=bands)


def candidate(tag: str, swing: Swing, stiction_probability: float | None, start_s: float) -> Candidate:
    """Of an audit that is not stored: as it would come back from there, so that the same loops are in step."""
    return Candidate(tag, from_json(as_json(swing, start_s)), stiction_probability)


def candidates(rows: Iterable["SwingRow"]) -> list[Candidate]:
    """Those on the clock of all: records without a date are in step with others by nothing but the start that they were
    given."""
    found = [Candidate(row.tag, from_json(row.swing_json), row.stiction_probability, row.unit) for row in rows]
    return [one for one in found if one.swing.start_s >= FIRST_DATED.timestamp()]


def _steps(values: Any) -> list[int]:
    return [round(STEPS * float(value)) for value in values]
