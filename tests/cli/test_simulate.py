"""`loopaudit simulate` writes a recording that everything else reads."""

import csv
import io

import pytest
from typer.testing import CliRunner

from app.cli.main import cli, main


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
    ],
)
def test_stiction_that_the_valve_would_not_have_is_refused(arguments, said):
    result = CliRunner().invoke(cli, ["simulate", *arguments], env={"COLUMNS": "300"})
    assert result.exit_code == 2
    assert said in " ".join(result.stderr.replace("│", " ").split())
