"""What the chaos run judges by must itself be right: the same schedule for a seed, and a power cut that takes away."""

import os
import signal
import subprocess
import sys
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest

from tests.chaos.faults import FAULTS, schedule
from tests.chaos.judging import undone
from tests.chaos.loss import compiled, power_cut
from tests.chaos.processes import Managed, Supervisor
from tests.chaos.watch import Injected

WHOLE = ("write", "sync_file", "rename", "sync_folder")


def test_a_seed_gives_its_schedule_again_and_every_kind_comes() -> None:
    planned = schedule(7, 206, list(FAULTS))
    assert planned == schedule(7, 206, list(FAULTS)) != schedule(8, 206, list(FAULTS))
    assert len(Counter(one.fault.name for one in planned)) == len(FAULTS) >= 12
    moments = [0.0, *(one.at_s for one in planned)]
    gaps = [later - earlier for earlier, later in pairwise(moments)]
    assert min(gaps) >= 5.0
    assert max(gaps) <= 20.0


def test_a_fault_that_could_not_be_done_does_not_count(tmp_path: Path) -> None:
    supervisor = Supervisor()
    supervisor.managed["serve"] = Managed("serve", ("true",), {}, tmp_path / "log")
    with pytest.raises(ProcessLookupError):
        supervisor.kill("serve", signal.SIGKILL, 0.0)
    done, skipped = Injected("a", 0.0, set(), 0, 0), Injected("b", 0.0, set(), 0, 0, skipped="away")
    left_out = Injected("c", 0.0, set(), 0, 0, skipped="not root", left_out=True)
    assert undone([done] * 4 + [skipped]) == ["4 of 5 faults were done"]
    assert undone([done] * 40 + [skipped] + [left_out] * 10) == []


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = compiled(tmp_path_factory.mktemp("shim"))
    if made is None:
        pytest.skip("no C compiler on this machine")
    return made


def after_a_power_cut(library: Path, folder: Path, steps: tuple[str, ...]) -> dict[str, bytes]:
    """Files that are left when a process did these steps and the power went."""
    script = """if True:
        import os, sys
        os.chdir(sys.argv[1])
        for step in sys.argv[2:]:
            if step == "write":
                file = open(sys.argv[1] + "/draft", "wb"); file.write(b"bytes"); file.flush()
            elif step == "sync_file":
                os.fsync(file.fileno())
            elif step == "rename":
                os.rename(sys.argv[1] + "/draft", sys.argv[1] + "/kept")
            else:
                os.fsync(os.open(sys.argv[1], os.O_RDONLY))"""
    disk, journal = folder / "disk", folder / "journal"
    disk.mkdir()
    preloaded = {"LD_PRELOAD": str(library), "CHAOS_JOURNAL": str(journal), "CHAOS_DISK": str(disk)}
    subprocess.run(
        [sys.executable, "-c", script, str(disk), *steps], env={**os.environ, **preloaded}, check=True, timeout=60
    )
    power_cut(journal)
    return {path.name: path.read_bytes() for path in disk.iterdir()}


def test_what_was_synced_is_there(library: Path, tmp_path: Path) -> None:
    assert after_a_power_cut(library, tmp_path, WHOLE) == {"kept": b"bytes"}


@pytest.mark.parametrize("forgotten", ["sync_file", "sync_folder"])
def test_what_was_not_synced_is_gone(library: Path, tmp_path: Path, forgotten: str) -> None:
    left = after_a_power_cut(library, tmp_path, tuple(step for step in WHOLE if step != forgotten))
    assert b"bytes" not in left.values()
