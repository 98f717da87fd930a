"""Whether a run was given anything new, against what is said of it in words: loop by loop, by all verdicts before."""

import numpy as np
import pytest
from sqlalchemy import Connection, insert

from app.storage import Database, arrivals, loops
from app.storage.tables import audits, verdicts
from app.storage.types import now

RUN = {
    **{"trigger": "nightly", "plant": "p", "state": "done", "config_json": "{}", "config_fingerprint": ""},
    **{"window_h": 24.0, "window_samples": 1000},
}
SAID = {
    **{"samples": 1, "verdict": "stiction", "reliability": "reliable", "engine_version": "", "elapsed_s": 0.0},
    **{"input_fingerprint": "", "config_fingerprint": "", "reasons": "", "reasons_text": ""},
}
PLANTS, RUNS, LOOPS = 20, 5, 6


def told(ends: list[dict[int, int | None]], run: int) -> bool:
    """ends: by run and loop, the newest sample that it was given."""

    def is_new(loop: int) -> bool:
        before = [end for given in ends[:run] if (end := given.get(loop)) is not None]
        end = ends[run][loop]
        return not before or (end is not None and end > max(before))

    return any(is_new(loop) for loop in ends[run])


def test_it_is_what_all_verdicts_before_say(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of some loops nothing is said in a run, or nothing was given; a record may be shorter than before."""
    monkeypatch.setattr(arrivals, "FIRST_FEW", 1)
    random = np.random.default_rng(1)
    answers = set()
    for _ in range(PLANTS):
        with database.write() as connection:
            ends = _plant(connection, random)
            found = [arrivals.anything_new(connection, number) for number in range(1, RUNS + 1)]
            connection.get_transaction().rollback()
        assert found == [told(ends, run) for run in range(RUNS)], ends
        answers |= set(found)
    assert answers == {True, False}


def _plant(connection: Connection, random: np.random.Generator) -> list[dict[int, int | None]]:
    ids = sorted(loops.ensure(connection, (f"L{number}" for number in range(LOOPS))).values())
    ends: list[dict[int, int | None]] = []
    for number in range(1, RUNS + 1):
        asked = [loop for loop in ids if random.random() < 0.8] or ids
        given = {loop: None if random.random() < 0.1 else int(random.integers(1, 4)) for loop in asked}
        ends.append(given)
        connection.execute(insert(audits).values(**RUN, id=number, created_at=now(), total=len(given)))
        rows = [SAID | {"loop_id": loop, "input_end_ns": end, "audit_id": number} for loop, end in given.items()]
        connection.execute(insert(verdicts), [row | {"audited_at": now()} for row in rows])
    return ends
