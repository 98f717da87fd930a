"""An upload that was acknowledged is there after a power cut; without either of its syncs this test would notice."""

import hashlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.chaos.loss import compiled, power_cut

EXPORT = b"time,FIC1.PV,FIC1.OP\n" + b"".join(b"%d,2,3\n" % second for second in range(1000))
ACKNOWLEDGE = """if True:
    import os, signal, stat, sys
    from app.services.intake import uploads
    from app.services.backend import Backend
    from app.services.upkeep.tables import migrate
    from app.settings import Settings

    forgotten, fsync = sys.argv[2], os.fsync
    if forgotten:
        is_it = {"file": stat.S_ISREG, "folder": stat.S_ISDIR}[forgotten]
        os.fsync = lambda fd: None if is_it(os.fstat(fd).st_mode) else fsync(fd)
    settings = Settings(data_dir=sys.argv[1])
    migrate(settings)
    with uploads.receive(Backend.open(settings), filename="a.csv") as receiving:
        receiving.write(sys.stdin.buffer.read())
        receiving.commit()
        os.kill(os.getpid(), signal.SIGKILL)
"""


def left_after_a_power_cut(data: Path, journal: Path, library: Path, forgotten: str) -> list[bytes]:
    """The bytes of all kept uploads, when the power went at the moment of the acknowledgement."""
    (data / "uploads").mkdir(parents=True)
    preloaded = {
        "LD_PRELOAD": str(library),
        "CHAOS_JOURNAL": str(journal),
        "CHAOS_DISK": str(data / "uploads"),
    }
    done = subprocess.run(
        [sys.executable, "-c", ACKNOWLEDGE, str(data), forgotten],
        input=EXPORT,
        env={**os.environ, **preloaded},
        cwd=Path(__file__).resolve().parents[2],
        capture_output=True,
        timeout=120,
    )
    assert done.returncode == -signal.SIGKILL, done.stderr.decode()
    power_cut(journal)
    name = hashlib.sha256(EXPORT).hexdigest()
    return [file.read_bytes() for file in (data / "uploads").iterdir() if file.name == name]


@pytest.mark.parametrize(
    ("forgotten", "left"), [("", [EXPORT]), ("file", [b""]), ("folder", [])], ids=["as it is", "file", "folder"]
)
def test_what_was_acknowledged_survives_because_both_are_synced(
    tmp_path: Path, forgotten: str, left: list[bytes]
) -> None:
    library = compiled(tmp_path)
    if library is None:
        pytest.skip("no C compiler on this machine")
    assert left_after_a_power_cut(tmp_path / "data", tmp_path / "journal", library, forgotten) == left
