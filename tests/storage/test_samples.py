"""Samples packed and laid over each other: nothing changes on the way, and nothing by sending again."""

import json

import numpy as np
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from app.storage.coding import coded, coded_each, decoded, shuffled
from app.storage.samples import (
    HEADER,
    DamagedStretchError,
    Samples,
    compared,
    merged,
    news,
    pack,
    prepare,
    unpack,
    unpack_stored,
)

SECOND = 1_000_000_000


def samples(seconds: list[int], **signals: list[float]) -> Samples:
    return Samples(np.array(seconds, np.int64) * SECOND, {k: np.array(v, float) for k, v in signals.items()})


def same(a: Samples, b: Samples) -> bool:
    return (
        np.array_equal(a.time_ns, b.time_ns)
        and set(a.signals) == set(b.signals)
        and all(np.array_equal(a.signals[k], b.signals[k], equal_nan=True) for k in a.signals)
    )


values = st.floats(allow_nan=True, allow_infinity=True, width=64)
SIGNAL_VALUES = values | st.integers(-(2**33), 2**33).map(lambda whole: whole / 1000) | st.just(-0.0)


@given(
    st.lists(st.integers(-(2**61), 2**61), min_size=0, max_size=50, unique=True).flatmap(
        lambda times: st.tuples(st.just(sorted(times)), arrays(np.float64, (2, len(times)), elements=values))
    )
)
def test_unpack_gives_what_pack_got(drawn: tuple[list[int], np.ndarray]) -> None:
    times, both = drawn
    before = Samples(np.array(times, np.int64), {"pv": both[0], "tag:FT 1": both[1]})
    after = unpack(pack(before))
    assert same(before, after)
    again = unpack(pack(after))
    assert again.fingerprint == after.fingerprint  # of the first, -0.0 and the bits of a NaN may differ


def test_a_day_of_a_loop_is_small() -> None:
    rng = np.random.default_rng(1)
    n = 1440
    pv, op = np.round(50 + np.cumsum(rng.normal(size=(2, n)), axis=1), 2)
    day = Samples(np.arange(n, dtype=np.int64) * 60 * SECOND, {"pv": pv, "op": op, "sp": np.full(n, 50.0)})
    assert len(pack(day)) < 24 * n / 1.8


def test_an_unknown_format_is_refused() -> None:
    packed = bytearray(pack(samples([1], pv=[1.0])))
    packed[0] = 99
    with pytest.raises(ValueError, match="format 99"):
        unpack(bytes(packed))


def test_a_damaged_stretch_is_told_by_its_number() -> None:
    whole = samples([1, 2, 3], pv=[1, 2, 3], op=[10, 20, 30])
    again = unpack_stored(7, whole.packed)
    assert same(again, whole)
    head = json.dumps({"pv": "d"}).encode()
    short = HEADER.pack(2, 3, len(head)) + head + zstandard.ZstdCompressor().compress(bytes(24))
    for damaged in (b"", whole.packed[:4], whole.packed[:20], whole.packed[:-3], bytes(90), short):
        with pytest.raises(DamagedStretchError, match="stretch 7 of the stored samples cannot be read"):
            unpack_stored(7, damaged)


def test_a_byte_of_the_samples_that_is_another_is_noticed() -> None:
    pv = np.random.default_rng(1).normal(size=50)  # which cannot be pressed: the frame has the bytes as they are
    packed = samples(list(range(50)), pv=list(pv)).packed
    start = HEADER.size + HEADER.unpack_from(packed)[2]
    for place in range(start, len(packed)):
        other = bytearray(packed)
        other[place] ^= 1
        with pytest.raises(DamagedStretchError):
            unpack_stored(7, bytes(other))


def test_a_size_beyond_all_memory_is_damage(monkeypatch: pytest.MonkeyPatch) -> None:
    def exhausted(packed: bytes) -> Samples:
        raise MemoryError

    monkeypatch.setattr("app.storage.samples.unpack", exhausted)
    with pytest.raises(DamagedStretchError, match="stretch 7"):
        unpack_stored(7, b"")


def test_a_frame_without_a_checksum_is_read() -> None:
    whole = samples([1, 2, 3], pv=[1, 2, 3])
    start = HEADER.size + HEADER.unpack_from(whole.packed)[2]
    body = zstandard.ZstdDecompressor().decompress(whole.packed[start:])
    assert same(unpack(whole.packed[:start] + zstandard.ZstdCompressor().compress(body)), whole)


