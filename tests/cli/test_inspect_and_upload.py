"""`loopaudit inspect` and `upload`: what they say, and with which exit code."""

import json
import socket
import threading
import time
from http.server import BaseHTTPRequestHandler, HTTPServer

import httpx
import numpy as np
import pytest
from scipy.io import savemat
from typer.main import get_command
from typer.testing import CliRunner, Result

from app.cli.client import ServiceClient
from app.cli.main import main
from app.cli.serve import asks_for_keys
from app.cli.upload import START_S, await_start, once_without_room, report, send
from app.client import Upload
from app.errors import RequestError
from app.main import create_app
from app.services.backend import Backend
from app.services.intake.reading import read_upload
from app.services.moments import PlantClock
from app.services.upkeep.tables import migrate
from app.settings import Settings

WIDE = "DateTime,FIC1.PV,FIC1.OP,FIC2.PV\n" + "".join(
    f"2026-01-01T00:00:{k:02d}Z,{50 + k % 7},{40 + k % 5},{k}\n" for k in range(60)
)


ANSWER = {"id": "1", "state": "done", "loops": ["A"], "notes": [], "rejects": []}


@pytest.fixture(autouse=True)
def no_service_is_about_to_start(monkeypatch) -> None:
    monkeypatch.setattr("app.cli.upload.START_S", 0.0)


def run(*arguments, input_: str | None = None) -> Result:
    from app.cli.main import cli

    return CliRunner().invoke(cli, list(map(str, arguments)), input=input_)


