"""`loopaudit inspect`: what it says of files, and with which exit code."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from scipy.io import savemat
from typer.main import get_command

from tests.cli.calling import WIDE, as_program, run

C_LOCALE = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}  # ASCII, with bytes of file names let through


@pytest.mark.parametrize(
    ("settings", "encoding"),
    [({"PYTHONIOENCODING": "ascii"}, "ascii"), ({"PYTHONIOENCODING": "latin-1"}, "latin-1"), (C_LOCALE, "ascii")],
)
def test_a_tag_that_the_encoding_of_stdout_lacks_is_written_in_escapes(tmp_path, settings, encoding):
    (tmp_path / "tags.csv").write_text(WIDE.replace("FIC1.", "K\u00fchler\U0001f4a71."), encoding="utf-8")
    command = [sys.executable, "-m", "app", "inspect", str(tmp_path / "tags.csv")]
    done = subprocess.run(command, capture_output=True, env=os.environ | settings, timeout=120)
    assert (done.returncode, done.stderr) == (0, b"")
    shown = "K\\u00fchler" if encoding == "ascii" else "K\u00fchler"
    assert f"{shown}\\ud83d\\udca71 " in done.stdout.decode(encoding)


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


def test_inspect_says_of_fewer_samples_than_an_audit_needs_that_they_do_not_do_alone(tmp_path):
    header, *rows = ["time,PV,OP", *(f"2026-01-01 00:{k // 60:02d}:{k % 60:02d},{k % 7},{k % 5}" for k in range(100))]
    for count, told in ((99, "not alone: 100 samples are needed"), (100, "yes")):
        export = tmp_path / f"FIC{count}.csv"
        export.write_text("\n".join([header, *rows[:count]]) + "\n")
        (line,) = (line for line in run("inspect", export).stdout.splitlines() if line.startswith(f" FIC{count} "))
        assert " ".join(line.split()).endswith(f"2026-01-01 00:01:{38 + count - 99} {told}")
        refused = json.loads(run("audit", export, "--format", "jsonl").stdout)["verdict"] == "not_auditable"
        assert refused or count == 100


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


def test_dates_ahead_of_the_clock_are_not_read_where_others_can_be(tmp_path, monkeypatch):
    monkeypatch.setattr("app.cli.stamps.time.time_ns", lambda: 1_795_000_000_000_000_000)  # 2026-11-18
    export = tmp_path / "us.csv"
    export.write_text("Time,F.PV,F.OP\n" + "".join(f"11/12/2026 00:00:{k:02d},{k},{k}\n" for k in range(60)))
    text = run("inspect", export).stdout
    assert "2026-11-12 00:00:00" in text
    assert "read otherwise, times lie ahead of the clock" in " ".join(text.split())


def test_inspect_says_how_much_a_hole_leaves_out(tmp_path):
    export = tmp_path / "FIC1.csv"
    seconds = [*range(150), *range(450, 600)]
    lines = (f"2026-01-01 00:{k // 60:02d}:{k % 60:02d},{k % 7},{k % 5}" for k in seconds)
    export.write_text("\n".join(["time,PV,OP", *lines]) + "\n")
    (line,) = (line for line in run("inspect", export).stdout.splitlines() if line.startswith(" FIC1 "))
    assert line.split()[:7] == ["FIC1", "PV", "OP", "300", "1", "no", "50.0"]


@pytest.mark.parametrize(("command", "stream"), [("inspect", "stdout"), ("audit", "stderr")])
def test_tags_that_look_exchanged_are_told_before_anything_is_sent(command, stream, tmp_path):
    noise = np.random.default_rng(3).normal(size=(2, 120))
    rows = (f"{k},{40 + noise[1, k]:.3f},{100 + noise[0, k]:.3f},100" for k in range(120))
    (tmp_path / "FIC1.csv").write_text("\n".join(["time,PV,OP,SP", *rows, ""]))
    done = run(command, tmp_path / "FIC1.csv")
    assert "SP lies with OP, far from PV, in FIC1: are the tags of PV and OP exchanged" in getattr(done, stream)
