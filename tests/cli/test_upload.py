"""`loopaudit upload`: what it sends, whom it waits for, what it says, and with which exit code."""

import socket
import threading
import time
from http.server import BaseHTTPRequestHandler, HTTPServer

import httpx
import pytest

from app.cli.client import ServiceClient
from app.cli.upload import LONG_S, START_S, await_start, report, send, why_it_waits
from app.client import Upload
from app.errors import RequestError
from app.main import create_app
from app.services.backend import Backend
from app.services.intake.reading import read_upload
from app.services.upkeep.tables import migrate
from app.settings import Settings
from tests.cli.calling import WIDE, as_program, run

ANSWER = {"id": "1", "state": "done", "loops": ["A"], "notes": [], "rejects": []}


@pytest.fixture(autouse=True)
def no_service_is_about_to_start(monkeypatch) -> None:
    monkeypatch.setattr("app.cli.upload.START_S", 0.0)


def answering(*answers: httpx.Response) -> ServiceClient:
    left = iter(answers)
    return ServiceClient("http://server", transport=httpx.MockTransport(lambda _: next(left)))


def test_the_order_of_day_and_month_can_be_said(serve, tmp_path):
    export = tmp_path / "local.csv"
    export.write_text("Time,FIC1.PV,FIC1.OP\n" + "".join(f"02/03/2026 12:00:{k:02d},{k},{k}\n" for k in range(60)))
    assert "2026-03-02 12:00:00" in run("inspect", export).stdout
    assert "2026-02-03 12:00:00" in run("inspect", export, "--date-order", "month").stdout
    assert run("inspect", export, "--date-order", "year").exit_code == 2
    settings = Settings(data_dir=tmp_path / "data")
    migrate(settings)
    with serve(create_app(settings)) as connection:
        done = run("upload", export, "--date-order", "month", "--url", connection.base_url)
        backend = Backend.open(settings)
        read_upload(backend, int(done.stdout.split("\t")[1]), owner="test")
        backend.close()
        assert connection.get("/v1/loops/FIC1").json()["samples_to"] == "2026-02-03T12:00:59Z"


def test_an_upload_leaves_the_order_to_the_service_whatever_this_machine_has(tmp_path, monkeypatch):
    sent = []
    monkeypatch.setattr("app.cli.upload.send", lambda _, file, wait, how: sent.append(how.date_order) or ANSWER)
    (tmp_path / "plant.csv").write_text(WIDE)
    monkeypatch.setenv("LOOPAUDIT_DATE_ORDER", "month")
    for order in ((), ("--date-order", "auto"), ("--date-order", "day")):
        assert run("upload", tmp_path / "plant.csv", *order).exit_code == 0
    assert sent == [None, None, "day"]


def test_a_refused_value_without_a_line_is_told_without_one(tmp_path, capsys):
    report(tmp_path / "a.xlsx", ANSWER | {"rejects": [{"line": None, "text": "sheet B: no times", "code": "no_times"}]})
    assert capsys.readouterr().err == f"{tmp_path / 'a.xlsx'}: sheet B: no times [no_times]\n"


def test_a_file_that_was_read_and_holds_no_loop_is_said(tmp_path, monkeypatch):
    (tmp_path / "odd.csv").write_text(WIDE)
    answer = {"id": "1", "state": "done", "loops": [], "notes": [], "rejects": []}
    monkeypatch.setattr("app.cli.upload.send", lambda *_: answer)
    done = run("upload", tmp_path / "odd.csv", "--wait")
    assert (done.exit_code, "odd.csv: no loop was found in it" in done.stderr) == (2, True)
    assert done.stdout.endswith("done\tloops 0\n")
    monkeypatch.setattr("app.cli.upload.send", lambda *_: answer | {"state": "received"})
    assert run("upload", tmp_path / "odd.csv").exit_code == 0


