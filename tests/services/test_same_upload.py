"""Which content is the same upload: under another name, without one, packed or not."""

import hashlib
from concurrent.futures import ThreadPoolExecutor

import pytest
from sqlalchemy import delete, select

from app.services.backend import Backend
from app.services.intake import content, uploads
from app.services.intake.uploads import ReadingOptions
from app.storage import series
from app.storage.tables import series as series_table
from tests.services.sent_uploads import export, of_one_tag, packed, read, send
from tests.services.spoiled import loop_id_of, spoil

EVER = (-(1 << 62), 1 << 62)


def test_the_same_content_under_the_same_name_is_the_same_upload(backend: Backend) -> None:
    data = export()
    first = send(backend, data)
    with uploads.receive(backend, filename="C:\\exports\\night.CSV") as receiving:
        receiving.write(data)
        receipt = receiving.commit()
    assert (receipt.upload.id, receipt.created) == (first.id, False)
    assert len(list(backend.settings.uploads_dir.iterdir())) == 1


def test_content_that_names_its_tags_is_the_same_upload_under_another_name(backend: Backend) -> None:
    first = send(backend, export())
    with uploads.receive(backend, filename="other name.csv") as receiving:
        receiving.write(export())
        again = receiving.commit()
    assert (again.upload.id, again.upload.filename, again.created) == (first.id, "night.csv", False)
    assert len(list(backend.settings.uploads_dir.iterdir())) == 1
    assert read(backend, send(backend, export(), name="third.csv")).id == first.id
    berlin = ReadingOptions(time_zone="Europe/Berlin")
    elsewhere = send(backend, export(), name="third.csv", options=berlin)
    assert elsewhere.id != first.id
    assert send(backend, export(), name="fourth.csv", options=berlin).id == elsewhere.id


def test_content_that_is_known_is_the_same_upload_without_a_name(backend: Backend) -> None:
    """A raw body after a multipart form: nothing says that it is of another loop."""
    bare = export().replace(b"LIC2.", b"X").replace(b"FIC1.", b"")
    named = send(backend, bare, name="FIC7.csv")
    assert send(backend, bare, name="").id == named.id
    assert send(backend, packed(bare), name="").id == named.id
    other = send(backend, bare, name="FIC8.csv")
    assert other.id != named.id
    assert send(backend, bare, name="").id == named.id
    berlin = ReadingOptions(time_zone="Europe/Berlin")
    nameless = send(backend, bare, name="", options=berlin)
    assert nameless.filename == f"upload-{nameless.fingerprint[:12]}"
    assert send(backend, bare, name="", options=berlin).id == nameless.id
    assert send(backend, bare, name="FIC9.csv", options=berlin).id != nameless.id


@pytest.mark.parametrize("known", [False, True])
def test_content_without_a_name_that_comes_several_times_at_once_is_one_upload(backend: Backend, known: bool) -> None:
    bare = export().replace(b"LIC2.", b"X").replace(b"FIC1.", b"")
    first = {send(backend, bare, name="FIC7.csv").id} if known else set()
    with ThreadPoolExecutor(8) as threads:
        ids = set(threads.map(lambda _: send(backend, bare, name="").id, range(16)))
    assert len(ids | first) == 1
    assert len(uploads.list_uploads(backend).rows) == 1


def test_content_that_cannot_be_read_is_the_same_upload_under_another_name(backend: Backend) -> None:
    assert send(backend, b"\0\1\2", name="a.csv").id == send(backend, b"\0\1\2", name="b.csv").id


def test_a_loop_without_a_name_is_another_upload_under_another_name(backend: Backend) -> None:
    bare = export().replace(b"LIC2.", b"X").replace(b"FIC1.", b"")
    first, other = (read(backend, send(backend, bare, name=f"{name}.csv")) for name in ("FIC7", "FIC8"))
    assert (first.loops, other.loops) == (["FIC7"], ["FIC8"])
    mapping = ReadingOptions(mapping=b"tag,loop,signal\nPV,A,PV\nOP,A,OP\nSP,A,SP\nMODE,A,MODE\n")
    assert (
        send(backend, bare, name="x.csv", options=mapping).id == send(backend, bare, name="y.csv", options=mapping).id
    )


