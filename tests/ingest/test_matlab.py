"""The International Stiction Data Base's MATLAB form, as scipy writes it, and files that claim what they have not."""

import io
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from app.errors import DataError
from app.ingest import IngestOptions, inspect, read_recordings

from .conftest import Read

SAMPLES = 40


def matlab(variables: dict[str, Any], **options: Any) -> bytes:
    target = io.BytesIO()
    savemat(target, variables, **options)
    return target.getvalue()


def loop(samples: int = SAMPLES, **fields: Any) -> dict[str, Any]:
    """A loop with the fields that the database's description lists."""
    time = np.arange(samples)
    told = {"Comments": "sticky, said the plant", "Type": 0, "Ts": 2.0, "t": time[:, None] * 2.0}
    signals = {"SP": np.full((samples, 1), 50.0), "PV": np.sin(time)[:, None], "OP": np.cos(time)[:, None]}
    return {**told, **signals, "en": signals["SP"] - signals["PV"], "Kc": 0.5, "Ti": 30.0, **fields}


def isdb() -> dict[str, Any]:
    chemicals = {"loop1": loop(), "loop19": loop(70, Ts=12.0, t=np.array([]))}
    return {"cdata": {"chemicals": chemicals, "pulpPapers": {"loop2": loop()}, "glass": {"loop4": loop()}}}


@pytest.mark.parametrize("packed", [True, False])
def test_the_data_base_has_its_loops_under_the_names_they_are_cited_by(read: Read, packed: bool) -> None:
    content = read(matlab(isdb(), do_compression=packed), name="isdb.mat")
    assert set(content.loops) == {"CHEM1", "CHEM19", "PAP2", "glass.loop4"}
    assert (content.summary.layout, content.summary.encoding) == ("isdb_matlab", "matlab")
    first, other = content.loops["CHEM1"], content.loops["CHEM19"]
    assert np.diff(first.time_ns).tolist() == [2 * 10**9] * (SAMPLES - 1)
    assert np.diff(other.time_ns).tolist() == [12 * 10**9] * 69
    assert first.pv is not None
    assert first.pv.tolist() == pytest.approx(np.sin(np.arange(SAMPLES)))
    assert first.op is not None
    assert first.op.tolist() == pytest.approx(np.cos(np.arange(SAMPLES)))
    assert first.sp is not None
    assert set(first.sp.tolist()) == {50.0}
    assert content.rejects.total == 0


def test_recordings_of_several_loops(tmp_path: Path) -> None:
    path = tmp_path / "isdb.mat"
    path.write_bytes(matlab(isdb()))
    names = {recording.name: recording.samples for recording in read_recordings(path).recordings}
    assert names == {"isdb:CHEM19": 70, "isdb:CHEM1": SAMPLES, "isdb:PAP2": SAMPLES, "isdb:glass.loop4": SAMPLES}


def test_variables_at_the_top_are_one_loop_named_by_the_file(read: Read) -> None:
    values = {"PV": np.arange(9, dtype=np.int16), "op": np.arange(9, dtype=np.float32), "Ts": 1, "SP": 4}
    found = read(matlab(values), name="FIC101.mat").loops["FIC101"]
    assert found.pv is not None
    assert found.pv.tolist() == list(range(9))
    assert found.sp is not None
    assert found.sp.tolist() == [4.0] * 9


EPOCH_S = 1_709_438_700.0


@pytest.mark.parametrize(
    ("times", "note"),
    [
        (EPOCH_S / 86_400 + 719_529 + np.arange(200) / 86_400, "days since year 0, as MATLAB counts them"),
        (EPOCH_S / 86_400 + 25_569 + np.arange(200) / 86_400, "days since 1899-12-30"),
        (EPOCH_S + np.arange(200), None),
        (1e3 * (EPOCH_S + np.arange(200)), None),
    ],
)
def test_times_that_count_from_a_date(read: Read, times: Any, note: str | None) -> None:
    content = read(matlab({"t": times, "PV": np.sin(np.arange(200)), "OP": np.cos(np.arange(200))}), name="A.mat")
    assert content.loops["A"].time_ns.tolist() == [int(EPOCH_S + i) * 10**9 for i in range(200)]
    assert not any("relative to a start" in told for told in content.summary.notes)
    assert note is None or any(note in told for told in content.summary.notes)


def test_days_since_year_0_are_of_the_clock_on_the_wall(read: Read) -> None:
    days = EPOCH_S / 86_400 + 719_529 + np.arange(50) / 86_400
    data = matlab({"time": days, "PV": np.sin(np.arange(50)), "OP": np.cos(np.arange(50))})
    berlin = IngestOptions(time_zone="Europe/Berlin")
    assert read(data, name="A.mat", options=berlin).loops["A"].time_ns[0] == int(EPOCH_S - 3600) * 10**9