@pytest.mark.parametrize(
    ("names", "code"),
    [
        ("good.csv good.csv", 0),
        ("good.csv empty.csv", 1),
        ("good.csv cut.csv", 1),
        ("cut.csv", 1),
        ("good.csv refused.csv", 1),
        ("good.csv empty.csv refused.csv", 1),
        ("empty.csv refused.csv", 2),
        ("empty.csv", 2),
        ("refused.csv", 2),
    ],
)
def test_some_files_of_use_are_1_and_none_is_2(tmp_path, monkeypatch, names, code):
    def answer(_, file, *__):
        if file.name == "refused.csv":
            raise RequestError("upload_failed", "the file could not be used")
        loops = ["A"] if file.name in ("good.csv", "cut.csv") else []
        damaged = file.name == "cut.csv"
        return {"id": "1", "state": "done", "loops": loops, "notes": [], "rejects": [], "damaged": damaged}

    monkeypatch.setattr("app.cli.upload.send", answer)
    files = [tmp_path / name for name in names.split()]
    for file in files:
        file.write_text(WIDE)
    done = run("upload", *files, "--wait")
    assert (done.exit_code, "[damaged]" in done.stderr) == (code, "cut.csv" in names)


def test_a_file_that_failed_is_told_with_the_code_of_its_error(serve, tmp_path):
    odd = tmp_path / "odd.csv"
    odd.write_text('{"a": 1}')
    settings = Settings(data_dir=tmp_path / "data")
    migrate(settings)
    with serve(create_app(settings)) as connection:
        sent = run("upload", odd, "--url", connection.base_url)
        backend = Backend.open(settings)
        read_upload(backend, int(sent.stdout.split("\t")[1]), owner="test")
        backend.close()
        done = run("upload", odd, "--wait", "--url", connection.base_url)
    assert done.exit_code == 2
    assert done.stderr.endswith(
        "this is JSON, which is not read; CSV or TSV text, parquet or xlsx is needed [not_an_export]\n"
    )


def test_an_upload_is_read_in_the_zone_that_is_named(serve, tmp_path):
    export = tmp_path / "local.csv"
    export.write_text("DateTime,FIC1.PV,FIC1.OP\n" + "".join(f"2026-01-01 12:00:{k:02d},{k},{k}\n" for k in range(60)))
    settings = Settings(data_dir=tmp_path / "data")
    migrate(settings)
    with serve(create_app(settings)) as connection:
        done = run("upload", export, "--time-zone", "Europe/Berlin", "--url", connection.base_url)
        backend = Backend.open(settings)
        read_upload(backend, int(done.stdout.split("\t")[1]), owner="test")
        backend.close()
        assert connection.get("/v1/loops/FIC1").json()["samples_to"] == "2026-01-01T11:00:59Z"
        refused = run("upload", export, "--time-zone", "Mars/Base", "--url", connection.base_url)
        assert (refused.exit_code, "[unknown_time_zone]" in refused.stderr) == (2, True)


def test_upload_without_a_service_is_2_and_says_where_it_looked(tmp_path, monkeypatch, capsys):
    (tmp_path / "plant.csv").write_text(WIDE)
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{closed.getsockname()[1]}"
    monkeypatch.setattr("app.cli.upload.START_S", 0.3)
    code, out, err = as_program(monkeypatch, capsys, "upload", tmp_path, "--url", url)
    assert (code, out) == (2, "")
    assert "waiting up to 0 s for a service that starts" in err
    assert "[no_service]" in err
    assert url in err


def test_files_of_which_none_is_there_are_told_before_any_service_is_waited_for(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("app.cli.upload.await_start", None)
    names = [tmp_path / "plnat.csv", tmp_path / "tnaks.csv"]
    code, out, err = as_program(monkeypatch, capsys, "upload", *names, "--url", "http://127.0.0.1:1")
    assert (code, out) == (2, "")
    assert err == "".join(f"{name}: is not there [no_such_file]\n" for name in names)


def test_upload_waits_for_a_service_of_this_machine_that_starts(monkeypatch, capsys):
    monkeypatch.setattr("app.cli.upload.START_S", START_S)
    with socket.socket() as later:
        later.bind(("127.0.0.1", 0))
        port = later.getsockname()[1]
    asked = []

    class Answering(BaseHTTPRequestHandler):
        def do_GET(self):
            asked.append(self.path)
            self.send_response(200)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_):
            pass

    def start():
        time.sleep(0.5)
        with HTTPServer(("127.0.0.1", port), Answering) as server:
            server.timeout = START_S  # a client that never asks fails the test, and does not hang it
            server.handle_request()

    starting = threading.Thread(target=start)
    starting.start()
    with ServiceClient(f"http://127.0.0.1:{port}") as client:
        await_start(client)
    starting.join()
    assert asked == ["/readyz"]
    assert f"nothing answers at http://127.0.0.1:{port} yet; waiting up to 30 s" in capsys.readouterr().err


