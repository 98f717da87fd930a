"""The readers under atheris, which is led by coverage: files of every layout, cut, mixed and spoilt.

    python tests/fuzz/readers.py --seconds 300 [--seed 1] [--corpus folder] [--found tests/corpus]

What breaks a promise of `judging` is written to the folder of finds, one file a place in the code, and the exit code is
1. atheris itself ends the search at an input that takes longer than 20 s or 2 GB. The corpus folder keeps what reached
new code, so that the next search goes on from there.
"""

import argparse
import hashlib
import subprocess
import sys
import traceback
from pathlib import Path

from tests.fuzz.seeds import seeds

WORDS = (
    *("1e400", "-1e-400", "NaN", "inf", "-9999", "Bad Input", "0x10", "1_000", "9" * 40, "1,5", "+", "--1", "１２"),
    *("9999-12-31 00:00:00", "0000-00-00 00:00:00", "2024-02-30", "2024-03-31 02:30:00", "24:00:00", "now", "0"),
    *("'; DROP TABLE loops;--", "<script>alert(1)</script>", "=cmd|'/C calc'!A0", "../../etc/passwd", "\0", "\ufeff"),
    *('"', '""', "'", ";", "\t", "|", "\r", "\r\n", "#", "*", "[", "#NAMES", "#ROWS", "PROCESSDATA", "tagname"),
    *("time", "Tagname", "Value", "Quality", ".PV", ".OP", ".MODE", "AUTO", "MAN", "CAS", "Good", "192", "é", "塔"),
)
SLOWEST_S = 20
MOST_MB = 2048


def search(arguments: argparse.Namespace) -> int:
    """Runs the search in a process of its own, because atheris ends the one that it is in; the exit code."""
    corpus, found = Path(arguments.corpus), Path(arguments.found)
    for folder in (corpus, found):
        folder.mkdir(parents=True, exist_ok=True)
    before = set(found.iterdir())
    for name, data in seeds().items():
        (corpus / f"seed-{name}").write_bytes(data)
    (corpus / "words.dict").unlink(missing_ok=True)
    dictionary = found.parent / f".{found.name}.dict"
    dictionary.write_text("".join(f'"{escaped(word)}"\n' for word in WORDS))
    command = [sys.executable, __file__, "--child", "--found", str(found), str(corpus), f"-dict={dictionary}"]
    limits = [f"-max_total_time={arguments.seconds}", f"-timeout={SLOWEST_S}", f"-rss_limit_mb={MOST_MB}"]
    more = [f"-seed={arguments.seed}", "-max_len=6000", f"-artifact_prefix={found}/", "-print_final_stats=1"]
    ended = subprocess.run([*command, *limits, *more])
    dictionary.unlink()
    finds = sorted(set(found.iterdir()) - before)
    print(
        f"readers: {len(list(corpus.iterdir()))} files in the corpus, {len(finds)} finds, exit code {ended.returncode}"
    )
    for find in finds:
        print(f"  {find}")
    return 1 if finds or ended.returncode else 0


def escaped(word: str) -> str:
    return "".join(
        chr(byte) if 32 < byte < 127 and byte not in b'"\\' else f"\\x{byte:02x}" for byte in word.encode("utf-8")
    )


def child(found: Path, arguments: list[str]) -> None:
    import atheris

    with atheris.instrument_imports(include=["app.ingest"]):
        from tests.fuzz.judging import judge

    places: set[str] = set()

    def try_one(data: bytes) -> None:
        try:
            judge(data)
        except BaseException as error:  # a panic of polars is no Exception
            if isinstance(error, KeyboardInterrupt):
                raise
            keep(found, places, data, error)

    atheris.Setup([sys.argv[0], *arguments], try_one)
    atheris.Fuzz()


def keep(found: Path, places: set[str], data: bytes, error: BaseException) -> None:
    """Writes the input down where nothing was found yet at the same place in the code."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f"{frame.filename}:{frame.lineno}" for frame in frames if "/app/" in frame.filename]
    place = f"{type(error).__name__} {own[-2:]}"
    place += f" {str(error).split(',')[0][:60]}" if isinstance(error, AssertionError) else ""
    if place in places:
        return
    places.add(place)
    name = f"reader-{type(error).__name__}-{hashlib.sha256(data).hexdigest()[:12]}"
    (found / name).write_bytes(data)
    print(f"FOUND {name}: {place}\n{''.join(traceback.format_exception(error))[-1500:]}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--corpus", default=".fuzz/readers")
    parser.add_argument("--found", default=".fuzz/found")
    parser.add_argument("--child", action="store_true")
    arguments, rest = parser.parse_known_args()
    if arguments.child:
        child(Path(arguments.found), rest)
        return
    sys.exit(search(arguments))


if __name__ == "__main__":
    main()
