"""Whether an SQLite file is written as its SQLite can be trusted with."""

import pytest

from app.storage import health
from app.storage.health import Integrity


@pytest.mark.parametrize(
    ("written", "safe", "unsafe"), [("wal", "WAL", False), ("wal", "TRUNCATE", True), ("truncate", "TRUNCATE", False)]
)
def test_a_file_that_is_written_ahead_is_unsafe_where_sqlite_may_lose_data_by_it(
    monkeypatch: pytest.MonkeyPatch, written: str, safe: str, unsafe: bool
) -> None:
    monkeypatch.setattr(health, "journal_mode", lambda: safe)
    assert Integrity(written, None, None).unsafe is unsafe
