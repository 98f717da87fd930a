"""A database that goes away while it commits: what is answered is true, and says what to do."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI
from sqlalchemy import create_engine
from sqlalchemy.exc import OperationalError

from app.main import create_app
from app.services.auditing import ending
from app.services.backend import Backend
from app.services.intake.reading import read_upload
from app.services.upkeep import doctor
from app.services.upkeep.readiness import readiness
from app.settings import Settings

EXPORT = b"time,FIC1.PV,FIC1.OP\n" + b"".join(b"%d,%d,%d\n" % (60 * i, i % 7, i % 5) for i in range(200))
PAGE = {"accept": "text/html"}


@pytest.fixture
def app(emptied_postgres: str, tmp_path: Path) -> FastAPI:
    return create_app(Settings(data_dir=tmp_path, database_url=emptied_postgres))


@pytest.fixture
def client(app: FastAPI, serve: Any) -> Iterator[httpx.Client]:
    with serve(app) as found:
        upload = found.post("/v1/uploads", content=EXPORT).json()
        read_upload(app.state.backend, int(upload["id"]), "test")
        yield found


@pytest.fixture
def lose_next(app: FastAPI, client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The next commit is done, and its answer lost."""
    backend: Backend = app.state.backend
    dialect = backend.database.writer.dialect
    commit = dialect.do_commit

    def lose() -> None:
        def lost(connection: Any) -> None:
            monkeypatch.setattr(dialect, "do_commit", commit)
            commit(connection)
            connection.driver_connection.close()
            connection.driver_connection.commit()

        monkeypatch.setattr(dialect, "do_commit", lost)

    return lose


def test_an_upload_is_sent_again_and_is_the_same(client, lose_next):
    lose_next()
    answer = client.post("/v1/uploads", content=EXPORT + b"12000,4,5\n")
    assert (answer.status_code, answer.json()["code"]) == (503, "database_away")
    assert answer.headers["retry-after"]
    assert "not known whether" in answer.json()["detail"]
    assert "send it again" in answer.json()["detail"]
    assert client.post("/v1/uploads", content=EXPORT + b"12000,4,5\n").json()["id"] == "2"
    assert len(client.get("/v1/uploads").json()["rows"]) == 2


@pytest.mark.parametrize(
    ("path", "body"),
    [("/v1/audits", {}), ("/v1/loops/FIC1/notes", {"text": "seen"}), ("/v1/loops/FIC1/explanations", {"window_h": 24})],
)
def test_what_would_be_there_twice_is_not_said_to_be_undone(client, lose_next, path, body):
    """It is done here, and a client that asks again after 503 by itself would do it a second time."""
    before = len(client.get(path).json()["rows"])
    lose_next()
    answer = client.post(path, json=body)
    assert (answer.status_code, answer.json()["code"]) == (504, "outcome_unknown")
    assert "look whether it is there" in answer.json()["detail"]
    assert "nothing was changed" not in answer.text
    assert "retry-after" not in answer.headers
    assert len(client.get(path).json()["rows"]) == before + 1


def outcomes(client):
    return {row["action"]: row["outcome"] for row in reversed(client.get("/v1/trail").json()["rows"])}


def test_the_trail_says_that_it_is_not_known(client, lose_next, monkeypatch):
    lose_next()
    client.post("/v1/loops/FIC1/notes", json={"text": "seen"})
    assert outcomes(client)["note.write"] == "not_known"
    lose_next()
    client.patch("/v1/loops/FIC1", json={"importance": 3})
    assert outcomes(client)["loop.change"] == "not_known"
    client.patch("/v1/loops/FIC1", json={"importance": 3})
    assert outcomes(client)["loop.change"] == "done"


def test_what_is_set_may_be_set_again(client, lose_next):
    lose_next()
    answer = client.patch("/v1/loops/FIC1", json={"importance": 3})
    assert (answer.status_code, answer.json()["code"]) == (503, "database_away")
    assert "send it again" in answer.json()["detail"]
    assert client.get("/v1/loops/FIC1").json()["importance"] == 3