def as_program(monkeypatch, capsys, *arguments) -> tuple[int, str, str]:
    """Through `main`, which turns a user's error into a line and an exit code."""
    monkeypatch.setattr("sys.argv", ["loopaudit", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr()
    return int(ended.value.code), said.out, said.err


def test_inspect_says_what_a_file_holds_and_what_would_be_refused(tmp_path):
    export = tmp_path / "plant.csv"
    export.write_text(WIDE + "2026-01-01T00:01:00Z,Bad Input,40,1\n")
    done = run("inspect", export)
    assert done.exit_code == 0, done.output
    text = " ".join(done.stdout.split())
    assert "3 in 2 loops" in text
    assert "no: PV and OP are needed" in text
    assert "line 62" in text
    assert "Bad Input" in text


def test_inspect_says_where_most_is_missing_and_reads_in_the_zone_of_the_settings(tmp_path, monkeypatch):
    export = tmp_path / "FIC1.csv"
    lines = (f"2026-01-01 00:{k // 60:02d}:{k % 60:02d},{k % 7},{k % 5 if k % 50 == 0 else ''}" for k in range(900))
    export.write_text("\n".join(["time,PV,OP", *lines]) + "\n")
    monkeypatch.setenv("LOOPAUDIT_TIME_ZONE", "Asia/Kolkata")
    text = " ".join(run("inspect", export).stdout.split())
    assert "yes, though mostly missing" in text
    assert "2025-12-31 18:30:00" in text


def test_a_matlab_file_is_inspected_and_audited(tmp_path):
    time = np.arange(600.0)
    loop = {"Ts": 2.0, "PV": np.sin(time / 9) ** 2, "OP": 40 + np.cos(time / 9), "SP": 50.0}
    savemat(tmp_path / "isdb.mat", {"cdata": {"chemicals": {"loop7": loop, "loop8": loop}}})
    text = " ".join(run("inspect", tmp_path / "isdb.mat").stdout.split())
    assert "isdb_matlab, matlab" in text
    assert "6 in 2 loops" in text
    done = run("audit", tmp_path, "--format", "jsonl")
    assert [json.loads(line)["loop"] for line in done.stdout.splitlines()] == ["CHEM7", "CHEM8"]


def test_inspect_of_a_file_without_a_loop_is_2(tmp_path, monkeypatch, capsys):
    (tmp_path / "labels.csv").write_text("recording,label\na,b\n")
    code, out, err = as_program(monkeypatch, capsys, "inspect", tmp_path / "labels.csv")
    assert (code, out) == (2, "")
    assert err.startswith("loopaudit: ")
    assert err.count("\n") == 1


def test_inspect_takes_many_files_and_folders(tmp_path, monkeypatch, capsys):
    folder = tmp_path / "exports"
    folder.mkdir()
    (folder / "one.csv").write_text(WIDE)
    (folder / "two.csv").write_text(WIDE)
    code, out, _ = as_program(monkeypatch, capsys, "inspect", folder)
    assert code == 0
    assert out.index("one.csv: ") < out.index("two.csv: ")
    code, out, err = as_program(monkeypatch, capsys, "inspect", folder / "one.csv", tmp_path / "none.csv")
    assert (code, "one.csv: " in out) == (1, True)
    assert "none.csv is not there or not a file [no_such_file]" in err


def test_inspect_of_what_is_not_there_is_2(tmp_path, monkeypatch, capsys):
    code, _, err = as_program(monkeypatch, capsys, "inspect", tmp_path / "none.csv")
    assert code == 2
    assert "[no_such_file]" in err


STRANGE = "DateTime,TI-7,ZT-7\n" + "".join(f"2026-01-01T00:00:{k:02d}Z,{50 + k % 7},{40 + k % 5}\n" for k in range(60))
TAGS = "tag,loop,signal,unit,low,high\nTI-7,TIC7,PV,degC,0,250\nZT-7,TIC7,OP,%,0,100\n"


@pytest.fixture
def strange(tmp_path):
    """An export whose tags tell no loop, and the mapping of its plant."""
    export, tags = tmp_path / "strange.csv", tmp_path / "tags.csv"
    export.write_text(STRANGE)
    tags.write_text(TAGS)
    return export, tags


def test_inspect_groups_tags_by_a_mapping(strange):
    export, tags = strange
    assert run("inspect", export).exit_code == 2
    done = run("inspect", export, "--mapping", tags)
    assert done.exit_code == 0, done.output
    assert "TIC7 PV OP 60" in " ".join(done.stdout.split())


def test_inspect_says_where_a_mapping_names_no_tag_of_the_file(strange):
    export, tags = strange
    tags.write_text("tag,loop,signal\nTI-8,TIC8,PV\n")
    text = " ".join(run("inspect", export, "--mapping", tags).stdout.split())
    assert "the mapping names none of the tags of this file; here is TI-7, ZT-7" in text


@pytest.mark.parametrize("command", ["inspect", "upload"])
@pytest.mark.parametrize(
    ("text", "code"),
    [
        (None, "no_such_file"),
        ("tag,loop,signal\n", "bad_mapping"),
        ("[{", "bad_mapping"),
        ("tag,loop,signal\nTI-7,TIC7,WHAT\n", "bad_mapping"),
    ],
)
def test_a_mapping_that_cannot_be_used_is_one_line(strange, monkeypatch, capsys, command, text, code):
    export, tags = strange
    tags.unlink() if text is None else tags.write_text(text)
    ended, out, err = as_program(monkeypatch, capsys, command, export, "--mapping", tags)
    assert (ended, out) == (2, "")
    assert f"[{code}]" in err
    assert err.count("\n") == 1


def test_an_upload_takes_its_mapping_along(strange, serve, tmp_path):
    export, tags = strange
    settings = Settings(data_dir=tmp_path / "data")
    migrate(settings)
    with serve(create_app(settings)) as connection:
        url = str(connection.base_url)
        done = run("upload", export, "--mapping", tags, "--url", url)
        assert done.exit_code == 0, done.output
        upload_id = done.stdout.split("\t")[1]
        backend = Backend.open(settings)
        read_upload(backend, int(upload_id), owner="test")
        backend.close()
        assert connection.get(f"/v1/uploads/{upload_id}").json()["loops"] == ["TIC7"]
        loop = connection.get("/v1/loops/TIC7").json()
        assert (loop["pv_high"], loop["op_high"]) == (250.0, 100.0)
        assert run("upload", export, "--mapping", tags, "--url", url).stdout.split("\t")[1] == upload_id


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


def test_the_order_of_day_and_month_of_the_settings_holds_for_files_too(tmp_path, monkeypatch):
    export = tmp_path / "local.csv"
    export.write_text("Time,FIC1.PV,FIC1.OP\n" + "".join(f"02/03/2026 12:00:{k:02d},{k},{k}\n" for k in range(60)))
    monkeypatch.setenv("LOOPAUDIT_DATE_ORDER", "month")
    assert "2026-02-03 12:00:00" in run("inspect", export).stdout
    assert "2026-03-02 12:00:00" in run("inspect", export, "--date-order", "day").stdout
    monkeypatch.setenv("LOOPAUDIT_DATE_ORDER", "auto")
    assert "2026-03-02 12:00:00" in run("inspect", export).stdout


@pytest.mark.parametrize("command", ["audit", "inspect", "explain", "simulate"])
def test_commands_that_read_files_take_zone_and_order_from_the_settings(command):
    from app.cli.main import cli

    named = {option.name: option.envvar for option in get_command(cli).commands[command].params}
    assert named["time_zone"] == "LOOPAUDIT_TIME_ZONE"
    assert named["date_order"] == "LOOPAUDIT_DATE_ORDER"


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


def test_dates_ahead_of_the_clock_are_not_read_where_others_can_be(tmp_path, monkeypatch):
    monkeypatch.setattr("app.cli.stamps.time.time_ns", lambda: 1_795_000_000_000_000_000)  # 2026-11-18
    export = tmp_path / "us.csv"
    export.write_text("Time,F.PV,F.OP\n" + "".join(f"11/12/2026 00:00:{k:02d},{k},{k}\n" for k in range(60)))
    text = run("inspect", export).stdout
    assert "2026-11-12 00:00:00" in text
    assert "read otherwise, times lie ahead of the clock" in " ".join(text.split())


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


def answering(*answers: httpx.Response) -> ServiceClient:
    left = iter(answers)
    return ServiceClient("http://server", transport=httpx.MockTransport(lambda _: next(left)))


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
        (httpx.Response(502, text="<html>"), "http_502", "Bad Gateway"),
    ],
)
def test_what_the_service_or_a_proxy_refuses_is_told_with_its_code(answer, code, message):
    with answering(answer) as client, pytest.raises(RequestError) as refusal:
        client.get_upload("7")
    assert (refusal.value.code, refusal.value.message) == (code, message)


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


