"""What a verdict rests on, packed."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any

import pytest
from zstandard import ZstdError

from app.storage.details import _unpacked, pack_detail
from app.storage.documents import Document, pack_document, told_of

TOLD = {"spectra": {"pv": [n / 7 for n in range(40)]}, "reasons": ["Öl", None]}


@pytest.mark.parametrize(
    ("packed", "read"),
    [(pack_detail(TOLD), _unpacked), (pack_document(Document(TOLD)), told_of)],
    ids=["detail", "document"],
)
def test_what_was_damaged_is_never_taken_for_what_was_written(packed: bytes, read: Callable[[bytes], Any]) -> None:
    assert read(packed) == TOLD
    taken = []
    for place in range(len(packed)):
        damaged = bytearray(packed)
        damaged[place] ^= 1
        with suppress(ZstdError, ValueError):
            taken.append(read(bytes(damaged)))
    assert [one for one in taken if one != TOLD] == []


def test_details_are_packed_by_several_threads_at_a_time() -> None:
    told = [{"values": [n] * 20_000, "of": n} for n in range(40)]
    with ThreadPoolExecutor(8) as threads:
        assert [_unpacked(packed) for packed in threads.map(pack_detail, told)] == told