@pytest.mark.parametrize("host", ["127.0.0.1:1", "127.0.0.1:port"])
def test_the_password_of_an_address_is_not_told(tmp_path, monkeypatch, capsys, host):
    monkeypatch.setattr("app.cli.client.PATIENCE_S", 0.0)
    (tmp_path / "plant.csv").write_text(WIDE)
    code, _, said = as_program(
        monkeypatch, capsys, "upload", tmp_path / "plant.csv", "--url", f"http://who:secret@{host}"
    )
    assert code == 2
    assert host in said
    assert "secret" not in said


@pytest.mark.parametrize("later", ["0", "Thu, 01 Jan 2026 00:00:00 GMT"])
def test_a_service_that_is_busy_while_it_is_polled_fails_no_file(tmp_path, monkeypatch, later):
    monkeypatch.setattr("app.client.connection.PAUSE_S", 0.0)
    (tmp_path / "plant.csv").write_text(WIDE)
    busy = httpx.Response(503, headers={"Retry-After": later}, json={"code": "database_away", "detail": "try again"})
    stored, read = ({"id": "7", "state": state, "loops": []} for state in ("received", "done"))
    with answering(busy, httpx.Response(202, json=stored), busy, httpx.Response(200, json=read)) as client:
        assert send(client, tmp_path / "plant.csv", 60.0) == read


def test_a_service_whose_data_base_stays_away_is_asked_for_a_minute(monkeypatch):
    slept: list[float] = []
    monkeypatch.setattr("app.client.connection.time.sleep", slept.append)
    monkeypatch.setattr("app.client.connection.time.monotonic", lambda: sum(slept))
    away = httpx.Response(503, headers={"Retry-After": "5"}, json={"code": "database_away", "detail": "try again"})
    with answering(*[away] * 40) as client, pytest.raises(RequestError) as refusal:
        client.loop_list()
    assert (refusal.value.code, sum(slept)) == ("database_away", 60.0)


@pytest.mark.parametrize(
    ("answer", "code", "message"),
    [
        (
            httpx.Response(404, json={"code": "unknown_upload", "detail": "there is none"}),
            "unknown_upload",
            "there is none",
        ),
        (
            httpx.Response(401, json={"code": "key_needed", "detail": "a key is needed: Authorization: ..."}),
            "key_needed",
            "the service at http://server asks for a key: give one by --key or LOOPAUDIT_KEY",
        ),
        (httpx.Response(502, text="<html>"), "http_502", "Bad Gateway"),
    ],
)
def test_what_the_service_or_a_proxy_refuses_is_told_with_its_code(answer, code, message):
    with answering(answer) as client, pytest.raises(RequestError) as refusal:
        client.get_upload("7")
    assert (refusal.value.code, refusal.value.message) == (code, message)


def test_an_address_of_something_else_refuses_each_file(tmp_path, monkeypatch, capsys):
    page = httpx.Response(200, html="<!doctype html>")
    monkeypatch.setattr("app.cli.client.ServiceClient", lambda *_: answering(page))
    (tmp_path / "plant.csv").write_text(WIDE)
    code, out, err = as_program(monkeypatch, capsys, "upload", tmp_path / "plant.csv")
    assert (code, out) == (2, "")
    assert err.endswith(
        "plant.csv: http://server does not answer like loopaudit: POST /v1/uploads gave text/html; charset=utf-8"
        " [http_200]\n"
    )