@pytest.mark.parametrize(
    ("name", "value"), [("NIGHTLY_AT", "late"), ("TIME_ZONE", "Middle/Earth"), ("TIME_ZONE", "../../etc/passwd")]
)
def test_a_setting_that_cannot_be_used_is_named(monkeypatch, capsys, name, value):
    monkeypatch.setenv(f"LOOPAUDIT_{name}", value)
    code, _, err = as_program(monkeypatch, capsys, "nightly")
    assert code == 2
    assert err.startswith(f"loopaudit: LOOPAUDIT_{name}: ")
    assert "Value error" not in err


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "plant-server", ""])  # noqa: S104 - asks for keys
def test_serve_asks_for_keys_beyond_loopback(tmp_path, host):
    assert asks_for_keys(host, Settings(data_dir=tmp_path))
    assert not asks_for_keys(host, Settings(data_dir=tmp_path, allow_open=True))
    assert asks_for_keys(host, Settings(data_dir=tmp_path, allow_open=True, require_keys=True))


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1"])
def test_serve_asks_for_keys_on_loopback_where_it_is_told_to(tmp_path, host):
    assert not asks_for_keys(host, Settings(data_dir=tmp_path))
    assert asks_for_keys(host, Settings(data_dir=tmp_path, require_keys=True))


