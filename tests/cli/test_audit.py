"""`loopaudit audit`: which files are taken, what comes out, in which order, with which exit code."""

import csv
import gzip
import io
import json
import os
import subprocess
import sys
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from app.cli.audit import recording_files
from app.cli.compiling import AT_FIRST
from app.cli.main import cli
from app.lab.testbench.spells import spell

CONTRACT = {
    "recording", "loop", "samples", "sampling_interval_s", "verdict", "stiction_probability", "reliability", "reasons",
    "yper_pct", "yper_raw_pct", "table2_reading", "hammerstein", "stiction_band_pct_of_op_range", "likely_cause",
    "engine_version", "elapsed_s",
}  # fmt: skip
HAMMERSTEIN = {"d", "S", "J", "na", "nb", "nc", "rmse", "rmse_without_stiction", "search_space", "widenings"}


def audit(*arguments) -> Result:
    """In this process; small folders need no others."""
    return CliRunner().invoke(cli, ["audit", *map(str, arguments)])


def lines(done) -> list[dict]:
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Four recordings, a file that is none, one in another suffix, and one that is left alone."""
    folder = tmp_path_factory.mktemp("recordings")
    for number, name in enumerate(("L0.csv", "L1.csv", "L2.txt", "L3.txt")):
        valve = ["--valve", "he", "-S", "5", "-J", "1"] if number % 2 else []
        command = ["simulate", "--samples", "300", "--noise", "0.1", "--seed", str(number), "--out", str(folder / name)]
        assert CliRunner().invoke(cli, [*command, *valve]).exit_code == 0
    (folder / "labels.csv").write_text("recording,label\nL0,stiction\n")
    (folder / "notes.md").write_text("time,PV,OP\n1,2,3\n")
    return folder


def test_a_folder_gives_one_line_a_recording_and_says_what_it_passed_over(folder):
    done = audit(folder, "--format", "jsonl", "--jobs", "1")
    assert done.exit_code == 0, done.stderr
    assert [line["recording"] for line in lines(done)] == ["L0", "L1", "L2", "L3"]
    assert "labels.csv: skipped" in done.stderr
    assert "notes.md" not in done.stderr


def test_two_processes_say_the_same_in_the_same_order(folder):
    command = [sys.executable, "-m", "app", "audit", str(folder), "--format", "jsonl", "--jobs", "2"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    here, there = lines(audit(folder, "--format", "jsonl", "--jobs", "1")), lines(done)
    for line in here + there:
        line.pop("elapsed_s")
    assert here == there


@pytest.mark.parametrize("files", [1, 8])
def test_while_the_engine_is_compiled_the_command_says_so_once(folder, tmp_path, files):
    """At the first start of a version nothing else was seen for minutes."""
    for number in range(files):
        (tmp_path / f"L{number}.csv").write_bytes((folder / "L1.csv").read_bytes())
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_DISABLE_JIT": "0"}
    command = [sys.executable, "-m", "app", "audit", str(tmp_path)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, env=environment) as process:
        assert AT_FIRST in process.stderr.readline().decode()
        time.sleep(3.0 if files > 1 else 0.0)  # the other processes come to it too
        process.terminate()
        assert AT_FIRST not in process.stderr.read().decode()


def test_the_lines_have_the_fields_of_the_contract(folder):
    told = lines(audit(folder / "L0.csv", folder / "L1.csv", "--format", "jsonl"))
    assert len(told) == 2
    for line in told:
        assert set(line) >= CONTRACT
        assert set(line["hammerstein"]) >= HAMMERSTEIN
        assert line["verdict"] in {"stiction", "no_stiction", "inconclusive", "not_auditable"}
        assert line["loop"] == line["recording"]
        assert all(set(reason) >= {"code", "text"} for reason in line["reasons"])


def test_a_recording_is_audited_once_by_whatever_paths_it_was_named(folder, tmp_path):
    (tmp_path / "link.csv").symlink_to(folder / "L0.csv")
    done = audit(folder / "L0.csv", folder, folder / "L0.csv", tmp_path / "link.csv", "--format", "jsonl")
    assert done.exit_code == 0, done.stderr
    assert [line["recording"] for line in lines(done)] == ["L0", "L1", "L2", "L3"]
    twice = f"{folder / 'L0.csv'}: named twice, read once [same_file]"
    assert done.stderr.splitlines()[:3] == [
        twice,
        twice,
        f"{tmp_path / 'link.csv'}: the same file as {folder / 'L0.csv'}, read once [same_file]",
    ]


def test_a_file_that_was_named_behind_its_folder_is_expected_to_hold_a_recording(folder):
    assert audit(folder, folder / ".." / folder.name / "labels.csv", "--format", "jsonl").exit_code == 1


def test_what_is_named_and_not_there_keeps_nothing_from_the_rest(folder):
    done = audit(folder / "L0.csv", folder / "none.csv", folder / "L1.csv", "--format", "jsonl")
    assert done.exit_code == 1
    assert [line["recording"] for line in lines(done)] == ["L0", "L1"]
    assert f"{folder / 'none.csv'}: is not there [no_such_file]" in done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_sigterm_takes_the_other_processes_along(folder, tmp_path):
    many = tmp_path / "many"
    many.mkdir()
    for number in range(200):
        (many / f"M{number}.csv").write_bytes((folder / "L1.csv").read_bytes())
    command = [sys.executable, "-m", "app", "audit", str(many), "--format", "jsonl", "--jobs", "2"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout.readline()
        others = Path(f"/proc/{program.pid}/task/{program.pid}/children").read_text().split()
        program.terminate()
        assert program.wait(timeout=30) == 143
    deadline = time.monotonic() + 10
    while any(map(lives, others)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert len(others) >= 2
    assert not any(map(lives, others))


def lives(pid: str) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


def test_a_named_file_that_is_no_recording_makes_it_1_and_alone_2(folder):
    assert audit(folder / "L0.csv", folder / "labels.csv").exit_code == 1
    done = audit(folder / "labels.csv")
    assert done.exit_code == 2
    assert done.stdout == ""


def test_a_file_that_was_cut_on_its_way_is_audited_and_makes_it_1(folder, tmp_path):
    packed = gzip.compress((folder / "L1.csv").read_bytes())
    (tmp_path / "cut.csv.gz").write_bytes(packed[: len(packed) * 3 // 4])
    done = audit(tmp_path, "--format", "jsonl")
    assert done.exit_code == 1
    assert [line["recording"] for line in lines(done)] == ["cut"]
    assert done.stderr.count("the gzip file is damaged after") == 1


def test_how_a_recording_was_read_is_told_beside_its_line(tmp_path):
    rows = "\n".join(f"{45352 + k / 8640:.10f},{50 + k % 7},{40 + k % 5}" for k in range(300))
    (tmp_path / "days.csv").write_text(f"time,PV,OP\n{rows}\n")
    done = audit(tmp_path / "days.csv", "--format", "jsonl")
    assert done.exit_code == 0
    assert [line["recording"] for line in lines(done)] == ["days"]
    assert done.stderr.count("times are days since 1899-12-30") == 1


def test_relative_times_of_a_recording_are_nothing_to_be_told(folder):
    assert audit(folder / "L0.csv").stderr == ""


def test_a_file_without_pv_and_op_says_what_is_in_it(folder, tmp_path):
    text = (folder / "L0.csv").read_text().replace("PV,OP", "Durchfluss,Ventil")
    (tmp_path / "other.csv").write_text(text)
    done = audit(tmp_path / "other.csv")
    assert done.exit_code == 2
    assert "Durchfluss" in done.stderr


def test_a_table_and_a_file_of_csv(folder, tmp_path):
    done = audit(folder / "L1.csv")
    assert done.exit_code == 0
    assert "L1" in done.stdout
    assert "1 recording:" in done.stdout
    out = tmp_path / "verdicts.csv"
    done = audit(folder / "L1.csv", "--format", "csv", "--out", out)
    assert done.stdout == ""
    rows = list(csv.DictReader(io.StringIO(out.read_text())))
    assert rows[0]["loop"] == "L1"
    assert set(rows[0]) >= {"verdict", "hammerstein_d", "reasons_text"}
    assert "audit_id" not in rows[0]


def test_a_wide_export_gives_a_line_a_loop(tmp_path):
    rows = "\n".join(f"{k},{50 + k % 7},{40 + k % 5},{10 + k % 3},{20 + k % 2}" for k in range(300))
    (tmp_path / "unit.csv").write_text(f"time,FIC1.PV,FIC1.OP,FIC2.PV,FIC2.OP\n{rows}\n")
    found = lines(audit(tmp_path / "unit.csv", "--format", "jsonl"))
    assert [(line["recording"], line["loop"]) for line in found] == [("unit:FIC1", "FIC1"), ("unit:FIC2", "FIC2")]


@pytest.mark.parametrize(("names", "loop"), [("time,FIC1.PV,FIC1.OP", "FIC1"), ("time,PV,OP", "unit")])
def test_the_loop_of_a_file_has_the_name_that_its_tags_give(tmp_path, names, loop):
    rows = "\n".join(f"{k},{50 + k % 7},{40 + k % 5}" for k in range(300))
    (tmp_path / "unit.csv").write_text(f"{names}\n{rows}\n")
    (line,) = lines(audit(tmp_path / "unit.csv", "--format", "jsonl"))
    assert (line["recording"], line["loop"]) == ("unit", loop)


def test_names_in_a_folder_that_are_taken(tmp_path):
    for name in ("b.CSV", "a.csv", "c.parquet", "d.csv.gz", ".hidden.csv", "e.xlsx", "f.md", "g.mat", "h.TSV"):
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "folder.csv").mkdir()
    taken = [path.name for path in recording_files([tmp_path])]
    assert taken == ["a.csv", "b.CSV", "c.parquet", "d.csv.gz", "e.xlsx", "g.mat", "h.TSV"]


@pytest.mark.parametrize("dated", [True, False])
def test_a_spell_is_told_in_calendar_time_where_the_file_has_one(tmp_path, dated):
    made = spell(0, samples=8000, share=0.25, first=0.4).recording
    start = datetime(2026, 3, 1, tzinfo=UTC)
    rows = ["time,PV,OP"]
    for k, (pv, op) in enumerate(zip(made.pv, made.op, strict=True)):
        rows.append(
            f"{start + timedelta(seconds=k):%Y-%m-%d %H:%M:%S},{pv:.6g},{op:.6g}" if dated else f"{k},{pv},{op}"
        )
    path = tmp_path / "FIC1.csv"
    path.write_text("\n".join(rows) + "\n")
    (line,) = lines(audit(path, "--format", "jsonl"))
    (episode,) = line["episodes"]
    (text,) = [reason["text"] for reason in line["reasons"] if reason["code"] == "short_lived_stiction"]
    if dated:
        assert episode["start"] == f"{start + timedelta(seconds=round(episode['start_s'])):%Y-%m-%dT%H:%M:%SZ}"
        assert text.startswith(f"the valve sticks from {episode['start'][:16].replace('T', ' ')} UTC to 2026-03-01 ")
    else:
        assert episode["start"] is None
        assert text.startswith(f"the valve sticks from {episode['start_s']:.0f} s to ")


def test_local_times_are_read_in_the_zone_that_is_named(tmp_path):
    """Two in the morning comes twice that night; read as UTC the second pass runs back into the first."""
    path = tmp_path / "FIC1.csv"
    rows = [f"2024-10-27 {hour:02d}:{k:02d}:00,{k % 7},{k % 5}" for hour in (1, 2, 2, 3) for k in range(60)]
    path.write_text("time,PV,OP\n" + "\n".join(rows) + "\n")
    (line,) = lines(audit(path, "--format", "jsonl", "--time-zone", "Europe/Berlin"))
    assert line["samples"] == 240
    (line,) = lines(audit(path, "--format", "jsonl"))
    assert line["samples"] == 180


@pytest.mark.parametrize("command", ["audit", "explain", "inspect"])
def test_a_zone_that_is_none_is_refused_before_a_file_is_opened(command, tmp_path):
    path = tmp_path / "FIC1.csv"
    path.write_text("no recording")
    refused = CliRunner().invoke(cli, [command, str(path), "--time-zone", "Mars/Base"])
    assert refused.exception.code == "unknown_time_zone"


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_tags_that_do_not_tell_their_loops_are_grouped_by_a_mapping(folder, tmp_path, jobs):
    mapping = tmp_path / "tags.csv"
    mapping.write_text("tag,loop,signal\nX17,FIC9,PV\nX18,FIC9,OP\n")
    strange = []
    for name in ("L0", "L1"):
        head, *rows = (folder / f"{name}.csv").read_text().splitlines()
        assert head == "time,SP,PV,OP"
        strange.append(tmp_path / f"{name}.csv")
        strange[-1].write_text("\n".join(("time,X16,X17,X18", *rows)) + "\n")
    assert audit(*strange).exit_code == 2
    done = audit(*strange, "--mapping", mapping, "--format", "jsonl", "--jobs", jobs)
    named = [(line["recording"], line["loop"]) for line in lines(done)]
    assert (done.exit_code, named) == (0, [("L0", "FIC9"), ("L1", "FIC9")]), done.stderr
