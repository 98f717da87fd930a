"""`loopaudit simulate` writes a recording that everything else reads."""

import csv
import io
from datetime import datetime
from itertools import pairwise

import pytest
from typer.testing import CliRunner

from app.cli.main import cli, main
from tests.cli.calling import as_program


def simulated(*arguments: str) -> list[dict[str, str]]:
    result = CliRunner().invoke(cli, ["simulate", *arguments])
    assert result.exit_code == 0, result.output
    return list(csv.DictReader(io.StringIO(result.stdout)))


def test_has_the_columns_of_a_recording_and_as_many_samples_as_asked():
    rows = simulated("--samples", "50", "--interval", "2")
    assert list(rows[0]) == ["time", "SP", "PV", "OP"]
    assert [float(row["time"]) for row in rows] == [2.0 * k for k in range(50)]


def test_a_valve_without_stiction_is_where_op_says():
    rows = simulated("--samples", "200", "--with-valve")
    assert len(rows) == 200
    assert all(abs(float(row["V"]) - float(row["OP"])) < 1e-6 for row in rows)


def test_a_sticky_valve_is_not():
    rows = simulated("--samples", "400", "--valve", "he", "-S", "6", "-J", "2", "--with-valve")
    off = max(abs(float(row["V"]) - float(row["OP"])) for row in rows)
    assert 1.0 < off <= 6.0


def test_the_same_seed_gives_the_same_recording():
    arguments = ("--samples", "60", "--noise", "0.3", "--seed", "5")
    assert simulated(*arguments) == simulated(*arguments)
    assert simulated(*arguments) != simulated("--samples", "60", "--noise", "0.3", "--seed", "6")


def test_writes_to_a_file(tmp_path):
    out = tmp_path / "x.csv"
    result = CliRunner().invoke(cli, ["simulate", "--samples", "10", "--out", str(out)])
    assert result.exit_code == 0
    assert result.stdout == ""
    assert len(out.read_text().splitlines()) == 11


def test_an_impossible_loop_is_a_users_error(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["loopaudit", "simulate", "--ti", "-1"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "loopaudit: the integral time must be positive (inf for P control), got -1.0 s [integral_time]\n"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("-S", "5", "-J", "2"), "-S and -J would do nothing: a linear valve takes none"),
        (("--valve", "he", "-d", "1"), "a he valve takes -S and -J"),
        (("--valve", "one-parameter", "-S", "1"), "a one-parameter valve takes -d"),
        (("--valve", "stuck", "-J", "1"), "a stuck valve takes none"),
        (("--op", "FOO"), "--op would do nothing: it is of a --recording"),
        (("--model", "m.json", "--recording", "r.csv", "--valve", "he"), "--valve would do nothing: a model is"),
        (("--model", "m.json", "--recording", "r.csv", "--start", "2026-01-01"), "--start would do nothing"),
        (("--model", "m.json", "--recording", "r.csv", "--with-valve"), "--with-valve would do nothing"),
    ],
)
def test_what_would_do_nothing_is_refused(arguments, said):
    result = CliRunner().invoke(cli, ["simulate", *arguments], env={"COLUMNS": "300"})
    assert result.exit_code == 2
    assert said in " ".join(result.stderr.replace("│", " ").split())


@pytest.mark.parametrize(("interval", "apart_us"), [("0.0015", 1500), ("0.0625", 62500), ("0.25", 250_000)])
def test_stamps_are_as_far_apart_as_the_samples(interval, apart_us):
    rows = simulated("--samples", "40", "--interval", interval, "--start", "2026-03-01")
    stamps = [datetime.fromisoformat(row["time"]) for row in rows]
    assert {(later - earlier).total_seconds() for earlier, later in pairwise(stamps)} == {apart_us / 1e6}
    assert len({len(row["time"]) for row in rows}) == 1


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[1]", "but '[1]' [model_invalid]"),
        ('{"gain": 1.2}', "it has no 'sampling_interval_s' [model_invalid]"),
        (200_000 * "[", "[model_invalid]"),
        ("no JSON", "[model_invalid]"),
    ],
)
def test_what_is_no_model_is_refused_in_words(monkeypatch, capsys, tmp_path, text, said):
    (tmp_path / "m.json").write_text(text)
    (tmp_path / "r.csv").write_text("time,OP,PV\n0,1,2\n1,2,3\n")
    told = as_program(
        monkeypatch, capsys, "simulate", "--model", str(tmp_path / "m.json"), "--recording", str(tmp_path / "r.csv")
    )
    assert told[:2] == (2, "")
    assert told[2].rstrip().endswith(said)
