"""Hostile files from the client to their end: taken or refused with a code, read by what a worker calls, then done or
failed with a code. Nothing of a file that failed is kept, and no draft is left."""

import gzip
from collections.abc import Iterator

import httpx
import pytest
from sqlalchemy import func, select

from app.main import create_app
from app.services.backend import Backend
from app.services.intake.reading import read_upload
from app.storage.tables import loops, series
from tests.fuzz.files import FILES, HEADER, NAMES, rows

LARGE = ("10,000 columns", "40,000 tags")
LONGEST_HEAD = 4000  # of a part of a form, as the framework takes it
SENT = [name for name in FILES if "cut at" not in name and name not in LARGE]


@pytest.fixture(scope="module")
def backend(open_plant) -> Backend:
    return open_plant()


@pytest.fixture(scope="module")
def client(serve, backend) -> Iterator[httpx.Client]:
    with serve(create_app(backend.settings)) as connection:
        yield connection


def stored(backend: Backend) -> tuple[int, int]:
    with backend.database.read() as connection:
        count = func.count()
        return connection.scalar(select(count).select_from(loops)), connection.scalar(select(count).select_from(series))


def ended(client, backend, answer: httpx.Response) -> dict:
    """The upload after a worker has read it."""
    assert answer.status_code == 202, answer.text
    read_upload(backend, int(answer.json()["id"]), "test")
    found = client.get(answer.headers["location"]).json()
    assert not list(backend.settings.uploads_dir.glob(".part-*"))
    return found


@pytest.mark.parametrize("name", SENT)
def test_a_hostile_file_ends_as_done_or_failed_and_in_nothing_between(client, backend, name):
    file, before = FILES[name], stored(backend)
    content = file.make()  # once: gzip writes the time into its header
    found = ended(client, backend, client.post("/v1/uploads", content=content, params={"filename": file.name}))
    assert found["state"] in ("done", "failed")
    if found["state"] == "done":
        assert found["rows_kept"] >= file.kept
        assert found["rows_refused"] == sum(found["reject_counts"].values())
    else:
        assert found["error_code"] in file.refused
        assert found["reason"]
        assert stored(backend) == before
    again = client.post("/v1/uploads", content=content, params={"filename": file.name})
    assert again.json()["id"] == found["id"]


@pytest.mark.parametrize("name", NAMES, ids=lambda name: ascii(name[:20]))
def test_a_hostile_name_of_a_file_is_a_name(client, backend, name):
    content = f"time,PV,OP\n{rows('{time},{pv},{op}' + chr(10))}# {NAMES.index(name)}\n".encode()
    answer = client.post("/v1/uploads", files={"file": (name, content, "text/csv")})
    if len(name) > LONGEST_HEAD:
        assert (answer.status_code, answer.json()["code"]) == (400, "bad_request")
        return
    found = ended(client, backend, answer)
    assert found["state"] == "done"
    assert len(found["filename"]) <= 255
    assert "/" not in found["filename"]
    assert client.get("/v1/loops", params={"limit": 1000}).status_code == 200


@pytest.mark.parametrize("zone", ["../UTC", "/etc/passwd", "Nowhere/City", "UTC\0", "x" * 61, ".", ""])
def test_a_hostile_time_zone_is_refused_before_the_file_is_taken(client, backend, zone):
    before = set(backend.settings.uploads_dir.iterdir())
    answer = client.post("/v1/uploads", content=HEADER.encode(), params={"time_zone": zone})
    assert answer.status_code in (400, 422)
    assert answer.json()["code"]
    assert set(backend.settings.uploads_dir.iterdir()) == before


def test_a_body_that_breaks_off_is_refused_and_leaves_nothing(client, backend):
    before = set(backend.settings.uploads_dir.iterdir())

    def parts() -> Iterator[bytes]:
        yield HEADER.encode()
        raise ConnectionError("the client went away")

    with pytest.raises(ConnectionError):
        client.post("/v1/uploads", content=parts())
    packed = gzip.compress(HEADER.encode())
    for body in (b"", packed[:0]):
        answer = client.post("/v1/uploads", content=body)
        assert (answer.status_code, answer.json()["code"]) == (400, "empty_upload")
    assert set(backend.settings.uploads_dir.iterdir()) == before