@pytest.mark.parametrize("mode", [np.arange(40) >= 25, (np.arange(40) >= 25).astype(float), 0.0])
def test_the_mode_is_read_as_that_of_a_table(read: Read, mode: Any) -> None:
    loops = {"FIC1": loop(MODE=mode), "FIC2": loop()}
    content = read(matlab({"plant": loops}))
    assert content.loops["plant.FIC1"].automatic.tolist() == np.broadcast_to(mode, 40).astype(float).tolist()
    assert content.loops["plant.FIC2"].automatic is None


def test_an_array_of_structures_is_numbered(read: Read) -> None:
    plant = np.array([(np.arange(5.0), np.arange(5.0), 1.0)] * 2, dtype=[("PV", "O"), ("OP", "O"), ("Ts", "O")])
    assert set(read(matlab({"loops": plant})).loops) == {"loops1", "loops2"}


def test_the_other_order_of_bytes(read: Read) -> None:
    data = bytearray(matlab({"PV": np.zeros(2), "OP": np.ones(2), "Ts": 1.0}))
    swapped = b"".join(struct.pack(">I", word) for (word,) in struct.iter_unpack("<I", data[128:]))
    # The names stand as bytes, and numbers of eight bytes have their halves the other way round.
    for name in (b"VP\0\0", b"PO\0\0", b"sT\0\0"):
        swapped = swapped.replace(name[:0] + name[2:] + name[:2], name[1::-1] + name[2:])
    for words in (b"\0\0\0\0\x3f\xf0\0\0",):
        swapped = swapped.replace(words, words[4:] + words[:4])
    found = read(bytes(data[:124]) + b"\x01\x00MI" + swapped, name="A.mat").loops["A"]
    assert found.op is not None
    assert found.op.tolist() == [1.0, 1.0]


def test_what_is_no_loop_is_left_out_and_said(read: Read) -> None:
    broken = {"PV": np.arange(5.0), "OP": np.arange(4.0), "Ts": 1.0}
    timeless = {"PV": np.arange(5.0), "OP": np.arange(5.0), "t": [3.0, 2.0, 1.0, 0.0, 0.0]}
    wordy = {"PV": "ten", "OP": np.arange(5.0), "Ts": 1.0}
    content = read(matlab({"a": loop(), "b": broken, "c": timeless, "d": wordy, "e": {"x": 1}}))
    assert set(content.loops) == {"a"}
    notes = " ".join(content.summary.notes)
    assert "b was left out: PV and OP must be two columns of numbers of one length, got 5 values and 4 values" in notes
    assert "c was left out: it has no sampling period" in notes
    assert "d was left out: PV and OP must be two columns of numbers of one length, got no numbers" in notes


def test_a_set_point_of_another_length_is_no_set_point(read: Read) -> None:
    assert read(matlab({"a": loop(SP=np.arange(7.0))})).loops["a"].sp is None


def test_cells_handles_texts_and_complex_numbers_are_passed_over(read: Read) -> None:
    odd = loop(cells=np.array([1, "two"], dtype=object), z=np.array([1j]), grid=np.ones((2, 3)), none=np.array([]))
    assert set(read(matlab({"a": odd, "text": "x"})).loops) == {"a"}


@pytest.mark.parametrize("kind", [3, 5, 16, 17])
def test_an_object_or_a_handle_beside_the_loops_is_passed_over(read: Read, kind: int) -> None:
    array = element(14, flags(kind) + element(5, struct.pack("<2i", 1, 1)) + element(1, b"f"))
    assert set(read(matlab({"a": loop()}) + array).loops) == {"a"}


def element(kind: int, body: bytes) -> bytes:
    return struct.pack("<II", kind, len(body)) + body + b"\0" * (-len(body) % 8)


def flags(kind: int) -> bytes:
    return element(6, struct.pack("<II", kind, 0))


def head(kind: int, *sizes: int) -> bytes:
    return flags(kind) + element(5, struct.pack(f"<{len(sizes)}i", *sizes)) + element(1, b"a")


def file_of(*elements: bytes) -> bytes:
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + b"".join(elements)


def nested(depth: int) -> bytes:
    inner = element(14, head(6, 1, 1) + element(9, struct.pack("<d", 1.0)))
    for _ in range(depth):
        inner = element(14, head(2, 1, 1) + element(5, struct.pack("<i", 2)) + element(1, b"a\0") + inner)
    return inner


def structure(count: int, name_size: int, names: bytes) -> bytes:
    return element(14, head(2, 1, count) + element(5, struct.pack("<i", name_size)) + element(1, names))


