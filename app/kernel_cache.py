"""Where compiled kernels are kept: one folder for each state of the engine's source.

numba looks only at the file of the function that it compiled: a kernel that calls a changed function in another file
or a package whose files all bear the same date, would go on running old machine code.
"""

import hashlib
import os
from pathlib import Path

ENGINE = Path(__file__).parent / "engine"


def choose() -> None:
    """Points numba to the folder for this source; a folder named before, or a closed home, leaves it as it is."""
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    folder = root / "loopaudit" / "kernels" / _source_digest()
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError:
        return
    if os.access(folder, os.W_OK):
        os.environ["NUMBA_CACHE_DIR"] = str(folder)


def _source_digest() -> str:
    digest = hashlib.blake2b(digest_size=8)
    for path in sorted(ENGINE.rglob("*.py")):
        digest.update(path.relative_to(ENGINE).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()
