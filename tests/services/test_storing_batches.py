"""Batches of an upload are read, prepared and written side by side, and nothing of it goes on when one cannot be."""

import gc
import threading
from collections.abc import Iterator
from contextlib import closing
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from app.ingest import LoopSamples
from app.services.intake import reading
from app.storage.uploads import ReadingClaim

BACKEND: Any = SimpleNamespace(settings=SimpleNamespace(lease_s=1.0))
CLAIM: Any = ReadingClaim.__new__(ReadingClaim)


class Batches:
    """A loop a batch; notes how many were read and whether reading has ended."""

    def __init__(self, count: int) -> None:
        self.count, self.read, self.ended = count, 0, False

    def __iter__(self) -> Iterator[list[LoopSamples]]:
        try:
            for number in range(self.count):
                self.read += 1
                yield [LoopSamples(f"L{number}", np.arange(3), np.ones(3), np.ones(3), None, None, {}, ())]
        finally:
            self.ended = True


def threads() -> set[str]:
    return {thread.name for thread in threading.enumerate() if "ing_" in thread.name}


def test_batches_are_written_in_their_order_and_each_once(monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[str] = []
    samples: list[int] = []

    def store(_: Any, __: Any, batch: list[reading.Prepared], ___: Any) -> None:
        written.extend(it.loop for it in batch)
        samples.extend(len(it.samples) for it in batch)

    monkeypatch.setattr(reading, "_store", store)
    reading._store_all(BACKEND, CLAIM, iter(Batches(9)), {})
    assert samples == [3] * 9
    assert written == [f"L{number}" for number in range(9)]


def test_a_lost_claim_ends_reading_and_leaves_neither_thread_nor_file(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []

    def store(*_: Any) -> None:
        calls.append(1)
        if len(calls) == 2:
            raise reading.ClaimLostError

    monkeypatch.setattr(reading, "_store", store)
    before, batches = threads(), Batches(50)
    gc.disable()  # what holds files must go by itself, not with the next collection
    try:
        with closing(iter(batches)) as read, pytest.raises(reading.ClaimLostError):
            reading._store_all(BACKEND, CLAIM, read, {})
        assert batches.ended
    finally:
        gc.enable()
    assert batches.read <= 2 + reading.BATCHES_AHEAD + 1
    assert threads() == before


def test_an_error_of_reading_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "_store", lambda *_: None)

    def broken() -> Iterator[list[LoopSamples]]:
        yield from Batches(1)
        raise OSError("the disk is gone")

    with pytest.raises(OSError, match="disk is gone"):
        reading._store_all(BACKEND, CLAIM, broken(), {})
    assert not threads()
