"""Every target that `make help` names can be made, and none is written twice."""

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