def test_keys_are_made_shown_once_listed_and_revoked(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    code, out, err = as_program(monkeypatch, capsys, "keys", "create", "the historian", "--role", "upload")
    assert code == 0
    key = out.strip()
    assert key.startswith("la_upload_")
    assert key not in err
    _, listed, _ = as_program(monkeypatch, capsys, "keys", "list", "--json")
    shown = json.loads(listed)
    assert (shown["name"], shown["role"], shown["state"]) == ("the historian", "upload", "active")
    assert key[-49:] not in listed
    _, rotated, _ = as_program(monkeypatch, capsys, "keys", "rotate", shown["id"], "--overlap", "1")
    assert rotated.strip().startswith("la_upload_")
    assert as_program(monkeypatch, capsys, "keys", "revoke", shown["id"])[0] == 0
    _, table, _ = as_program(monkeypatch, capsys, "keys", "list")
    assert "revoked" in table
    _, trail, _ = as_program(monkeypatch, capsys, "trail", "--json")
    actions = [json.loads(line)["action"] for line in trail.splitlines()]
    assert actions == ["key.revoke", "key.rotate", "key.create", "key.create"]
    assert as_program(monkeypatch, capsys, "keys", "revoke", "nonsense")[0] == 2


def test_keys_and_trail_are_told_by_the_clock_of_the_plant(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    monkeypatch.setenv("LOOPAUDIT_TIME_ZONE", "Asia/Kolkata")
    monkeypatch.setenv("COLUMNS", "200")
    clock = PlantClock("Asia/Kolkata")
    _, _, said = as_program(monkeypatch, capsys, "keys", "create", "me", "--role", "admin")
    _, listed, _ = as_program(monkeypatch, capsys, "keys", "list", "--json")
    key = json.loads(listed)
    assert f"good until {clock.told(key['expires_at'])}. Shown" in said
    _, table, _ = as_program(monkeypatch, capsys, "keys", "list")
    assert "Created, Asia/Kolkata" in table
    assert clock.short(key["created_at"]) in table
    assert clock.short(key["expires_at"]) in table
    _, listed, _ = as_program(monkeypatch, capsys, "trail", "--json")
    _, table, _ = as_program(monkeypatch, capsys, "trail")
    assert "When, Asia/Kolkata" in table
    assert clock.to_the_second(json.loads(listed)["at"]) in table
    assert "UTC" not in table


@pytest.mark.parametrize("too_much", [("--days", "1e9"), ("--days", "9e6"), ("--per-minute", "9" * 20)])
def test_a_key_for_longer_or_more_than_can_be_kept_is_refused_in_words(monkeypatch, capsys, tmp_path, too_much):
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    code, made, said = as_program(monkeypatch, capsys, "keys", "create", "me", *too_much)
    assert (code, made) == (2, "")
    assert "Invalid value" in said


@pytest.mark.parametrize("place", ["nowhere/verdicts.jsonl", "."])
def test_a_place_that_cannot_be_written_is_one_line(tmp_path, monkeypatch, capsys, place):
    export = tmp_path / "plant.csv"
    export.write_text(WIDE)
    code, _, said = as_program(monkeypatch, capsys, "audit", export, "--out", tmp_path / place)
    assert code == 2
    assert "[file]" in said
    assert len(said.splitlines()) == 1


@pytest.mark.parametrize("url", ["garbage", "mysql://user@host/name"])
def test_an_unusable_data_base_address_is_one_line(monkeypatch, capsys, url):
    monkeypatch.setenv("LOOPAUDIT_DATABASE_URL", url)
    code, _, said = as_program(monkeypatch, capsys, "migrate")
    assert code == 2
    assert "[database_url]" in said
    assert len(said.splitlines()) == 1


def test_a_check_without_tables_is_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("LOOPAUDIT_DATABASE_URL", f"sqlite:///{tmp_path / 'empty.db'}")
    code, _, said = as_program(monkeypatch, capsys, "worker", "--check")
    assert code == 2
    assert "[no_database]" in said
    assert len(said.splitlines()) == 1
    assert not (tmp_path / "empty.db").exists()


def test_an_upload_that_waits_for_room_is_told_once(tmp_path, capsys):
    seen = once_without_room(tmp_path / "night.csv")
    for since in (None, "2026-01-31T03:00:00Z", "2026-01-31T03:00:00Z"):
        seen(Upload.of({"id": "7", "state": "received", "waits_for_room_since": since}))
    seen(Upload.of({"id": "7", "state": "done"}))
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1
    assert "night.csv: waits for room on the disk" in told[0]


def test_what_is_odd_about_an_upload_is_said(tmp_path, capsys):
    state = {"id": "7", "state": "done", "loops": ["A"], "notes": ["the gzip file is damaged after 9 bytes"]}
    reject = {"line": 3, "text": "Bad Input", "code": "not_a_number"}
    report(tmp_path / "night.csv.gz", {**state, "rejects": [reject]})
    told = capsys.readouterr().err.splitlines()
    assert [line.partition("night.csv.gz: ")[2] for line in told] == [
        "the gzip file is damaged after 9 bytes",
        "line 3: Bad Input [not_a_number]",
    ]


@pytest.mark.parametrize(
    "command",
    ["nightly", "keys list", "keys revoke x", "keys rotate x", "trail", "digest", "report --plant", "backup kept"],
)
def test_nothing_is_made_by_a_command_that_reads(tmp_path, monkeypatch, capsys, command):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", "elsewhere")
    code, out, err = as_program(monkeypatch, capsys, *command.split())
    assert (code, out) == (2, "")
    assert "elsewhere" in err
    assert "[no_database]" in err
    assert list(tmp_path.iterdir()) == []


def test_a_night_over_no_loops_is_2_and_names_the_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path / "data"))
    assert as_program(monkeypatch, capsys, "migrate")[0] == 0
    code, out, err = as_program(monkeypatch, capsys, "nightly")
    assert (code, out) == (2, "")
    assert f"no loop with samples is known in {tmp_path / 'data'}" in err


def test_no_key_is_for_ever(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    code, made, _ = as_program(monkeypatch, capsys, "keys", "create", "me", "--days", "0")
    assert (code, made) == (2, "")
