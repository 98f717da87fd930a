"""An embedded backend behind its routes; what a worker would do is done by calling its services."""

import pytest

from app.main import create_app
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.warming import warm_up
from app.services.backend import Backend
from app.services.intake.reading import read_upload
from tests.api.routes.exports import TAGS, sent
from tests.swinging import wide


@pytest.fixture(scope="module")
def backend(open_plant) -> Backend:
    warm_up()  # compiled on first use, which is not a loop's time to lose
    return open_plant(max_upload_bytes=1_000_000)


@pytest.fixture(scope="module")
def client(serve, backend):
    with serve(create_app(backend.settings)) as connection:
        yield connection


@pytest.fixture(scope="module")
def plant(client, backend):
    """Three loops, one with a hostile tag, uploaded and audited; the run."""
    upload = sent(client, wide(*TAGS), filename="plant.csv")
    read_upload(backend, int(upload["id"]), owner="test")
    run = client.post("/v1/audits", json={"tags": TAGS}).json()
    audit_chunk(backend, int(run["id"]), "test")
    return client.get(f"/v1/audits/{run['id']}").json()