def test_the_same_bytes_are_another_tag_under_another_name(backend: Backend) -> None:
    same = of_one_tag(["50.0"] * 60)
    done = [read(backend, send(backend, same, name=f"{loop}.SP.csv")) for loop in ("FIC201", "FIC202")]
    assert [(upload.loops, upload.samples_added) for upload in done] == [(["FIC201"], 60), (["FIC202"], 60)]


def test_the_same_samples_in_other_bytes_change_nothing(backend: Backend) -> None:
    read(backend, send(backend, export()))
    again = read(backend, send(backend, export().replace(b"\n", b"\r\n"), name="night.csv"))
    assert (again.state, again.samples_added) == ("done", 0)


@pytest.mark.parametrize("name", ["", "night.csv"])
def test_the_same_content_packed_otherwise_is_the_same_upload(backend: Backend, name: str) -> None:
    data = export().replace(b"LIC2.", b"X").replace(b"FIC1.", b"")
    halves = packed(data[:3000]) + packed(data[3000:])
    first = send(backend, packed(data), name=name)
    for again in (packed(data, 2), data, halves, packed(data, 3)):
        assert send(backend, again, name=name).id == first.id
    assert first.fingerprint == hashlib.sha256(data).hexdigest()
    assert [file.name for file in backend.settings.uploads_dir.iterdir()] == [first.fingerprint]
    assert read(backend, first).loops == [name.removesuffix(".csv") or f"upload-{first.fingerprint[:12]}"]


@pytest.mark.parametrize(
    "sent",
    [
        packed(export())[:-20],
        packed(export()) + b"and more",
        packed(packed(export())),
        packed(b"PAR1" + export()),
        packed(b"PK\x03\x04" + export()),
    ],
    ids=["cut", "followed", "twice", "parquet", "workbook"],
)
def test_what_is_no_whole_text_in_gzip_is_known_by_its_bytes(backend: Backend, sent: bytes) -> None:
    """A parquet file is read, and packed it is not: one answer cannot do for both."""
    assert send(backend, sent).fingerprint == hashlib.sha256(sent).hexdigest()


def test_what_unpacks_beyond_the_caps_is_known_by_its_bytes(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    sent = packed(export())
    monkeypatch.setattr(content, "LARGEST_CONTENT_BYTES", 3000)
    assert send(backend, sent).fingerprint == hashlib.sha256(sent).hexdigest()


@pytest.mark.parametrize("name", ["", "night.csv.gz"])
def test_an_upload_that_is_known_by_its_packed_bytes_stays_the_same(backend: Backend, name: str) -> None:
    """Before, fingerprints were of the bytes as they came."""
    sent = packed(export())
    monkey = pytest.MonkeyPatch()
    with monkey.context() as before:
        before.setattr(content.ContentDigest, "hexdigest", lambda self: None)
        first = send(backend, sent, name=name)
    assert first.fingerprint == hashlib.sha256(sent).hexdigest()
    assert send(backend, sent, name=name).id == first.id
    assert send(backend, packed(export(), 2), name=name).id != first.id


def test_content_that_is_sent_again_is_read_again_where_its_samples_are_damaged(backend: Backend) -> None:
    first = read(backend, send(backend, export()))
    assert send(backend, export()).state == "done"
    loop_id = loop_id_of(backend, "FIC1")
    with backend.database.read() as connection:
        before = series.between(connection, loop_id, *EVER)
        start_ns = connection.scalar(select(series_table.c.start_ns).where(series_table.c.loop_id == loop_id))
    spoil(backend, loop_id, start_ns)
    again = send(backend, export())
    assert (again.id, again.state) == (first.id, "received")
    read(backend, again)
    with backend.database.read() as connection:
        after = series.between(connection, loop_id, *EVER)
    assert after.fingerprint == before.fingerprint
    assert send(backend, export()).state == "done"


def test_content_that_is_sent_again_is_read_again_where_its_samples_were_dropped(backend: Backend) -> None:
    first = read(backend, send(backend, export()))
    with backend.database.write() as connection:
        connection.execute(delete(series_table))
    again = send(backend, export())
    assert (again.id, again.state) == (first.id, "received")
    assert read(backend, again).samples_added == first.samples_added
