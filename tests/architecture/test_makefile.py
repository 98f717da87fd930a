"""Every target that `make help` names can be made, and none is written twice."""

import os
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HELP = re.findall(r'@echo "make (\S+)', (ROOT / "Makefile").read_text("utf-8"))


def dry_run(target: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["make", "--dry-run", target], cwd=ROOT, capture_output=True, text=True, timeout=60)


def test_help_names_the_two_commands_that_do_everything():
    assert {"demo", "test"} <= set(HELP)


@pytest.mark.parametrize("target", HELP)
def test_a_target_that_help_names_can_be_made_and_is_written_once(target):
    run = dry_run(target)
    assert run.returncode == 0, run.stderr
    assert "overriding recipe" not in run.stderr
    assert run.stdout.strip()


def without_pip(folder: Path, venv_makes_it: bool, python: str = "") -> subprocess.CompletedProcess[str]:
    """`make install` where .venv was left half made: a Python without pip; python: what a whole one does."""
    for name in ("Makefile", "requirements.lock", "pyproject.toml"):
        (folder / name).write_bytes((ROOT / name).read_bytes())
    half, fake = folder / ".venv" / "bin" / "python", folder / "python"
    half.parent.mkdir(parents=True)
    half.write_text("#!/bin/sh\nexit 1\n")
    mended = f"printf '#!/bin/sh\\n{python}\\n' > {half}" if venv_makes_it else "exit 1"
    fake.write_text(f'#!/bin/sh\nif [ "$2" = venv ]; then {mended}; fi\n')
    for script in (half, fake):
        script.chmod(0o755)
    told = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    command = ["make", "install", f"PYTHON={fake}"]
    return subprocess.run(command, cwd=folder, env=told, capture_output=True, text=True, timeout=60)


def test_an_environment_that_was_left_without_pip_is_made_anew(tmp_path):
    run = without_pip(tmp_path, venv_makes_it=True)
    assert run.returncode == 0, run.stderr
    assert (tmp_path / ".venv" / ".installed").exists()


def test_what_an_import_compiles_is_kept_though_this_shell_keeps_nothing(tmp_path):
    run = without_pip(tmp_path, venv_makes_it=True, python='echo "kept$PYTHONDONTWRITEBYTECODE" "$@"')
    assert run.returncode == 0, run.stderr
    told = [line for line in run.stdout.splitlines() if line.startswith("kept")]
    assert len(told) > 2
    assert {line.split()[0] for line in told} == {"kept"}
    assert told[-1] == "kept -c import app.main, workers.tasks"


def test_where_no_environment_can_be_made_the_package_is_named_that_is_missing(tmp_path):
    run = without_pip(tmp_path, venv_makes_it=False)
    assert run.returncode != 0
    assert "python3-venv" in run.stderr
    assert not (tmp_path / ".venv" / ".installed").exists()