def test_what_is_set_on_a_condition_is_not_to_be_set_again(client, lose_next):
    """Where it was done the loop has another tag, and a repeat would be refused as somebody else's change."""
    tag = client.get("/v1/loops/FIC1").headers["etag"]
    lose_next()
    answer = client.patch("/v1/loops/FIC1", json={"importance": 4}, headers={"If-Match": tag})
    assert (answer.status_code, answer.json()["code"]) == (504, "outcome_unknown")
    assert "look whether it is there" in answer.json()["detail"]
    assert client.get("/v1/loops/FIC1").json()["importance"] == 4


def test_a_page_says_it_in_words(client, lose_next):
    lose_next()
    answer = client.post("/runs", headers=PAGE)
    assert answer.status_code == 504
    assert "It is not known whether this was done" in answer.text
    assert "Nothing was changed" not in answer.text


def test_a_run_that_is_cancelled_in_part_is_not_said_to_be_untouched(client, monkeypatch):
    """Its loops are called off; then the database goes away."""

    def away(*_: object) -> None:
        raise OperationalError("SELECT 1", {}, Exception("the server is away"))

    run = client.post("/v1/audits", json={}).json()["id"]
    with monkeypatch.context() as broken:
        broken.setattr(ending, "end_if_complete", away)
        answer = client.post(f"/v1/audits/{run}/cancel")
    assert (answer.status_code, answer.json()["code"]) == (503, "database_away")
    assert "nothing was changed" not in answer.json()["detail"]
    assert outcomes(client)["audit.cancel"] == "not_known"
    assert client.post(f"/v1/audits/{run}/cancel").json()["state"] == "cancelled"


@pytest.fixture
def read_only(app: FastAPI, client: httpx.Client) -> Iterator[Backend]:
    """The server takes no writes from now on, as a standby that came in the place of the first one."""
    backend: Backend = app.state.backend
    engine = create_engine(backend.database.url, isolation_level="AUTOCOMMIT")
    name = backend.database.url.database
    with engine.connect() as connection:
        connection.exec_driver_sql(f'ALTER DATABASE "{name}" SET default_transaction_read_only TO on')
        backend.database.close()  # its next connections are new ones
        yield backend
        connection.exec_driver_sql(f'ALTER DATABASE "{name}" RESET default_transaction_read_only')
    backend.database.close()
    engine.dispose()


@pytest.mark.parametrize("path", ["/v1/audits", "/v1/loops/FIC1/notes", "/v1/uploads"])
def test_a_data_base_that_takes_no_writes_says_so_and_is_read(read_only, client, path):
    answer = client.post(path, json={"text": "seen"} if path.endswith("notes") else {})
    assert (answer.status_code, answer.json()["code"]) == (503, "database_away")
    assert "takes nothing to be written" in answer.json()["detail"]
    assert client.get("/v1/loops/FIC1").status_code == 200


def test_readiness_tells_of_a_data_base_that_takes_no_writes_and_lets_its_pages_be_read(read_only):
    found = readiness(read_only)
    assert (found.state, found.checks["database"], found.checks["writes"]) == ("degraded", "ok", "read-only")


def test_the_doctor_names_a_data_base_that_takes_no_writes(read_only):
    found = doctor.growth(read_only)
    assert (found.state, "is read-only" in found.found) == ("problem", True)


def test_what_was_not_begun_changed_nothing(app, client, monkeypatch):
    def away() -> None:
        raise OperationalError("BEGIN", {}, Exception("the server is away"))

    monkeypatch.setattr(app.state.backend.database, "write", away)
    answer = client.post("/v1/audits", json={})
    assert (answer.status_code, answer.json()["code"]) == (503, "database_away")
    assert "nothing was changed" in answer.json()["detail"]