def test_the_later_value_holds_and_a_missing_one_hides_nothing() -> None:
    first = samples([1, 2, 3], pv=[1, 2, 3], op=[10, 20, 30])
    second = samples([2, 3, 4], pv=[2.5, np.nan, 4], sp=[5, 5, 5])
    expected = samples([1, 2, 3, 4], pv=[1, 2.5, 3, 4], op=[10, 20, 30, np.nan], sp=[np.nan, 5, 5, 5])
    assert same(merged([first, second]), expected)


def test_news_are_new_times_new_signals_and_other_values() -> None:
    stored = samples([1, 2, 3], pv=[1, 2, 3], op=[1, np.nan, 3])
    sent = samples([1, 2, 3, 4], pv=[1, 2, 3.5, 4], op=[np.nan, 7, 3, 4])
    assert list(news(sent, stored)) == [False, True, True, True]
    assert not news(stored, stored).any()
    assert list(news(samples([1], sp=[9]), stored)) == [True]


def test_another_value_replaces_one_and_a_value_where_none_was_is_new() -> None:
    stored = samples([1, 2, 3], pv=[1, 2, 3], op=[1, np.nan, 3])
    sent = samples([1, 2, 3, 4], pv=[np.nan, 2, 3.5, 4], op=[1, 7, np.nan, 4], sp=[5, 5, 5, 5])
    found = compared(sent, stored)
    assert list(found.other) == [False, False, True, False]
    assert list(found.new) == [True, True, False, True]
    assert not any(which.any() for which in compared(stored, stored))
    assert [list(which) for which in compared(sent, samples([]))] == [[True] * 4, [False] * 4]


@given(st.lists(st.lists(st.integers(0, 20), min_size=1, max_size=8, unique=True), min_size=1, max_size=5))
def test_laying_news_over_the_stored_is_laying_all_of_it(drawn: list[list[int]]) -> None:
    stored: list[Samples] = []
    sent: list[Samples] = []
    for number, seconds in enumerate(drawn):
        stretch = samples(sorted(seconds), pv=[number % 3] * len(seconds))
        sent.append(stretch)
        fresh = stretch if not stored else stretch.part(news(stretch, merged(stored)))
        if len(fresh):
            stored.append(fresh)
    assert same(merged(stored), merged(sent))


@pytest.mark.parametrize(
    ("values", "coding"),
    [
        ([1.0, 2.0, np.nan], "0"),
        ([12.345, -0.1, 99.999, np.nan], "3"),
        ([0.1, 1e300], "d"),
        ([3e9, 1.5], "f"),
        ([float(np.float32(0.1)), 7.0], "f"),
        ([np.pi, 1.0], "d"),
        ([np.inf, 1.0], "f"),
        ([np.nan, np.nan], "0"),
        ([0.1 + 0.2], "d"),
    ],
)
def test_a_signal_is_written_in_the_fewest_bytes_that_give_it_again(values: list[float], coding: str) -> None:
    given = np.array(values)
    found, raw = coded(given)
    assert found == coding
    assert np.array_equal(decoded(found, raw), given, equal_nan=True)


@given(st.lists(st.lists(SIGNAL_VALUES, min_size=3, max_size=3) | st.lists(SIGNAL_VALUES, max_size=2), max_size=60))
def test_signals_together_are_written_as_each_alone(drawn: list[list[float]]) -> None:
    given = [np.array(values, dtype=np.float64) for values in drawn]
    assert list(coded_each(given)) == [coded(values) for values in given]


def test_a_value_between_those_that_are_probed_has_more_decimals() -> None:
    rows = np.full((30, 1440), 12.5)
    rows[3, 1], rows[4, 1], rows[5, 1], rows[6, 1] = 0.0625, np.pi, np.nan, 3e9
    assert {coding for coding, _ in coded_each(rows)} == {"1", "4", "d", "f"}
    assert list(coded_each(rows)) == [coded(values) for values in rows]


def test_prepared_samples_are_packed_as_each_alone() -> None:
    day = np.arange(5) / 8
    batch = [samples([1, 2, 3, 4, 5], pv=day), samples([1], pv=[7], sp=[1]), Samples(np.arange(2), {})]
    alone = [(pack(it), Samples(it.time_ns, it.signals).fingerprint) for it in batch]
    prepare(batch)
    assert [(vars(it)["packed"], vars(it)["fingerprint"]) for it in batch] == alone


def test_samples_of_the_format_before_are_read() -> None:
    time_ns, pv = np.array([5, 7, 11]), np.array([1.25, np.nan, 3.0])
    names = b'["pv"]'
    body = shuffled(np.diff(time_ns, prepend=0)) + shuffled(pv)
    after = unpack(HEADER.pack(1, 3, len(names)) + names + zstandard.ZstdCompressor().compress(body))
    assert after.time_ns.tolist() == [5, 7, 11]
    assert np.array_equal(after.signals["pv"], pv, equal_nan=True)
