"""What cannot be done is one line and an exit code, and leaves nothing behind."""

import pytest

from app.services.upkeep import readiness
from tests.cli.calling import WIDE, as_program


@pytest.mark.parametrize(
    ("name", "value"), [("NIGHTLY_AT", "late"), ("TIME_ZONE", "Middle/Earth"), ("TIME_ZONE", "../../etc/passwd")]
)
def test_a_setting_that_cannot_be_used_is_named(monkeypatch, capsys, name, value):
    monkeypatch.setenv(f"LOOPAUDIT_{name}", value)
    code, _, err = as_program(monkeypatch, capsys, "nightly")
    assert code == 2
    assert err.startswith(f"loopaudit: LOOPAUDIT_{name}: ")
    assert "Value error" not in err


@pytest.mark.parametrize(
    "command", ["audit x.csv --format nonsense", "explain x.csv --format nonsense", "keys create me --role nonsense"]
)
def test_a_choice_that_is_none_is_told_without_the_words_of_a_library(monkeypatch, capsys, command):
    code, out, err = as_program(monkeypatch, capsys, *command.split())
    assert (code, out) == (2, "")
    assert ": 'nonsense' is not one of '" in " ".join(err.replace("│", "").split())
    assert "Value error" not in err


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


def test_a_night_without_room_names_the_disk_alone(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    assert as_program(monkeypatch, capsys, "migrate")[0] == 0
    monkeypatch.setattr(readiness, "free_bytes", lambda settings: 3_000_000)
    code, _, err = as_program(monkeypatch, capsys, "nightly")
    assert code == 2
    said = "nothing was started: the disk of the data folder has 3 MB free, and 105 MB are needed [not_ready]"
    assert err == f"loopaudit: {said}\n"


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
