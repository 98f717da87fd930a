"""How a night's end is told."""

from types import SimpleNamespace

import pytest

from app.cli.nightly import watched


@pytest.mark.parametrize(("total", "words"), [(1, "1 loop, 1 with a verdict"), (60, "60 loops, 60 with a verdict")])
def test_a_run_of_one_loop_is_told_of_one(capsys: pytest.CaptureFixture[str], total: int, words: str) -> None:
    backend = SimpleNamespace(settings=SimpleNamespace(embedded=False))
    run = SimpleNamespace(id="1", total=total, done=total, failed=0, ended=True)
    assert watched(backend, run, 1.0) is run
    assert capsys.readouterr().err == f"loopaudit: {words}, 0 failed\n"
