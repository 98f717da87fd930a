"""The command line as scripts meet it: help, exit codes, what goes to stdout and what to stderr."""

import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from typing import BinaryIO

import click
import pytest
from typer.main import get_command
from typer.testing import CliRunner

from app.cli.main import cli
from app.settings import Settings
from tests import forked
from tests.cli.calling import WIDE

COMMANDS = (
    "demo",
    "explain",
    "serve",
    "worker",
    "beat",
    "upload",
    "nightly",
    "audit",
    "inspect",
    "simulate",
    "migrate",
)


def run(*arguments: str, **options) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "app", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, **options)


def cpu_time_s() -> float:
    """Of this process's ended children: what other processes of the machine do does not count."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def test_help_takes_little_longer_than_what_draws_it():
    """Beside the library that draws it, alone: the engine or the database would make it several times as long."""
    drawing = [sys.executable, "-c", "import typer, typer.rich_utils, rich.markdown"]
    helping = [sys.executable, "-m", "app", "--help"]
    taken = {command: [cpu_of(command) for _ in range(4)] for command in map(tuple, (drawing, helping))}
    alone, ours = (min(times[1:]) for times in taken.values())  # the first start may still compile byte code
    assert ours < 2.5 * alone


def cpu_of(command: tuple[str, ...]) -> float:
    before = cpu_time_s()
    assert subprocess.run(command, capture_output=True, timeout=120).returncode == 0
    return cpu_time_s() - before


def test_an_audit_of_files_loads_no_data_base(tmp_path):
    """It would be a tenth of its time."""
    (tmp_path / "export.csv").write_text(WIDE)
    command = [sys.executable, "-X", "importtime", "-m", "app", "audit", tmp_path / "export.csv"]
    loaded = subprocess.run(command, capture_output=True, text=True, timeout=120).stderr.split()
    assert "app.services.auditing.file_audit" in loaded
    assert "sqlalchemy" not in loaded


def test_a_command_on_the_newest_tables_loads_no_migrations(tmp_path, make_tables):
    """They would be a fifth of its start."""
    make_tables(Settings(data_dir=tmp_path))
    command = [sys.executable, "-X", "importtime", "-m", "app", "keys", "list"]
    environment = os.environ | {"LOOPAUDIT_DATA_DIR": str(tmp_path)}
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment)
    assert done.returncode == 0
    assert "sqlalchemy" in done.stderr.split()
    assert not [name for name in done.stderr.split() if name.startswith(("alembic", "migrations.versions"))]


def test_help_lists_every_command_and_the_exit_codes():
    text = " ".join(run("--help").stdout.split())
    assert all(f" {command} " in text for command in COMMANDS)
    assert "0 done, 1 some inputs" in text
    assert "130 interrupted" in text


def every_command(of: click.Command, *names: str) -> Iterator[tuple[str, ...]]:
    if hasattr(of, "commands"):
        for name, command in of.commands.items():
            yield from every_command(command, *names, name)
    else:
        yield names


@pytest.mark.parametrize("command", list(every_command(get_command(cli))), ids=" ".join)
def test_every_command_teaches_by_an_example_of_itself(command):
    result = CliRunner().invoke(cli, [*command, "--help"])
    assert result.exit_code == 0
    assert "Usage" in result.output
    examples = " ".join(result.output.partition("Examples")[2].split())
    assert f"loopaudit {' '.join(command)}" in examples


@pytest.mark.parametrize("columns", ["60", "80", "140"])
def test_help_is_broken_only_where_the_terminal_ends(columns):
    told = CliRunner().invoke(cli, ["explain", "--help"], env={"COLUMNS": columns}).output.partition("Examples")[0]
    lines = [line.rstrip() for line in told.splitlines()]
    assert sum(map(bool, lines)) > 2
    for line, below in pairwise(lines):
        word = below.split()[:1]
        assert not line or not word or len(f"{line} {word[0]}") >= int(columns), line


@pytest.mark.parametrize(
    "arguments", [["nonsense"], ["audit"], ["audit", "x.csv", "--format", "xml"], ["serve", "--port", "x"]]
)
def test_wrong_usage_is_2_and_says_so_on_stderr(arguments):
    done = run(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr


def test_a_users_error_is_one_line_with_its_code_and_no_traceback():
    done = forked.run("audit", "/no/such/file.csv")
    assert done.returncode == 2
    assert done.stderr == "/no/such/file.csv: is not there [no_such_file]\n"
    assert done.stdout == ""


@pytest.mark.parametrize("arguments", [("simulate", "--samples", "20000"), ("audit", "--help"), ("--help",)])
def test_a_reader_that_has_enough_is_no_failure(arguments):
    with closed_pipe() as nobody:
        done = forked.run(*arguments, stdout=nobody, timeout=60)
    assert done.returncode == 0
    assert "Traceback" not in done.stderr


def closed_pipe() -> BinaryIO:
    """What nobody reads any more."""
    reading, writing = os.pipe()
    os.close(reading)
    return os.fdopen(writing, "wb", buffering=0)


def test_results_are_made_though_nobody_reads_the_messages(tmp_path):
    made = CliRunner().invoke(cli, ["simulate", "--samples", "300", "--out", str(tmp_path / "L.csv")])
    assert made.exit_code == 0
    files = (tmp_path / "none.csv", tmp_path / "L.csv")
    with closed_pipe() as nobody:
        done = forked.run("audit", *files, "--format", "jsonl", stderr=nobody)
    assert done.returncode == 1
    assert done.stdout.count("\n") == 1


def test_an_empty_folder_is_nothing_usable(tmp_path):
    done = forked.run("audit", tmp_path)
    assert done.returncode == 2
    assert "[nothing_to_read]" in done.stderr


@pytest.mark.parametrize("command", [(), ("keys",)], ids=["none", "keys"])
def test_a_command_left_out_is_wrong_usage_told_on_stderr(command):
    done = CliRunner().invoke(cli, list(command))
    assert (done.exit_code, done.stdout) == (2, "")
    assert "Usage: " in done.stderr


def test_version():
    assert run("--version").stdout.startswith("loopaudit ")


def test_what_is_loaded_is_not_looked_through_once_more_at_the_end():
    """What was registered first is called last: by then all that was loaded is frozen."""
    count = "import atexit, gc; atexit.register(lambda: print(gc.get_freeze_count()))"
    script = f"{count}; from app.__main__ import main; main()"
    done = subprocess.run([sys.executable, "-c", script, "--version"], capture_output=True, text=True, timeout=120)
    assert int(done.stdout.splitlines()[-1]) > 10_000
