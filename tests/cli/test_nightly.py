"""How a night's end is told."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from sqlalchemy.exc import OperationalError

from app import kernel_cache
from app.cli import nightly
from app.cli.nightly import watched
from app.errors import RequestError
from app.services.auditing import audits


@pytest.mark.parametrize(("total", "words"), [(1, "1 loop, 1 with a verdict"), (60, "60 loops, 60 with a verdict")])
def test_a_run_of_one_loop_is_told_of_one(capsys: pytest.CaptureFixture[str], total: int, words: str) -> None:
    backend = SimpleNamespace(settings=SimpleNamespace(embedded=False))
    run = SimpleNamespace(id="1", total=total, done=total, failed=0, ended=True)
    assert watched(backend, run, 1.0) is run
    assert capsys.readouterr().err == f"loopaudit: {words}, 0 failed\n"


def test_a_data_base_that_is_away_meanwhile_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """As long as the command waits: the run goes on when it is back."""
    away = OperationalError("SELECT", {}, Exception("connection refused"))
    ended = SimpleNamespace(id="1", total=1, done=1, failed=0, ended=True)
    found = iter([away, away, ended])

    def get(*_: object) -> SimpleNamespace:
        if isinstance(it := next(found), Exception):
            raise it
        return it

    monkeypatch.setattr(audits, "get_audit", get)
    monkeypatch.setattr(nightly, "LOOK_S", 0.0)
    backend = SimpleNamespace(settings=SimpleNamespace(embedded=False))
    begun = SimpleNamespace(id="1", total=1, done=0, failed=0, ended=False)
    assert watched(backend, begun, 60.0) is ended
    found = iter([away] * 9)
    with pytest.raises(OperationalError):
        watched(backend, begun, 0.5)


def test_who_waits_for_the_engine_says_for_whom_and_no_more_than_is_known(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Who holds the cache may compile or load, and be another plant's."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    backend = SimpleNamespace(settings=SimpleNamespace(embedded=True))
    begun = SimpleNamespace(id="1", total=1, done=0, failed=0, ended=False)
    told = "another process of this account, which compiles or loads the engine"
    with kernel_cache.one_at_a_time(), pytest.raises(RequestError, match="still compiles or loads the engine"):
        watched(backend, begun, 0.3)
    assert f"waiting for {told}" in capsys.readouterr().err
