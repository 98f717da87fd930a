"""What a worker has loaded is not looked through for garbage again and again."""

import gc
from pathlib import Path
from types import SimpleNamespace

import pytest

from app.settings import Settings
from workers import process


def test_what_is_loaded_before_the_first_task_is_frozen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    settings = Settings(data_dir=tmp_path)
    monkeypatch.setattr(process, "current_app", SimpleNamespace(settings=settings))
    loaded: list[list[None]] = []
    monkeypatch.setattr(process, "_load", lambda: loaded.extend([None] for _ in range(10_000)))
    before = gc.get_freeze_count()
    try:
        process.warm_up(SimpleNamespace())
        assert gc.get_freeze_count() >= before + len(loaded) > before
    finally:
        gc.unfreeze()