HOSTILE = {
    "nothing in it": (file_of(), "unknown_layout"),
    "no loop in it": (file_of(nested(2)), "unknown_layout"),
    "an array of no bytes": (file_of(element(14, b"")), "unknown_layout"),
    "cut in a tag": (file_of(nested(1))[:-5], "not_an_export"),
    "cut before a tag": (file_of(nested(1), b"\x0e\0\0"), "not_an_export"),
    "cut in an element": (file_of(b"\x0e\0\0\0\xff\0\0\0"), "not_an_export"),
    "packed and cut": (file_of(element(15, zlib.compress(nested(3))[:-20])), "not_an_export"),
    "packed, not by zlib": (file_of(element(15, b"nonsense")), "not_an_export"),
    "packed bomb": (file_of(element(15, zlib.compress(bytes(1 << 20)))), "decompressed_too_large"),
    "no variable": (file_of(element(9, b"12345678")), "not_an_export"),
    "too deep": (file_of(nested(50)), "not_an_export"),
    "a billion values": (file_of(element(14, head(6, 1 << 30, 1) + element(9, bytes(8)))), "not_an_export"),
    "values of no kind": (file_of(element(14, head(6, 1, 1) + element(99, bytes(8)))), "not_an_export"),
    "less than nothing": (file_of(element(14, head(6, -1, 1) + element(9, bytes(8)))), "not_an_export"),
    "one dimension": (file_of(element(14, head(6, 1) + element(9, bytes(8)))), "not_an_export"),
    "no flags": (file_of(element(14, element(6, b""))), "not_an_export"),
    "a billion structures": (file_of(structure(1 << 30, 2, b"a\0")), "not_an_export"),
    "a billion structures of nothing": (file_of(structure(1 << 30, 2, b"")), "not_an_export"),
    "names of no length": (file_of(structure(1, 0, b"a\0")), "not_an_export"),
    "names of great length": (file_of(structure(1, 1 << 20, b"a\0")), "not_an_export"),
    "a structure of numbers": (
        file_of(element(14, structure(1, 2, b"a\0")[8:] + element(9, bytes(8)))),
        "not_an_export",
    ),
    "a tag that says too much": (file_of(element(14, b"\x06\0\x09\0" + bytes(20))), "not_an_export"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_file_that_claims_what_it_has_not_is_refused(read: Read, name: str) -> None:
    data, code = HOSTILE[name]
    with pytest.raises(DataError) as raised:
        read(data, options=IngestOptions(max_bytes=100_000))
    assert raised.value.code == code


def test_inspect_says_what_the_data_base_holds(tmp_path: Path) -> None:
    path = tmp_path / "isdb.mat"
    path.write_bytes(matlab(isdb()))
    report = inspect(path)
    assert {found.loop: found.sampling_interval_s for found in report.loops}["CHEM19"] == 12.0
    assert all(found.even and set(found.signals) == {"PV", "OP", "SP"} for found in report.loops)


@pytest.mark.parametrize("version", [b"\x00\x02IM", b"\x02\x00MI"])
def test_version_7_3_is_refused_with_the_way_out(read: Read, version: bytes) -> None:
    with pytest.raises(DataError, match=r"save\(\.\.\., '-v7'\)") as raised:
        read(b"MATLAB 7.3 MAT-file".ljust(124) + version + bytes(384) + b"\x89HDF")
    assert raised.value.code == "matlab_version"


def test_a_file_that_is_too_large_is_refused(read: Read) -> None:
    with pytest.raises(DataError) as raised:
        read(matlab({"a": loop(5000)}), options=IngestOptions(max_bytes=10_000))
    assert raised.value.code == "decompressed_too_large"


def test_variables_that_are_too_large_together_are_refused(read: Read) -> None:
    """Packed, the file is small; each of the three unpacks to some 13 kB."""
    data = matlab({name: np.ones(1600) for name in ("PV", "OP", "SP")} | {"Ts": 1.0}, do_compression=True)
    assert read(data, name="A.mat", options=IngestOptions(max_bytes=50_000)).loops["A"].samples == 1600
    with pytest.raises(DataError) as raised:
        read(data, name="A.mat", options=IngestOptions(max_bytes=30_000))
    assert raised.value.code == "decompressed_too_large"


def test_more_loops_than_any_plant_has_are_refused(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.ingest.exports.matlab.MOST_LOOPS", 1)
    with pytest.raises(DataError) as raised:
        read(matlab(isdb()))
    assert raised.value.code == "too_many_tags"


def test_only_the_first_of_many_loops_that_are_left_out_are_said(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.ingest.exports.matlab.MOST_NOTES", 1)
    empty = {"PV": "", "OP": ""}
    notes = read(matlab({"a": loop(), "b": empty, "c": empty})).summary.notes
    assert sum("was left out" in note for note in notes) == 1


def test_damaged_files_are_read_or_refused(read: Read) -> None:
    """Whatever stands in the bytes: a refusal, never another error."""
    data = matlab({"a": loop(8), "b": 3})
    random = np.random.default_rng(5)
    refused = 0
    for _ in range(300):
        damaged = bytearray(data)
        for at in random.integers(128, len(data), 3):
            damaged[at] = random.integers(256)
        try:
            read(bytes(damaged))
        except DataError:
            refused += 1
    assert 0 < refused < 300
