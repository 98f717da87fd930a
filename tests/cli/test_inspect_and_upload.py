"""`loopaudit inspect` and `upload`: what they say, and with which exit code."""

import socket

import pytest
from typer.testing import CliRunner, Result

from app.cli.main import main

WIDE = "DateTime,FIC1.PV,FIC1.OP,FIC2.PV\n" + "".join(
    f"2026-01-01T00:00:{k:02d}Z,{50 + k % 7},{40 + k % 5},{k}\n" for k in range(60)
)


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


def test_inspect_of_a_file_without_a_loop_is_2(tmp_path, monkeypatch, capsys):
    (tmp_path / "labels.csv").write_text("recording,label\na,b\n")
    code, out, err = as_program(monkeypatch, capsys, "inspect", tmp_path / "labels.csv")
    assert (code, out) == (2, "")
    assert err.startswith("loopaudit: ")
    assert err.count("\n") == 1


def test_inspect_of_what_is_not_there_is_2(tmp_path, monkeypatch, capsys):
    code, _, err = as_program(monkeypatch, capsys, "inspect", tmp_path / "none.csv")
    assert code == 2
    assert "[no_such_file]" in err


def test_upload_without_a_service_is_2_and_says_where_it_looked(tmp_path, monkeypatch, capsys):
    (tmp_path / "plant.csv").write_text(WIDE)
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{closed.getsockname()[1]}"
    code, out, err = as_program(monkeypatch, capsys, "upload", tmp_path, "--url", url)
    assert (code, out) == (2, "")
    assert "[no_service]" in err
    assert url in err


@pytest.mark.parametrize("url", ["not an address", "http://[", "ftp://127.0.0.1"])
def test_upload_to_no_address_is_2(tmp_path, monkeypatch, capsys, url):
    (tmp_path / "plant.csv").write_text(WIDE)
    code, _, err = as_program(monkeypatch, capsys, "upload", tmp_path, "--url", url)
    assert code == 2
    assert err.startswith("loopaudit: ")


def test_a_setting_that_cannot_be_used_is_named(monkeypatch, capsys):
    monkeypatch.setenv("LOOPAUDIT_NIGHTLY_AT", "late")
    code, _, err = as_program(monkeypatch, capsys, "nightly")
    assert code == 2
    assert "LOOPAUDIT_NIGHTLY_AT" in err


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "plant-server", ""])  # noqa: S104 - to be refused
def test_serve_refuses_to_listen_beyond_loopback(monkeypatch, capsys, tmp_path, host):
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    code, _, err = as_program(monkeypatch, capsys, "serve", "--host", host, "--port", "0")
    assert code == 2
    assert "[open_access]" in err
    assert "LOOPAUDIT_ALLOW_OPEN=true" in err


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
    assert "[database_away]" in said
    assert len(said.splitlines()) == 1
