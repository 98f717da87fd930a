"""`loopaudit loops`: the list out, changed, and back."""

import httpx
import pytest
from typer.testing import CliRunner

from app.cli.client import ServiceClient
from app.cli.main import cli
from app.errors import DataError
from app.main import create_app
from app.services.backend import Backend
from app.settings import Settings
from app.storage import loops
from tests.cli.calling import as_program


@pytest.fixture
def service(serve, tmp_path, make_tables):
    settings = Settings(data_dir=tmp_path / "data")
    make_tables(settings)
    backend = Backend.open(settings)
    with backend.database.write() as connection:
        loops.ensure(connection, ["FIC1", "FIC2"])
    backend.close()
    with serve(create_app(settings)) as connection:
        yield connection


def run(service, *arguments):
    return CliRunner().invoke(cli, ["loops", *map(str, arguments), "--url", str(service.base_url)])


def test_the_list_goes_out_and_comes_back(service, tmp_path):
    out = run(service)
    assert (out.exit_code, out.stdout.removeprefix("\ufeff").splitlines()[0][:9]) == (0, "tag,unit,")
    file = tmp_path / "loops.csv"
    file.write_text("tag,importance,supplier\nFIC1,7,ACME\nFIC3,1,ACME\n")
    done = run(service, file)
    assert done.exit_code == 1
    assert done.stdout == f"{file}\tchanged 1\tunchanged 0\trefused 1\n"
    assert "supplier" in done.stderr
    assert "[unknown_loop]" in done.stderr
    assert service.get("/v1/loops/FIC1").json()["importance"] == 7
    file.write_text("tag,importance\nFIC2,2\n")
    assert run(service, file).exit_code == 0


def test_a_list_that_is_not_there_is_said(service, tmp_path):
    done = run(service, tmp_path / "none.csv")
    assert isinstance(done.exception, DataError)
    assert done.exception.code == "no_such_file"


@pytest.mark.parametrize("into", [False, True])
def test_a_page_of_something_else_is_no_list(tmp_path, monkeypatch, capsys, into):
    page = httpx.Response(200, html="<!doctype html>")
    transport = httpx.MockTransport(lambda _: page)
    monkeypatch.setattr("app.cli.client.ServiceClient", lambda *_: ServiceClient("http://server", transport=transport))
    file = tmp_path / "loops.csv"
    file.write_text("tag,importance\nFIC1,7\n")
    code, out, err = as_program(monkeypatch, capsys, "loops", *[file] * into)
    assert (code, out) == (2, "")
    assert "http://server does not answer like loopaudit" in err
    assert "[http_200]" in err