def test_an_upload_that_does_not_end_in_time_is_said():
    stored = httpx.Response(200, json={"id": "7", "state": "reading"})
    with (
        answering(stored) as client,
        pytest.raises(RequestError, match="/v1/uploads/7 has not ended after 0 s") as late,
    ):
        client.until_ended("/v1/uploads/7", lambda: client.get_upload("7"), lambda _: None, 0.0)
    assert late.value.code == "timeout"


def test_upload_waits_for_no_service_of_another_machine():
    with ServiceClient("http://plant.example:8000") as client:
        assert not client.local


@pytest.mark.parametrize("url", ["not an address", "http://[", "ftp://127.0.0.1", "http://127.0.0.1:http"])
def test_upload_to_no_address_is_2(tmp_path, monkeypatch, capsys, url):
    (tmp_path / "plant.csv").write_text(WIDE)
    code, _, err = as_program(monkeypatch, capsys, "upload", tmp_path, "--url", url)
    assert code == 2
    assert err.startswith("loopaudit: ")


def test_an_upload_that_waits_for_room_is_told_once(tmp_path, capsys):
    seen = why_it_waits(tmp_path / "night.csv")
    for since in (None, "2026-01-31T03:00:00Z", "2026-01-31T03:00:00Z"):
        seen(Upload.of({"id": "7", "state": "received", "waits_for_room_since": since}))
    seen(Upload.of({"id": "7", "state": "done"}))
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1
    assert "night.csv: waiting for room on the disk" in told[0]


def test_an_upload_whose_file_no_worker_sees_is_told_once(tmp_path, capsys):
    seen = why_it_waits(tmp_path / "night.csv")
    for since in (None, "2026-01-31T03:00:00Z", "2026-01-31T03:00:00Z"):
        seen(Upload.of({"id": "7", "state": "received", "waits_for_file_since": since}))
    told = capsys.readouterr().err.splitlines()
    assert "night.csv: kept by the service, and no worker sees its file" in " ".join(told)
    assert " ".join(told).count("night.csv") == 1


def test_an_upload_that_nobody_reads_for_long_says_what_may_be_done_first(tmp_path, capsys):
    times = iter([0.0, LONG_S - 1.0, LONG_S, LONG_S + 1.0, LONG_S + 99.0])
    seen = why_it_waits(tmp_path / "night.csv", clock=lambda: next(times))
    told = []
    for state in ("received", "received", "received", "reading"):
        seen(Upload.of({"id": "7", "state": state}))
        told.append(capsys.readouterr().err)
    assert told[:1] == [""]
    (said,) = filter(None, told)
    assert "night.csv: kept by the service, and not read yet; at the first start of a version" in " ".join(said.split())


def test_an_upload_that_is_read_for_long_is_not_said_to_wait(tmp_path, capsys):
    times = iter([0.0, LONG_S + 1.0])
    seen = why_it_waits(tmp_path / "night.csv", clock=lambda: next(times))
    seen(Upload.of({"id": "7", "state": "reading"}))
    assert capsys.readouterr().err == ""


def test_what_is_odd_about_an_upload_is_said(tmp_path, capsys):
    state = {"id": "7", "state": "done", "loops": ["A"], "notes": ["the gzip file is damaged after 9 bytes"]}
    reject = {"line": 3, "text": "Bad Input", "code": "not_a_number"}
    report(tmp_path / "night.csv.gz", {**state, "rejects": [reject]})
    told = capsys.readouterr().err.splitlines()
    assert [line.partition("night.csv.gz: ")[2] for line in told] == [
        "the gzip file is damaged after 9 bytes",
        "line 3: Bad Input [not_a_number]",
    ]


@pytest.mark.parametrize(("refused", "more"), [(3, []), (720, ["and 717 more rows or values that were refused"])])
def test_how_many_more_rows_were_refused_is_said(tmp_path, capsys, refused, more):
    listed = [{"line": line, "text": "RSP", "code": "unknown_mode"} for line in range(2, 7)]
    state = {"id": "7", "state": "done", "loops": ["A"], "rejects": listed[:refused], "rows_refused": refused}
    report(tmp_path / "night.csv", state)
    told = capsys.readouterr().err.splitlines()
    assert [line.partition("night.csv: ")[2] for line in told[3:]] == more
